//! Predictions beside measurements, and how many of them meet.

use super::theory::{Prediction, predict};
use super::{Experiment, Origin, Variable};
use crate::penetration::Unsolved;
use crate::units::three_digits;

/// A band of at most this width, high over low, says something.
pub const TELLING_WIDTH: f64 = 10.0;

/// One experiment beside what the theory says of it.
#[derive(Debug, Clone)]
pub struct Row<'a> {
    /// The experiment.
    pub experiment: &'a Experiment,
    /// Its band, or why there is none.
    pub prediction: Result<Prediction, Unsolved>,
}

/// All experiments evaluated, in their order.
pub fn rows(experiments: &[Experiment]) -> Vec<Row<'_>> {
    experiments.iter().map(|experiment| Row { experiment, prediction: predict(experiment) }).collect()
}

impl Row<'_> {
    /// Whether the measurement with its scatter meets the band; `None`: there is no band.
    pub fn is_inside(&self) -> Option<bool> {
        self.prediction.ok().map(|band| band.meets(self.experiment.measured.values))
    }

    /// Best prediction over the measured value.
    pub fn ratio(&self) -> Option<f64> {
        self.prediction.ok().map(|band| band.best / self.experiment.measured.values[1])
    }

    /// Whether the row counts, with a band.
    pub fn counts(&self) -> bool {
        self.experiment.counts() && self.prediction.is_ok()
    }

    /// Whether the band is narrow enough to say something.
    pub fn tells(&self) -> bool {
        self.prediction.is_ok_and(|band| band.width() <= TELLING_WIDTH)
    }

    /// `inside`, or on which side of the band the measurement lies and how far.
    pub fn verdict(&self) -> String {
        let Ok(band) = self.prediction else { return "no prediction".into() };
        let measured = self.experiment.measured.values;
        let miss = three_digits(band.miss(measured));
        match band.meets(measured) {
            true => "inside".into(),
            false if measured[2] < band.low => format!("below the band by a factor of {miss}"),
            false => format!("above the band by a factor of {miss}"),
        }
    }

    /// Low, best and high prediction with the unit, or the reason why there is none.
    pub fn band_in_words(&self) -> String {
        match self.prediction {
            Ok(band) => triple([band.low, band.best, band.high]),
            Err(reason) => reason.to_string(),
        }
    }
}

/// `low - best - high`, or the one number that all of them are.
pub fn triple(values: [f64; 3]) -> String {
    let [low, best, high] = values.map(three_digits);
    if values[0] == values[2] { best } else { format!("{low} - {best} - {high}") }
}

/// An input as people read it: value, unit and origin.
pub fn input_in_words(experiment: &Experiment, variable: Variable) -> Option<String> {
    let input = experiment.input(variable)?;
    let (unit, size) = variable.unit();
    let values = triple(input.values.map(|value| value / size));
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    Some(format!("{} {values}{unit}, {}", variable.name(), input.origin.word()))
}

/// How many rows there are, and how many of them meet.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Tally {
    /// Rows.
    pub of: usize,
    /// Those whose measurement meets the band.
    pub inside: usize,
}

/// The result of a set of rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Totals {
    /// Rows that count.
    pub counted: Tally,
    /// Of these, rows without an assumed input.
    pub sourced: Tally,
    /// Of the rows that count, those whose band says something.
    pub telling: Tally,
    /// Rows that do not count.
    pub left_out: usize,
}

impl Totals {
    /// Counts.
    pub fn of(rows: &[Row]) -> Self {
        let tally = |wanted: &dyn Fn(&Row) -> bool| {
            let chosen = || rows.iter().filter(|row| row.counts() && wanted(row));
            Tally { of: chosen().count(), inside: chosen().filter(|row| row.is_inside() == Some(true)).count() }
        };
        let counted = tally(&|_| true);
        Totals {
            counted,
            sourced: tally(&|row| row.experiment.is_sourced()),
            telling: tally(&|row| row.tells()),
            left_out: rows.len() - counted.of,
        }
    }

    /// The result in one sentence per tally.
    pub fn sentences(&self) -> Vec<String> {
        let meet = |tally: Tally| format!("{} of {}", tally.inside, tally.of);
        let mut all = vec![
            format!("{} measurements meet the band that the ranges of the inputs give.", meet(self.counted)),
            format!("{} where the band is no wider than a factor of {TELLING_WIDTH}.", meet(self.telling)),
            format!("{} where no input is {}.", meet(self.sourced), Origin::Assumed.word()),
        ];
        if self.left_out > 0 {
            all.push(format!("{} rows do not count: a number is unverified, or there is no band.", self.left_out));
        }
        all
    }
}
