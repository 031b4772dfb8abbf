//! The scale of the colours follows what the field holds.

use super::practice_screen::PracticeScreen;
use crate::Result;
use crate::gpu::{Gpu, Memory};
use crate::observables::field::{Lane, Range};
use crate::window::panels;

/// Part of the nodes that may lie beyond the automatic scale.
const BEYOND_SCALE: f64 = 0.002;

impl PracticeScreen {
    /// Brings the ends of the scale to what the field holds now.
    pub(super) fn follow_range(&mut self, gpu: &Gpu) -> Result<()> {
        let scale = &mut self.choices.scale;
        let (Lane::Node(lane), Range::Positive(_) | Range::Signed(_)) = (scale.field.lane, scale.field.range) else {
            *scale = panels::default_scale(scale.field);
            return Ok(());
        };
        let Some(engine) = self.practice.simulation.on_device() else { return Ok(()) };
        let Some(buffer) = engine.memory("drawn_nodes").and_then(Memory::buffer) else { return Ok(()) };
        let bytes = gpu.read_back(buffer)?;
        let mut values: Vec<f32> =
            bytes.chunks_exact(16).map(|b| bytemuck::pod_read_unaligned::<[f32; 4]>(b)[lane].abs()).collect();
        values.sort_unstable_by(f32::total_cmp);
        let at = ((1.0 - BEYOND_SCALE) * values.len() as f64) as usize;
        // A scale with three digits that moves little from look to look; never below 0.1 kPa.
        let high = f64::from(values.get(at).copied().unwrap_or(0.0)).max(100.0);
        scale.high = if (high / scale.high - 1.0).abs() > 0.1 { high } else { scale.high };
        scale.low = match scale.field.range {
            Range::Signed(_) => -scale.high,
            _ if scale.logarithmic => 0.01 * scale.high,
            _ => 0.0,
        };
        Ok(())
    }
}
