//! What a run reports, as tables: every entry is a column of a file, with its unit, its meaning, how the values of the frames become one
//! of the run, and where it is found. Files, their documentation and sums over a run follow from these entries.

use std::sync::LazyLock;

use super::{EnergyAccount, ForceParts, FrameRecord};
use crate::effects::own::Chosen;
use crate::units::{
    self, JOULE, KILOGRAM, METRE, METRE_PER_SECOND, NEWTON, NEWTON_METRE, ONE, SECOND, SQUARE_METRE, Unit,
};

/// A number, word or count that can be read off a `T`: one column of a table with a row per `T`.
pub struct Quantity<T: 'static> {
    /// Name of the column; its end is the unit.
    pub column: &'static str,
    pub unit: Unit,
    /// How the values of the frames become one of the run.
    pub fold: Fold,
    pub meaning: &'static str,
    pub of: Of<T>,
}

impl<T> std::fmt::Debug for Quantity<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.column)
    }
}

/// How the values of the frames become one of the run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Fold {
    /// The last one: a state, or a total since t = 0.
    Last,
    Sum,
    Largest,
    Smallest,
}

/// Where a value is found.
pub enum Of<T: 'static> {
    Number(fn(&T) -> f64),
    /// Not known in every row.
    Known(fn(&T) -> Option<f64>),
    Count(fn(&T) -> u32),
    Word(fn(&T) -> &str),
    /// A number that stands at a place of another table, or of a vector.
    At(fn(&T, usize) -> f64, usize),
}

impl<T> Of<T> {
    /// As it stands in a file; empty where it is not known.
    pub fn text(&self, row: &T) -> String {
        match self {
            Of::Number(of) => units::number(of(row)),
            Of::Known(of) => of(row).map_or(String::new(), units::number),
            Of::Count(of) => of(row).to_string(),
            Of::Word(of) => of(row).into(),
            Of::At(of, place) => units::number(of(row, *place)),
        }
    }

    /// `None` of a word, and where it is not known.
    pub fn number(&self, row: &T) -> Option<f64> {
        match self {
            Of::Number(of) => Some(of(row)),
            Of::Known(of) => of(row),
            Of::Count(of) => Some(f64::from(of(row))),
            Of::Word(_) => None,
            Of::At(of, place) => Some(of(row, *place)),
        }
    }
}

impl Fold {
    /// Of no values 0 for a sum, else `None`.
    pub fn over(self, values: impl Iterator<Item = f64>) -> Option<f64> {
        match self {
            Fold::Last => values.last(),
            Fold::Sum => Some(values.fold(0.0, |sum, value| sum + value)),
            Fold::Largest => values.reduce(f64::max),
            Fold::Smallest => values.reduce(f64::min),
        }
    }

    /// In the documentation.
    pub fn word(self) -> &'static str {
        match self {
            Fold::Last => "last",
            Fold::Sum => "sum",
            Fold::Largest => "largest",
            Fold::Smallest => "smallest",
        }
    }
}

impl<T> Quantity<T> {
    /// Its value for a whole run; `None` where no row has one.
    pub fn over(&self, rows: &[T]) -> Option<f64> {
        self.fold.over(rows.iter().filter_map(|row| self.of.number(row)))
    }
}

/// An entry that is a number in every row.
pub const fn number<T>(
    column: &'static str,
    unit: Unit,
    fold: Fold,
    meaning: &'static str,
    of: fn(&T) -> f64,
) -> Quantity<T> {
    Quantity { column, unit, fold, meaning, of: Of::Number(of) }
}

/// One that is not known in every row.
pub const fn known<T>(
    column: &'static str,
    unit: Unit,
    fold: Fold,
    meaning: &'static str,
    of: fn(&T) -> Option<f64>,
) -> Quantity<T> {
    Quantity { column, unit, fold, meaning, of: Of::Known(of) }
}

/// One that counts.
pub const fn count<T>(column: &'static str, fold: Fold, meaning: &'static str, of: fn(&T) -> u32) -> Quantity<T> {
    Quantity { column, unit: ONE, fold, meaning, of: Of::Count(of) }
}

/// One that is a word.
pub const fn word<T>(column: &'static str, meaning: &'static str, of: fn(&T) -> &str) -> Quantity<T> {
    Quantity { column, unit: ONE, fold: Fold::Last, meaning, of: Of::Word(of) }
}

/// One of several that stand in a row.
pub const fn at<T>(
    column: &'static str,
    unit: Unit,
    fold: Fold,
    meaning: &'static str,
    of: fn(&T, usize) -> f64,
    place: usize,
) -> Quantity<T> {
    Quantity { column, unit, fold, meaning, of: Of::At(of, place) }
}

