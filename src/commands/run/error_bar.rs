//! The companion of a run: who it is, and what it tells at the end.

use std::sync::atomic::AtomicBool;

use super::RunArgs;
use crate::error::{Error, Result};
use crate::observables::FrameRecord;
use crate::observables::error_bar::{ASSUMED_ORDER, factor};
use crate::output::curve::frames_on_the_way_in;
use crate::output::{Band, CurveFigures};
use crate::scene::Scene;
use crate::simulation::Simulation;
use crate::simulation::companion::{Companion, WIDER};
use crate::study::analysis::observed_order;
use crate::study::metrics::mean_error;
use crate::study::precision;
use crate::study::store::default_folder;
use crate::study::subject::Subject;
use crate::units::trimmed;

/// A companion with the order that it counts with.
pub struct Beside {
    companion: Companion,
    /// Where one was observed.
    pub order: Option<f64>,
}

impl Beside {
    /// The companion of a run at its beginning, announced.
    ///
    /// # Errors
    /// `Error::Input` for a scene without a tool, and where there can be no wider cells; the text has the reason.
    pub fn of(simulation: &Simulation, args: &RunArgs) -> Result<Self> {
        let overrides = &args.scene.overrides;
        let scene = &simulation.model.scene;
        let coarser = coarser(scene, overrides)?;
        let study = default_folder(&scene.name);
        let order = args.order.unwrap_or_else(|| observed_order(&study, scene, overrides));
        let companion = Companion::of(simulation, coarser, order)?;
        let by = match (order, args.order) {
            (Some(order), Some(_)) => format!("order {order:.2} as coarse runs or the run before had it"),
            (Some(order), None) => format!("order {order:.2} from {}", study.display()),
            (None, _) => {
                format!("order {ASSUMED_ORDER} assumed: no study of this scene in {} has one", study.display())
            }
        };
        let model = companion.model();
        eprintln!(
            "error bar: companion with {} cells of {} mm; {by}",
            model.mesh.cell_count(),
            trimmed(model.scene.tissue.cell_size * 1e3)
        );
        Ok(Beside { companion, order })
    }

    /// Half-width of the band in the frame of `record` [N]; a companion that is stopped is told once.
    pub fn error_of(&mut self, record: &FrameRecord) -> Option<f64> {
        let ran = self.companion.stopped.is_none();
        let error = self.companion.error_of(record);
        if let Some(reason) = self.companion.stopped.as_ref().filter(|_| ran) {
            eprintln!("note: the companion of the error bar was stopped, no band from here on: {reason}");
        }
        error
    }

    /// Begins the band anew and takes it through these records, for a run that has gone on or back.
    pub fn follow(&mut self, records: &mut [FrameRecord]) {
        self.companion.begin_again();
        for record in records {
            record.force_error = self.error_of(record);
        }
    }

    /// What it tells of a whole run.
    pub fn band(&self, records: &[FrameRecord]) -> Band {
        let figures = CurveFigures::from_records(records);
        let reached = records.len().min(self.companion.records.len());
        let beside = CurveFigures::from_records(&self.companion.records[..reached]);
        let curve = |records: &[FrameRecord]| -> Vec<(f64, f64)> {
            frames_on_the_way_in(records).map(|r| (r.depth, r.force.axial)).collect()
        };
        let apart = mean_error(&curve(&self.companion.records[..reached]), &curve(records));
        let depth = figures.puncture_depth.zip(beside.puncture_depth);
        Band {
            companion_cell_mm: self.companion.model().scene.tissue.cell_size * 1e3,
            companion_cells: self.companion.model().mesh.cell_count() as u64,
            companion_wall_s: self.companion.taken.as_secs_f64(),
            order: self.order.unwrap_or(ASSUMED_ORDER),
            order_observed: self.order.is_some(),
            companion_doubt: self.companion.records.last().and_then(|record| record.verdict.sentence()),
            mean_error: apart.map(|apart| factor(self.order) * apart),
            force_error_at_max_depth_n: at_the_deepest(records),
            puncture_depth_error_m: depth.map(|(a, b)| factor(self.order) * (a - b).abs()),
        }
    }
}

/// Half-width of the band at the deepest point on the way in [N].
fn at_the_deepest(records: &[FrameRecord]) -> Option<f64> {
    let deepest = records.iter().filter(|r| r.depth.is_finite()).max_by(|a, b| a.depth.total_cmp(&b.depth))?;
    deepest.force_error
}

/// The scene with wider cells; the refusal says why there is none.
pub(super) fn coarser(scene: &Scene, overrides: &[String]) -> Result<Scene> {
    if scene.tool.is_none() {
        return Err(Error::input(
            format!("the scene {} has no tool, so no force to put a band around", scene.name),
            "run it without --error-bar and --error",
        ));
    }
    let wider = scene.wider_cells(WIDER)?;
    Scene::load(&scene.path, &[overrides, &wider[..]].concat()).map_err(|refused| {
        Error::input(
            format!("no companion of {}: with {} the scene is refused\n{refused}", scene.name, wider[0]),
            "take narrower cells (tissue.cell_size_mm), or run without --error-bar and --error",
        )
    })
}

/// The arguments with cell edge and mass scaling chosen for `error`; what was chosen is told.
///
/// # Errors
/// Those of [`precision::parse`] and [`precision::choose`].
pub(super) fn choose(error: &str, args: &RunArgs, interrupted: &AtomicBool) -> Result<RunArgs> {
    let asked = precision::parse(error)?;
    let subject = Subject::load(&args.scene.file, &args.scene.overrides, args.engine)?;
    let choice = precision::choose(&subject, asked, interrupted, &mut |run| eprintln!("trying {run}"))?;
    eprintln!("{}", choice.describe());
    let mut args = args.clone();
    args.scene.overrides.extend(choice.overrides());
    (args.error_bar, args.order) = (true, Some(choice.order));
    Ok(args)
}
