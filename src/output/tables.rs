//! `force.csv` and `energy.csv`: one row per display frame, `sample.csv`: one per frame and driven face, `targets.csv`: one
//! per frame and target; units in the column names.
//!
//! All are written to after every frame: whatever stops the program, the rows of all finished frames are on the disk. A frame
//! that does not fit on the disk is taken back from all of them, so that they end with the same whole row.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::folder::{CORE_TABLE, ENERGY_TABLE, FORCE_TABLE, OutputFolder, SAMPLE_TABLE, TARGET_TABLE};
use super::number::number;
use super::sample::{DrivenFace, SAMPLE_COLUMNS, SamplePoint};
use super::target::{TARGET_COLUMNS, target_row};
use crate::observables::{EnergyAccount, ForceParts, FrameRecord};
use crate::scene::Target;
use crate::whole_file;
use crate::{Error, Result};

/// Columns of `force.csv`; the meaning is that of the fields of [`FrameRecord`].
pub fn force_columns() -> Vec<&'static str> {
    let mut columns = vec!["time_s", "depth_m", "phase", "axial_force_n"];
    columns.extend(ForceParts::PARTS.map(|part| part.column));
    columns.extend([
        "lateral_x_n",
        "lateral_y_n",
        "lateral_z_n",
        "torque_x_nm",
        "torque_y_nm",
        "torque_z_nm",
        "tip_coordinate_m",
    ]);
    columns
}

/// Columns of `energy.csv`.
pub fn energy_columns() -> Vec<&'static str> {
    let mut columns = vec!["time_s", "depth_m", "external_work_j"];
    columns.extend(EnergyAccount::PARTS.map(|part| part.column));
    columns.extend([
        "imbalance",
        "kinetic_to_internal",
        "hourglass_to_internal",
        "min_j",
        "min_corner_j",
        "clamped_nodes",
        "inverted_cells",
        "folded_cells",
        "max_speed_m_per_s",
        "raised_mass",
        "largest_damage",
        "deleted_cells",
        "return_failures",
        "torn_area_m2",
    ]);
    columns
}

/// Columns of `core.csv`.
pub const CORE_COLUMNS: [&str; 8] =
    ["time_s", "depth_m", "tip_coordinate_m", "length_m", "rest_length_m", "strain", "mass_kg", "severed"];

/// Kinetic over internal energy, internal = elastic + hourglass; 0 where nothing is stored.
pub fn kinetic_to_internal(energy: &EnergyAccount) -> f64 {
    ratio(energy.kinetic, energy.elastic + energy.hourglass)
}

/// Hourglass over internal energy, internal = elastic + hourglass; 0 where nothing is stored.
pub fn hourglass_to_internal(energy: &EnergyAccount) -> f64 {
    ratio(energy.hourglass, energy.elastic + energy.hourglass)
}

/// Energy below which a ratio would compare rounding with rounding [J].
const NOTHING: f64 = 1e-18;

fn ratio(part: f64, whole: f64) -> f64 {
    if whole <= NOTHING { 0.0 } else { part / whole }
}

/// The open tables of a run.
#[derive(Debug)]
pub struct Tables {
    force: Table,
    energy: Table,
    /// With a hollow needle.
    core: Option<Table>,
    /// Where faces are driven.
    sample: Option<(Vec<DrivenFace>, Table)>,
    /// Names of the targets, where there are any.
    targets: Option<(Vec<String>, Table)>,
}

#[derive(Debug)]
struct Table {
    path: PathBuf,
    /// Rows that are not in the file yet.
    rows: Vec<u8>,
    /// The file and its length [B]; `None` before it is made.
    file: Option<(File, u64)>,
}

impl Table {
    fn new<T: AsRef<[u8]>>(path: PathBuf, columns: &[T]) -> Result<Self> {
        let mut table = Self { path, rows: Vec::new(), file: None };
        table.row(columns)?;
        Ok(table)
    }

