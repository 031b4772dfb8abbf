//! What a run that stopped leaves in its folder `forensics`: where it began, step by step, and the means to see it again.
//!
//! | file | holds |
//! |---|---|
//! | `report.txt` | the step, the cell, the quantity, what acts there, and how to see it again |
//! | `finding.json` | the same for programs |
//! | `steps.csv` | energies, Jacobians and speeds of every step from the checkpoint to the first sign |
//! | `last_energies.csv` | the energies of the last frames, as in the folder above |
//! | `place.png` | a cut through the place, which a cross marks |
//! | `checkpoint.stylet` | the run a little before: `stylet run --resume` shows the failure again |

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Serialize;

use super::checkpoint::RunCheckpoint;
use super::folder::{CHECKPOINT, OutputFolder};
use super::tables::write_energy_table;
use crate::gpu::Gpu;
use crate::model::Model;
use crate::render;
use crate::render::slice::Plane;
use crate::scene::{Scene, Target};
use crate::simulation::investigation::{Finding, Sign, StepRecord};
use crate::whole_file;
use crate::{Error, Result};

/// Name of the folder.
pub const FORENSICS: &str = "forensics";
const REPORT: &str = "report.txt";
const FINDING: &str = "finding.json";
const ENERGIES: &str = "last_energies.csv";
const STEPS: &str = "steps.csv";
const PICTURE: &str = "place.png";

/// Frames whose energies are kept.
const LAST_FRAMES: usize = 40;

/// A tool whose axis lies farther from the place than this many cells is left out of the picture.
const NEAR: f64 = 1.5;

#[derive(Serialize)]
struct Told<'a> {
    error: &'a str,
    /// First sign: step since t = 0 and its end [s].
    step: u64,
    time_s: f64,
    sign: &'a str,
    cell: usize,
    place_m: [f64; 3],
    jacobian: f64,
    von_mises_pa: f64,
    node: usize,
    speed_m_per_s: f64,
    speed_over_wave_speed: f64,
    acting: &'a [String],
    replay: String,
}

/// Writes the folder; returns its path and what could not be written, file by file. `error`: what the run said when it
/// stopped; `checkpoint`: where the replay begins.
///
/// # Errors
/// `Error::File` where there can be no such folder.
pub fn write_forensics(
    output: &OutputFolder,
    model: &Model,
    finding: &Finding,
    error: &str,
    checkpoint: &RunCheckpoint,
    device: Option<&Gpu>,
) -> Result<(PathBuf, Vec<Error>)> {
    let folder = output.file(FORENSICS);
    fs::create_dir_all(&folder).map_err(|source| Error::file(&folder, source))?;
    let at = finding.steps.last().copied().unwrap_or_default();
    let told = Told {
        error,
        step: at.step,
        time_s: at.time,
        sign: sign_text(finding.sign),
        cell: finding.cell,
        place_m: finding.place.to_array(),
        jacobian: finding.jacobian,
        von_mises_pa: finding.von_mises,
        node: finding.node,
        speed_m_per_s: finding.speed,
        speed_over_wave_speed: finding.speed / model.scaled_wave_speed(),
        acting: &finding.acting,
        replay: format!("stylet run --resume {}", folder.display()),
    };
    let json =
        serde_json::to_string_pretty(&told).map_err(|source| Error::file(folder.join(FINDING), source.into()))?;
    let records = &checkpoint.records;
    let last = &records[records.len().saturating_sub(LAST_FRAMES)..];
    // The small ones first: they may still fit on a disk that is almost full.
    let written = [
        whole_file::write(&folder.join(REPORT), report(&told, finding, checkpoint).as_bytes()),
        whole_file::write(&folder.join(FINDING), (json + "\n").as_bytes()),
        whole_file::write(&folder.join(STEPS), steps_table(&finding.steps).as_bytes()),
        write_energy_table(&folder.join(ENERGIES), &model.effects.own, last),
        draw(&folder.join(PICTURE), model, finding, device),
        checkpoint.write(&folder.join(CHECKPOINT)),
    ];
    Ok((folder, written.into_iter().filter_map(Result::err).collect()))
}

fn sign_text(sign: Option<Sign>) -> &'static str {
    match sign {
        Some(Sign::NotFinite) => "a displacement or velocity is NaN or out of range",
        Some(Sign::Speed) => "a node came near the speed limit",
        Some(Sign::Inversion) => "a cell turned inside out",
        None => "no single step stands out before the frame that stopped the run",
    }
}

fn report(told: &Told, finding: &Finding, checkpoint: &RunCheckpoint) -> String {
    let x = finding.place * 1e3;
    let begin = checkpoint.records.last().map_or(0.0, |r| r.time);
    format!(
        "{}\n\nFirst sign: {} in step {} (frame {}, t = {:.6} s).\nCell {} at ({:.3}, {:.3}, {:.3}) mm, J {:.4}, von Mises {:.3} kPa; \
         node {} moves at {:.4} m/s, {:.3} of the scaled wave speed.\nActing there: {}.\n\nTo see it again from t = {begin:.6} s:\n    \
         {}\n",
        told.error,
        told.sign,
        told.step,
        finding.frame,
        told.time_s,
        told.cell,
        x.x,
        x.y,
        x.z,
        told.jacobian,
        told.von_mises_pa * 1e-3,
        told.node,
        told.speed_m_per_s,
        told.speed_over_wave_speed,
        told.acting.join(", "),
        told.replay
    )
}

fn steps_table(steps: &[StepRecord]) -> String {
    let mut text = String::from(
        "step,time_s,elastic_j,kinetic_j,hourglass_j,min_j,min_corner_j,inverted_cells,max_speed_m_per_s,clamped_nodes\n",
    );
    for s in steps {
        text += &format!(
            "{},{:.9e},{:.6e},{:.6e},{:.6e},{:.6},{:.6},{},{:.6e},{}\n",
            s.step,
            s.time,
            s.elastic,
            s.kinetic,
            s.hourglass,
            s.min_j,
            s.min_corner_j,
            s.inverted_cells,
            s.max_speed,
            s.clamped_nodes
        );
    }
    text
}

/// A cut through the place: that of every picture of the run where its tool passes by, else one parallel to xz without it.
fn draw(path: &Path, model: &Model, finding: &Finding, device: Option<&Gpu>) -> Result<()> {
    let mut scene = Scene { targets: Vec::new(), ..model.scene.clone() };
    let mut fields = finding.fields.clone();
    let plane = Plane::of_scene(&scene, &model.mesh, &fields);
    let far = (finding.place - plane.origin).dot(plane.normal).abs() > NEAR * scene.tissue.cell_size;
    if far || scene.tool.is_none() {
        scene.tool = None;
        fields.tool_pose = None;
        scene.motion.entry = DVec3::new(finding.place.x, finding.place.y, 0.0);
    }
    let radius = scene.tissue.cell_size;
    scene.targets = vec![Target { name: "trouble".into(), position: finding.place, radius }];
    let moved = model.mesh.cell_nodes(finding.cell).iter().map(|n| fields.displacement[*n]).sum::<DVec3>()
        / model.mesh.cell_nodes(finding.cell).len() as f64;
    fields.targets = vec![finding.place + if moved.is_finite() { moved } else { DVec3::ZERO }];
    let image = render::draw(&scene, &model.mesh, &fields, device.map(|g| (&g.device, &g.queue)))?;
    image.write_png(path)
}
