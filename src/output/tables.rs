//! `force.csv` and `energy.csv`: one row per display frame, `sample.csv`: one per frame and driven face, `targets.csv`: one
//! per frame and target; units in the column names. What stands in them is listed in [`crate::observables::quantity`], [`super::sample`]
//! and [`super::target`].
//!
//! All are written to after every frame: whatever stops the program, the rows of all finished frames are on the disk. A frame
//! that does not fit on the disk is taken back from all of them, so that they end with the same whole row.

use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use super::folder::{CORE_TABLE, ENERGY_TABLE, FORCE_TABLE, OutputFolder, SAMPLE_TABLE, TARGET_TABLE};
use super::sample::{DrivenFace, SAMPLE, SampleRow};
use super::target::{TARGETS, TargetRow};
use crate::effects::own::Chosen;
use crate::observables::FrameRecord;
use crate::observables::quantity::{CORE, ENERGY, FORCE, FORCE_ERROR, Quantity, columns, own_columns, row};
use crate::scene::Scene;
use crate::whole_file;
use crate::{Error, Result};

/// The open tables of a run.
#[derive(Debug)]
pub struct Tables {
    force: Table,
    /// With the band around the force.
    band: bool,
    energy: Table,
    /// Further columns of it.
    own: Vec<Quantity<FrameRecord>>,
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
    pub fn create(folder: &OutputFolder, driven: &[DrivenFace], hollow: bool, scene: &Scene) -> Result<Self> {
        Self::with_records(folder, driven, hollow, scene, &[])
    }

    /// The same with the rows of these records. A file of an earlier run is replaced in one step.
    pub fn with_records(
        folder: &OutputFolder,
        driven: &[DrivenFace],
        hollow: bool,
        scene: &Scene,
        records: &[FrameRecord],
    ) -> Result<Self> {
        let band = records.iter().any(|record| record.force_error.is_some());
        Self::with_band(folder, driven, hollow, scene, records, band)
    }

    /// The same; `band`: with a column for the band around the force.
    pub fn with_band(
        folder: &OutputFolder,
        driven: &[DrivenFace],
        hollow: bool,
        scene: &Scene,
        records: &[FrameRecord],
        band: bool,
    ) -> Result<Self> {
        let sample = match driven {
            [] => None,
            driven => Some((driven.to_vec(), Table::new(folder.file(SAMPLE_TABLE), &columns(&SAMPLE))?)),
        };
        let core = hollow.then(|| Table::new(folder.file(CORE_TABLE), &columns(&CORE))).transpose()?;
        let own = own_columns(&scene.effects.own);
        let targets = match &scene.targets[..] {
            [] => None,
            targets => {
                let names = targets.iter().map(|target| target.name.clone()).collect();
                Some((names, Table::new(folder.file(TARGET_TABLE), &columns(&TARGETS))?))
            }
        };
        let mut tables = Self {
            core,
            sample,
            targets,
            force: Table::new(folder.file(FORCE_TABLE), &force_fields(columns(&FORCE), band))?,
            band,
            energy: Table::new(folder.file(ENERGY_TABLE), &[columns(&ENERGY), columns(&own)].concat())?,
            own,
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
        self.force.row(&force_fields(row(&FORCE, record), self.band))?;
        self.energy.row(&[row(&ENERGY, record), row(&self.own, record)].concat())?;
        if let Some(table) = self.core.as_mut().filter(|_| record.core.is_some()) {
            table.row(&row(&CORE, record))?;
        }
        if let Some((faces, table)) = &mut self.sample {
            for face in faces {
                table.row(&row(&SAMPLE, &SampleRow { face: face.face, point: face.point(record) }))?;
            }
        }
        if let Some((names, table)) = &mut self.targets {
            for (name, target) in names.iter().zip(&record.targets) {
                table.row(&row(&TARGETS, &TargetRow::new(name, record, target)))?;
            }
        }
        Ok(())
    }
}

/// Fields of [`FORCE`] that a run has.
fn force_fields<T>(all: Vec<T>, band: bool) -> Vec<T> {
    let named = all.into_iter().zip(FORCE.iter());
    named.filter(|(_, quantity)| band || quantity.column != FORCE_ERROR).map(|(field, _)| field).collect()
}

/// Writes the energies of some frames to a file of their own.
///
/// # Errors
/// `Error::File` where it cannot be written.
pub fn write_energy_table(path: &Path, own: &[Chosen], records: &[FrameRecord]) -> Result<()> {
    let own = own_columns(own);
    let mut table = Table::new(path.to_path_buf(), &[columns(&ENERGY), columns(&own)].concat())?;
    records.iter().try_for_each(|record| table.row(&[row(&ENERGY, record), row(&own, record)].concat()))?;
    table.make()
}