/// The heads of a table.
pub fn columns<T>(table: &[Quantity<T>]) -> Vec<&'static str> {
    table.iter().map(|quantity| quantity.column).collect()
}

/// One row of a table.
pub fn row<T>(table: &[Quantity<T>], of: &T) -> Vec<String> {
    table.iter().map(|quantity| quantity.of.text(of)).collect()
}

/// The entry of this column.
///
/// # Panics
/// Where the table has none.
pub fn find<'a, T>(table: &'a [Quantity<T>], column: &str) -> &'a Quantity<T> {
    let found = table.iter().find(|quantity| quantity.column == column);
    found.unwrap_or_else(|| panic!("no column {column} is reported"))
}

use Fold::{Largest, Last, Smallest, Sum};

/// When and where a frame ends, in every table with a row per frame.
fn place() -> [Quantity<FrameRecord>; 2] {
    [
        number("time_s", SECOND, Last, "end of the frame", |r| r.time),
        number(
            "depth_m",
            METRE,
            Last,
            "depth along the needle from where its axis meets z = 0, mean over the frame",
            |r| r.depth,
        ),
    ]
}

const TIP_COORDINATE: Quantity<FrameRecord> =
    number("tip_coordinate_m", METRE, Last, "how far the tip has cut, in the material", |r| r.tip_coordinate);

/// Column of the band around the force. Runs without a companion leave it out: whoever reads a table of numbers meets no empty field.
pub const FORCE_ERROR: &str = "force_error_n";

/// `force.csv`, a row per frame. The parts of the axial force are those of [`ForceParts::PARTS`].
pub static FORCE: LazyLock<Vec<Quantity<FrameRecord>>> = LazyLock::new(|| {
    let mut table = Vec::from(place());
    table.push(count("phase", Last, "number of the phase of the motion, from 0", |r| r.phase as u32));
    table.push(number("axial_force_n", NEWTON, Largest, "sum of the parts", |r| r.force.axial));
    let band = "half-width of the band around the axial force, with a companion run (`--error-bar`) only";
    table.push(known(FORCE_ERROR, NEWTON, Largest, band, |r| r.force_error));
    let part: fn(&FrameRecord, usize) -> f64 = |r, n| (ForceParts::PARTS[n].of)(&r.force);
    let parts = ForceParts::PARTS.iter().enumerate();
    table.extend(parts.map(|(n, p)| at(p.column, NEWTON, Largest, p.meaning, part, n)));
    let lateral = "lateral force on the tissue, the axial part removed";
    for (n, column) in ["lateral_x_n", "lateral_y_n", "lateral_z_n"].into_iter().enumerate() {
        table.push(at(column, NEWTON, Largest, lateral, |r, n| r.force.lateral[n], n));
    }
    let torque = "torque on the tissue about the tip";
    for (n, column) in ["torque_x_nm", "torque_y_nm", "torque_z_nm"].into_iter().enumerate() {
        table.push(at(column, NEWTON_METRE, Largest, torque, |r, n| r.force.torque[n], n));
    }
    table.push(TIP_COORDINATE);
    let squeezed = "normal force of the tissue on the shaft, summed along it, in the scheme `opening`: times the coefficient it is the friction";
    table.push(number("shaft_normal_n", NEWTON, Largest, squeezed, |r| r.force.shaft_normal));
    table
});

/// Columns of `energy.csv` for effects of the program's own: what each has supplied since t = 0.
pub fn own_columns(own: &[Chosen]) -> Vec<Quantity<FrameRecord>> {
    let of: fn(&FrameRecord, usize) -> f64 = |r, n| r.energy.own[n];
    let column =
        |(n, chosen): (usize, &Chosen)| at(chosen.effect.column, JOULE, Last, "supplied by this effect", of, n);
    own.iter().enumerate().map(column).collect()
}

/// `energy.csv`, a row per frame. Where the work goes is [`EnergyAccount::PARTS`].
pub static ENERGY: LazyLock<Vec<Quantity<FrameRecord>>> = LazyLock::new(|| {
    let mut table = Vec::from(place());
    let work = "work of tool, moved faces, tractions and gravity";
    table.push(number("external_work_j", JOULE, Last, work, |r| r.energy.external));
    let part: fn(&FrameRecord, usize) -> f64 = |r, n| (EnergyAccount::PARTS[n].of)(&r.energy);
    let parts = EnergyAccount::PARTS.iter().enumerate();
    table.extend(parts.map(|(n, p)| at(p.column, JOULE, Last, p.meaning, part, n)));
    table.extend(ratios());
    table.extend(health());
    table
});