    /// Adds a row to those that the next call of `make` or `write` writes.
    fn row<T: AsRef<[u8]>>(&mut self, fields: &[T]) -> Result<()> {
        let mut writer = csv::Writer::from_writer(&mut self.rows);
        let written = writer.write_record(fields).map_err(std::io::Error::from).and_then(|()| writer.flush());
        written.map_err(|source| Error::file(&self.path, source))
    }

    /// Makes the file with the rows so far, whole or not at all; another one of this name stays until then.
    fn make(&mut self) -> Result<()> {
        whole_file::write(&self.path, &self.rows)?;
        let file = OpenOptions::new().append(true).open(&self.path);
        self.file = Some((file.map_err(|source| Error::file(&self.path, source))?, self.rows.len() as u64));
        self.rows.clear();
        Ok(())
    }

    /// Appends the rows to the file; its length grows with `keep` only.
    fn write(&mut self) -> Result<()> {
        let (file, _) = self.file.as_mut().expect("`make` comes first");
        file.write_all(&self.rows).map_err(|source| Error::file(&self.path, source))
    }

    fn keep(&mut self) {
        if let Some((_, length)) = &mut self.file {
            *length += self.rows.len() as u64;
        }
        self.rows.clear();
    }

    /// Takes back what `write` wrote, a part of a row among it.
    fn take_back(&mut self) {
        if let Some((file, length)) = &mut self.file {
            // The error that led here is the one to report; shortening needs no space.
            let _ = file.set_len(*length);
        }
        self.rows.clear();
    }
}

impl Tables {
    /// Creates the files with their header rows; that of the sample only where faces are driven, that of the core only with a
    /// hollow needle, that of the targets only where there are any.
    pub fn create(folder: &OutputFolder, driven: &[DrivenFace], hollow: bool, targets: &[Target]) -> Result<Self> {
        Self::with_records(folder, driven, hollow, targets, &[])
    }

    /// The same with the rows of these records. A file of an earlier run is replaced in one step.
    pub fn with_records(
        folder: &OutputFolder,
        driven: &[DrivenFace],
        hollow: bool,
        targets: &[Target],
        records: &[FrameRecord],
    ) -> Result<Self> {
        let sample = match driven {
            [] => None,
            driven => Some((driven.to_vec(), Table::new(folder.file(SAMPLE_TABLE), &SAMPLE_COLUMNS)?)),
        };
        let core = hollow.then(|| Table::new(folder.file(CORE_TABLE), &CORE_COLUMNS)).transpose()?;
        let targets = match targets {
            [] => None,
            targets => {
                let names = targets.iter().map(|target| target.name.clone()).collect();
                Some((names, Table::new(folder.file(TARGET_TABLE), &TARGET_COLUMNS)?))
            }
        };
        let mut tables = Self {
            core,
            sample,
            targets,
            force: Table::new(folder.file(FORCE_TABLE), &force_columns())?,
            energy: Table::new(folder.file(ENERGY_TABLE), &energy_columns())?,
        };
        records.iter().try_for_each(|record| tables.rows(record))?;
        tables.all().try_for_each(Table::make)?;
        Ok(tables)
    }

    fn all(&mut self) -> impl Iterator<Item = &mut Table> {
        let sample = self.sample.as_mut().map(|(_, table)| table);
        let targets = self.targets.as_mut().map(|(_, table)| table);
        [&mut self.force, &mut self.energy].into_iter().chain(self.core.as_mut()).chain(sample).chain(targets)
    }

    /// Appends one row to each file, to that of the sample one per driven face, to that of the targets one per target.
    ///
    /// # Errors
    /// `Error::File` where one cannot be written; then none holds anything of this record.
    pub fn append(&mut self, record: &FrameRecord) -> Result<()> {
        let written = self.rows(record).and_then(|()| self.all().try_for_each(Table::write));
        self.all().for_each(if written.is_ok() { Table::keep } else { Table::take_back });
        written
    }

