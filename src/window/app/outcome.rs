//! What a window has come to once it is closed.

use crate::haptic::LoopTiming;
use crate::window::practice::Latency;
use crate::window::tuning::Pace;
use crate::{Error, Result};

/// What a session may come to: how many pictures were drawn, how fast, and how the run stands.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct ViewOutcome {
    /// A scene was shown; all figures but the last of the devices are those of the last one.
    pub practised: bool,
    pub pictures: u64,
    /// Wall time from the start of the program to the first picture [s].
    pub first_picture: f64,
    pub frames: u64,
    pub depth: f64,
    pub force: f64,
    /// Pictures a second, mean from the first to the last one.
    pub frames_per_second: f64,
    /// Longest time between two pictures [s].
    pub longest_pause: f64,
    /// Simulated over wall time while the run was on, the window with its pictures included; at most the pace.
    pub achieved: f64,
    /// The same of the frames alone, from their start to their results.
    pub real_time_factor: f64,
    pub latency: Latency,
    /// How switches of effects went.
    pub switches: Vec<Pace>,
    /// How the loop of the forces kept its time, where there was one.
    pub haptic: Option<LoopTiming>,
    pub stopped: Option<String>,
}

impl ViewOutcome {
    /// The lines for the terminal.
    ///
    /// # Errors
    /// `Error::Device` where the guard has stopped the run.
    pub fn text(self) -> Result<String> {
        if let Some(reason) = self.stopped {
            return Err(Error::Device(reason));
        }
        if !self.practised {
            return Ok("the window was closed, no scene was opened".into());
        }
        let latency = self.latency;
        let felt = match latency.count {
            0 => "no input".to_string(),
            n => format!(
                "{n} inputs: force after {} frame(s) of tissue at most, {:.0} ms in the mean, {:.0} ms at most",
                latency.most_frames,
                latency.mean * 1e3,
                latency.longest * 1e3
            ),
        };
        let haptic = self.haptic.map_or(String::new(), |timing| format!("\nhaptic: {}", timing.text()));
        let switches = match self.switches.iter().map(|pace| pace.halted).max() {
            None => String::new(),
            Some(halted) => {
                let whole: Vec<String> = self.switches.iter().map(|pace| pace.whole.as_millis().to_string()).collect();
                format!(
                    "\neffects switched in {} ms; frames halted for {} ms at most",
                    whole.join(", "),
                    halted.as_millis()
                )
            }
        };
        Ok(format!(
            "{} pictures, {:.1} a second, at most {:.0} ms apart; first one after {:.2} s\n{} frames of tissue, {:.2} of real time with the window open (tissue alone: \
             {:.2}); {:.3} N at {:.2} mm\n{felt}{switches}{haptic}",
            self.pictures,
            self.frames_per_second,
            1e3 * self.longest_pause,
            self.first_picture,
            self.frames,
            self.achieved,
            self.real_time_factor,
            self.force,
            self.depth * 1e3
        ))
    }
}