fn ratios() -> [Quantity<FrameRecord>; 3] {
    let unexplained =
        "what none of these explains, over the largest external work so far; positive where energy is lost";
    let kinetic = "kinetic over elastic plus hourglass energy";
    let hourglass = "hourglass over elastic plus hourglass energy";
    [
        number("imbalance", ONE, Last, unexplained, |r| r.energy.imbalance()),
        number("kinetic_to_internal", ONE, Largest, kinetic, |r| r.energy.kinetic_to_internal()),
        number("hourglass_to_internal", ONE, Largest, hourglass, |r| r.energy.hourglass_to_internal()),
    ]
}

fn health() -> [Quantity<FrameRecord>; 11] {
    let clamped = "nodes at the speed limit, summed over the steps of the frame";
    let missed = "cell steps whose return mapping missed the yield condition";
    let torn = "area of the cohesive faces that have parted: damage times area";
    [
        number("min_j", ONE, Smallest, "smallest J at cell centres", |r| r.health.min_j),
        number("min_corner_j", ONE, Smallest, "smallest J at cell corners", |r| r.health.min_corner_j),
        count("clamped_nodes", Sum, clamped, |r| r.health.clamped_nodes),
        count("inverted_cells", Largest, "cells with J <= 0 at the centre or a corner", |r| r.health.inverted_cells),
        count("folded_cells", Largest, "of these the ones with J > 0 at the centre", |r| r.health.folded_cells),
        number("max_speed_m_per_s", METRE_PER_SECOND, Largest, "largest speed of a node", |r| r.health.max_speed),
        count("raised_mass", Sum, "steps times nodes with raised mass", |r| r.health.raised_mass),
        number("largest_damage", ONE, Largest, "largest damage d", |r| r.health.largest_damage),
        count("deleted_cells", Last, "cells deleted so far", |r| r.health.deleted_cells),
        count("return_failures", Sum, missed, |r| r.health.return_failures),
        number("torn_area_m2", SQUARE_METRE, Last, torn, |r| r.health.torn_area),
    ]
}

/// `core.csv`, a row per frame of a hollow needle.
pub static CORE: LazyLock<Vec<Quantity<FrameRecord>>> = LazyLock::new(|| {
    let mut table = Vec::from(place());
    table.push(TIP_COORDINATE);
    table.extend(core());
    table
});

fn core() -> [Quantity<FrameRecord>; 5] {
    [
        known("length_m", METRE, Last, "length of the core in the bore", |r| r.core.map(|core| core.length)),
        known("rest_length_m", METRE, Last, "its length at rest", |r| r.core.map(|core| core.rest_length)),
        known("strain", ONE, Last, "its axial strain", |r| r.core.map(|core| core.strain())),
        known("mass_kg", KILOGRAM, Last, "its mass", |r| r.core.map(|core| core.mass)),
        known("severed", ONE, Last, "1 once it has torn off", |r| r.core.map(|core| f64::from(u8::from(core.severed)))),
    ]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn columns_are_told_apart_and_end_with_their_unit() {
        for table in [&FORCE, &ENERGY, &CORE] {
            let columns: BTreeSet<&str> = columns(table).into_iter().collect();
            assert_eq!(columns.len(), table.len());
            for quantity in table.iter() {
                let end = match quantity.unit.name {
                    "" => continue,
                    "m^2" => "_m2".into(),
                    "m/s" => "_m_per_s".into(),
                    name => format!("_{}", name.to_lowercase().replace(' ', "")),
                };
                assert!(quantity.column.ends_with(&end), "{} in {}", quantity.column, quantity.unit.name);
                assert!(!quantity.meaning.is_empty());
            }
        }
    }

    #[test]
    fn frames_become_a_run() {
        let mut records = vec![FrameRecord::default(); 3];
        for (n, record) in records.iter_mut().enumerate() {
            record.energy.cutting = n as f64;
            record.health.clamped_nodes = 2;
            record.health.min_j = 1.0 - 0.1 * n as f64;
            record.health.inverted_cells = if n == 1 { 4 } else { 0 };
        }
        let run = |column: &str| find(&ENERGY, column).over(&records);
        assert_eq!(run("cutting_j"), Some(2.0));
        assert_eq!(run("clamped_nodes"), Some(6.0));
        assert_eq!(run("inverted_cells"), Some(4.0));
        assert_eq!(run("min_j"), Some(0.8));
        assert_eq!(find(&CORE, "mass_kg").over(&records), None);
        assert_eq!(find(&FORCE, "phase").of.text(&records[0]), "0");
        assert_eq!(find(&ENERGY, "min_j").of.text(&records[1]), "0.9");
    }

    #[test]
    #[should_panic(expected = "no column")]
    fn what_is_not_reported_is_not_found() {
        find(&ENERGY, "cutting");
    }
}
