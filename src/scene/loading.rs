//! What moves the tissue of a scene, as far as its inertia can show.

use glam::DVec3;

use super::{Face, FaceCondition, SetLoad};
use crate::effects::mass_scaling::Loading;
use crate::needle::Motion;

impl Loading {
    /// Of a tool with this motion (`None` without a tool) and of the faces of a tissue of this size [m]. Loads that come at once are left
    /// out: their waves are wanted.
    pub fn of(motion: Option<&Motion>, faces: &[FaceCondition; 6], size: DVec3) -> Self {
        let slowness = |face: Face| {
            let FaceCondition { drive, traction, traction_ramp, .. } = &faces[face as usize];
            let ramp = traction.map(|_| *traction_ramp).filter(|ramp| *ramp > 0.0);
            let times = drive.map(|drive| drive.duration).into_iter().chain(ramp);
            times.map(move |time| time / size[face.axis()]).reduce(f64::min)
        };
        Loading {
            tool_speed: motion.map_or(0.0, Motion::largest_speed),
            slowness: Face::ALL.into_iter().filter_map(slowness).reduce(f64::min),
        }
    }

    /// The same with loads on sets of a mesh, which may act along any side of the tissue.
    pub fn with_loads(self, loads: &[SetLoad], size: DVec3) -> Self {
        let own = loads.iter().map(|load| load.ramp).filter(|ramp| *ramp > 0.0).map(|ramp| ramp / size.max_element());
        Loading { slowness: own.chain(self.slowness).reduce(f64::min), ..self }
    }
}
