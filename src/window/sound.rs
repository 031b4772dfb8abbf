//! Tones for what happens in an attempt, made by ourselves. Without the feature `sound`, and where the system has no device for it, a
//! [`Speaker`] does not open and says why.

use crate::training::events::Gravity;

/// Length of a tone, and of its rise and fall [s].
const LENGTH: f32 = 0.18;
const EDGE: f32 = 0.015;
/// Largest value of a tone; 1 is as loud as a device can.
const LOUDNESS: f32 = 0.25;

/// The two notes of a tone [Hz]: good rises, bad falls, and they lie far enough apart for one who hears badly at either end.
fn notes(gravity: Gravity) -> [f32; 2] {
    match gravity {
        Gravity::Good => [660.0, 880.0],
        Gravity::Note => [520.0, 520.0],
        Gravity::Bad => [330.0, 220.0],
    }
}

/// A tone as samples at a rate [Hz].
pub fn tone(gravity: Gravity, rate: u32) -> Vec<f32> {
    let (rate, [first, second]) = (rate as f32, notes(gravity));
    let count = (LENGTH * rate) as usize;
    let mut turn = 0.0f32;
    let sample = |n: usize| {
        let time = n as f32 / rate;
        let note = if time < 0.5 * LENGTH { first } else { second };
        turn = (turn + note / rate).fract();
        // Soft edges: without them a loudspeaker clicks.
        let edge = (time / EDGE).min((LENGTH - time) / EDGE).clamp(0.0, 1.0);
        LOUDNESS * edge * (std::f32::consts::TAU * turn).sin()
    };
    (0..count).map(sample).collect()
}

/// This program can play tones, where the system has a device for it.
pub const BUILT: bool = cfg!(feature = "sound");

#[cfg(feature = "sound")]
pub use device::Speaker;

#[cfg(feature = "sound")]
mod device {
    use std::sync::mpsc::{Receiver, Sender, channel};

    use cpal::traits::{DeviceTrait, HostTrait, StreamTrait};

    use super::tone;
    use crate::training::events::Gravity;

    /// The device that the system plays on, open as long as this lives.
    pub struct Speaker {
        tones: Sender<Gravity>,
        _stream: cpal::Stream,
    }

    /// What the device takes its samples from.
    struct Playing {
        tones: Receiver<Gravity>,
        rate: u32,
        channels: usize,
        now: Vec<f32>,
        at: usize,
    }

    impl Playing {
        fn fill(&mut self, out: &mut [f32]) {
            // The newest tone takes the place of the one before.
            if let Some(gravity) = self.tones.try_iter().last() {
                (self.now, self.at) = (tone(gravity, self.rate), 0);
            }
            for frame in out.chunks_mut(self.channels) {
                frame.fill(self.now.get(self.at).copied().unwrap_or(0.0));
                self.at += 1;
            }
        }
    }

    impl Speaker {
        /// Opens the device that the system has chosen; the reason where there is none.
        ///
        /// # Errors
        /// Text for people.
        pub fn open() -> Result<Speaker, String> {
            let device = cpal::default_host().default_output_device().ok_or("the system has no device for sound")?;
            let supported = device.default_output_config().map_err(|reason| reason.to_string())?;
            let config = supported.config();
            let (tones, receiver) = channel();
            let mut playing = Playing {
                tones: receiver,
                rate: config.sample_rate,
                channels: usize::from(config.channels.max(1)),
                now: Vec::new(),
                at: 0,
            };
            let failed = |reason| log::warn!("sound: {reason}");
            let fill = move |out: &mut [f32], _: &cpal::OutputCallbackInfo| playing.fill(out);
            let stream = device.build_output_stream(config, fill, failed, None).map_err(|reason| reason.to_string())?;
            stream.play().map_err(|reason| reason.to_string())?;
            Ok(Speaker { tones, _stream: stream })
        }

        /// Plays a tone now.
        pub fn play(&self, gravity: Gravity) {
            // A device that is gone says so in the log, and costs nothing else.
            let _ = self.tones.send(gravity);
        }
    }
}

#[cfg(not(feature = "sound"))]
pub struct Speaker(std::convert::Infallible);

#[cfg(not(feature = "sound"))]
impl Speaker {
    /// There is none.
    ///
    /// # Errors
    /// Always: what to build for sound.
    pub fn open() -> Result<Speaker, String> {
        Err(crate::words::say("lesson-sound-not-built").to_string())
    }

    pub fn play(&self, _: Gravity) {
        match self.0 {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tones_differ_begin_and_end_softly_and_are_not_too_loud() {
        let crossings = |samples: &[f32]| samples.windows(2).filter(|w| w[0] < 0.0 && w[1] >= 0.0).count();
        let rate = 48_000;
        let all = [Gravity::Good, Gravity::Note, Gravity::Bad].map(|gravity| tone(gravity, rate));
        for samples in &all {
            assert_eq!(samples.len(), (LENGTH * rate as f32) as usize);
            assert!(samples[0].abs() < 0.01 && samples[samples.len() - 1].abs() < 0.01);
            let loudest = samples.iter().fold(0.0f32, |most, s| most.max(s.abs()));
            assert!((0.8 * LOUDNESS..=LOUDNESS).contains(&loudest), "{loudest}");
        }
        let halves = all.each_ref().map(|s| [crossings(&s[..s.len() / 2]), crossings(&s[s.len() / 2..])]);
        assert!(halves[0][1] > halves[0][0] && halves[2][1] < halves[2][0], "{halves:?}");
        // 660 and 880 turns a second for 90 ms each.
        assert!((58..=60).contains(&halves[0][0]) && (78..=80).contains(&halves[0][1]), "{halves:?}");
    }
}