    fn rows(&mut self, record: &FrameRecord) -> Result<()> {
        self.force.row(&force_row(record))?;
        self.energy.row(&energy_row(record))?;
        if let (Some(table), Some(core)) = (&mut self.core, &record.core) {
            table.row(&[
                number(record.time),
                number(record.depth),
                number(record.tip_coordinate),
                number(core.length),
                number(core.rest_length),
                number(core.strain()),
                number(core.mass),
                u8::from(core.severed).to_string(),
            ])?;
        }
        if let Some((faces, table)) = &mut self.sample {
            for face in faces {
                table.row(&sample_row(face, &face.point(record)))?;
            }
        }
        if let Some((names, table)) = &mut self.targets {
            for (name, target) in names.iter().zip(&record.targets) {
                table.row(&target_row(name, record, target))?;
            }
        }
        Ok(())
    }
}

fn force_row(record: &FrameRecord) -> Vec<String> {
    let f = &record.force;
    let mut row = vec![number(record.time), number(record.depth), record.phase.to_string(), number(f.axial)];
    row.extend(ForceParts::PARTS.iter().map(|part| number((part.of)(f))));
    row.extend([f.lateral, f.torque].iter().flat_map(|v| v.to_array()).map(number));
    row.push(number(record.tip_coordinate));
    row
}

/// Writes the energies of some frames to a file of their own.
///
/// # Errors
/// `Error::File` where it cannot be written.
pub fn write_energy_table(path: &Path, records: &[FrameRecord]) -> Result<()> {
    let mut table = Table::new(path.to_path_buf(), &energy_columns())?;
    records.iter().try_for_each(|record| table.row(&energy_row(record)))?;
    table.make()
}

fn energy_row(record: &FrameRecord) -> Vec<String> {
    let e = &record.energy;
    let h = &record.health;
    let mut row = vec![number(record.time), number(record.depth), number(e.external)];
    row.extend(EnergyAccount::PARTS.iter().map(|part| number((part.of)(e))));
    row.extend([
        number(e.imbalance()),
        number(kinetic_to_internal(e)),
        number(hourglass_to_internal(e)),
        number(h.min_j),
        number(h.min_corner_j),
        h.clamped_nodes.to_string(),
        h.inverted_cells.to_string(),
        h.folded_cells.to_string(),
        number(h.max_speed),
        h.raised_mass.to_string(),
        number(h.largest_damage),
        h.deleted_cells.to_string(),
        h.return_failures.to_string(),
        number(h.torn_area),
    ]);
    row
}

fn sample_row(face: &DrivenFace, p: &SamplePoint) -> [String; SAMPLE_COLUMNS.len()] {
    let known = |value: Option<f64>| value.map_or(String::new(), number);
    [
        number(p.time),
        face.face.key().into(),
        number(p.displacement.x),
        number(p.displacement.y),
        number(p.displacement.z),
        number(p.rotation),
        number(p.reaction.x),
        number(p.reaction.y),
        number(p.reaction.z),
        number(p.stretch),
        known(p.nominal_stress),
        known(p.shear_stress),
        number(p.moment),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_nine_significant_digits() {
        assert_eq!(number(0.0), "0");
        assert_eq!(number(-0.0), "0");
        assert_eq!(number(1.0 / 3.0), "0.333333333");
        assert_eq!(number(-12345.678912345), "-12345.6789");
        assert_eq!(number(1.234567894e-7), "1.23456789e-7");
        assert_eq!(number(2.5e12), "2.5e12");
        assert_eq!(number(f64::NAN), "NaN");
        assert_eq!(number(f64::INFINITY), "inf");
    }

    #[test]
    fn ratios_are_zero_without_internal_energy() {
        let energy = EnergyAccount { kinetic: 1.0, ..Default::default() };
        assert_eq!(kinetic_to_internal(&energy), 0.0);
        let energy = EnergyAccount { kinetic: 1.0, elastic: 3.0, hourglass: 1.0, ..Default::default() };
        assert_eq!(kinetic_to_internal(&energy), 0.25);
        assert_eq!(hourglass_to_internal(&energy), 0.25);
    }
}
