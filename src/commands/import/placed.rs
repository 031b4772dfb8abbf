//! Where the file is put, as the command line says it.

use glam::DVec3;

use super::ImportArgs;
use crate::error::{Error, Result};
use crate::mesh::Placement;

/// The placement that the options ask for; none leaves the file where it is.
///
/// # Errors
/// Where the numbers are none, or place nothing.
pub fn asked(args: &ImportArgs) -> Result<Placement> {
    let axis = args.axis.as_deref().map(|text| three("--axis", text)).transpose()?;
    let shift = args.translation.as_deref().map(|text| three("--translation", text)).transpose()?;
    let placement = Placement::new(args.scale.unwrap_or(1.0), axis, args.angle, shift.unwrap_or_default() * 1e-3);
    placement.map_err(|wrong| {
        let option = wrong.key.trim_end_matches("_deg");
        Error::input(format!("--{option}: {}", wrong.message), wrong.way_out)
    })
}

/// Three numbers of the command line.
fn three(option: &str, text: &str) -> Result<DVec3> {
    let numbers: Vec<Option<f64>> = text.split(',').map(|word| word.trim().parse().ok()).collect();
    match numbers.as_slice() {
        [Some(x), Some(y), Some(z)] if [x, y, z].iter().all(|x| x.is_finite()) => Ok(DVec3::new(*x, *y, *z)),
        _ => Err(Error::input(
            format!("{option} {text}: these are not three numbers"),
            format!("write x,y,z without blanks, e.g. {option} 0,0,1"),
        )),
    }
}

/// The table of a scene that places a label map so, on one line; nothing where it stays.
pub fn line(placement: &Placement) -> String {
    if placement.is_none() {
        return String::new();
    }
    let list = |v: DVec3| v.to_array().map(|x| (x + 0.0).to_string()).join(", ");
    let Placement { scale, axis, angle_deg, shift, .. } = placement;
    format!(
        "transform = {{ scale = {scale}, axis = [{}], angle_deg = {angle_deg}, translation_mm = [{}] }}\n",
        list(*axis),
        list(*shift * 1e3)
    )
}
