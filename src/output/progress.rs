//! One line on the terminal while a run goes on. Silent where standard error is no terminal.

use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::observables::FrameRecord;

/// Most important things first: a narrow terminal cuts the line off at its right end.
const LINE: &str = "{bar:10} {percent:>3}% {wide_msg}";

/// Ticks of the bar per simulated second.
const TICKS_PER_SECOND: f64 = 1e6;

/// The progress line of one run.
#[derive(Debug)]
pub struct Progress {
    bar: ProgressBar,
    /// Simulated time of the whole run [s].
    total: f64,
}

impl Progress {
    /// `total_simulated`: simulated time of the whole run [s].
    pub fn new(total_simulated: f64) -> Self {
        // indicatif hides the bar where standard error is no terminal.
        Self::on(ProgressDrawTarget::stderr(), total_simulated)
    }

    /// The same on another target, for tests.
    pub fn on(target: ProgressDrawTarget, total_simulated: f64) -> Self {
        let style = ProgressStyle::with_template(LINE)
            .expect("the template is a constant that a test draws")
            .progress_chars("=> ");
        let bar = ProgressBar::with_draw_target(Some(ticks(total_simulated)), target);
        bar.set_style(style);
        Self { bar, total: total_simulated }
    }

    /// Shows one frame; `real_time_factor` is simulated time over wall time.
    pub fn update(&self, record: &FrameRecord, real_time_factor: f64) {
        let left = (self.total - record.time).max(0.0) / real_time_factor;
        self.bar.set_position(ticks(record.time));
        self.bar.set_message(message(record, real_time_factor, left));
    }

    /// Removes the line.
    pub fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

fn ticks(time: f64) -> u64 {
    (time * TICKS_PER_SECOND) as u64
}

/// A time left in words: `12s`, `4m05s`, `1h23m`; `?` where it is no number.
pub(crate) fn time_left(seconds: f64) -> String {
    match Duration::try_from_secs_f64(seconds) {
        Ok(left) if left.as_secs() >= 3600 => {
            format!("{}h{:02}m", left.as_secs() / 3600, left.as_secs() / 60 % 60)
        }
        Ok(left) if left.as_secs() >= 60 => {
            format!("{}m{:02}s", left.as_secs() / 60, left.as_secs() % 60)
        }
        Ok(left) => format!("{:.0}s", left.as_secs_f64()),
        Err(_) => "?".into(),
    }
}

fn message(record: &FrameRecord, real_time_factor: f64, left: f64) -> String {
    let left = time_left(left);
    format!(
        "{:.1}mm {:.2}N {left} left   {real_time_factor:.2} x real time   t = {:.2} s",
        record.depth * 1e3,
        record.force.axial,
        record.time
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observables::ForceParts;
    use indicatif::TermLike;
    use std::io;
    use std::sync::{Arc, Mutex};

    /// A terminal of a given width that remembers what stands on its one line.
    #[derive(Debug, Clone)]
    struct OneLine {
        columns: u16,
        text: Arc<Mutex<String>>,
    }

    impl TermLike for OneLine {
        fn width(&self) -> u16 {
            self.columns
        }
        fn move_cursor_up(&self, _: usize) -> io::Result<()> {
            Ok(())
        }
        fn move_cursor_down(&self, _: usize) -> io::Result<()> {
            Ok(())
        }
        fn move_cursor_right(&self, _: usize) -> io::Result<()> {
            Ok(())
        }
        fn move_cursor_left(&self, _: usize) -> io::Result<()> {
            Ok(())
        }
        fn write_line(&self, text: &str) -> io::Result<()> {
            self.write_str(text)
        }
        fn write_str(&self, text: &str) -> io::Result<()> {
            self.text.lock().unwrap().push_str(text);
            Ok(())
        }
        fn clear_line(&self) -> io::Result<()> {
            self.text.lock().unwrap().clear();
            Ok(())
        }
        fn flush(&self) -> io::Result<()> {
            Ok(())
        }
    }

    fn line(columns: u16) -> String {
        let terminal = OneLine { columns, text: Arc::default() };
        let target = ProgressDrawTarget::term_like_with_hz(Box::new(terminal.clone()), 255);
        let progress = Progress::on(target, 12.0);
        let record = FrameRecord {
            time: 6.0,
            depth: 12e-3,
            force: ForceParts { axial: 1.294, ..Default::default() },
            ..Default::default()
        };
        progress.update(&record, 0.5);
        progress.bar.force_draw();
        let shown = terminal.text.lock().unwrap().clone();
        progress.finish();
        assert_eq!(*terminal.text.lock().unwrap(), "");
        shown
    }

    #[test]
    fn fits_into_80_and_40_columns() {
        let wide = line(80);
        assert_eq!(wide.trim_end(), "=====>      50% 12.0mm 1.29N 12s left   0.50 x real time   t = 6.00 s");
        let narrow = line(40);
        assert!(narrow.trim_end().chars().count() <= 40, "{narrow:?}");
        assert!(narrow.contains("12.0mm 1.29N 12s left"), "{narrow:?}");
    }

    #[test]
    fn odd_numbers_do_not_stop_a_run() {
        for factor in [0.0, f64::NAN, f64::INFINITY] {
            message(&FrameRecord::default(), factor, 1.0 / factor);
        }
        assert!(message(&FrameRecord::default(), 0.01, 5000.0).contains("1h23m left"));
    }
}
