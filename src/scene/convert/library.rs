//! A library of tissue materials: the built-in one and those of users, in one format.

use std::collections::HashMap;
use std::path::Path;

use super::super::document::Document;
use super::super::file::{CuttingTable, LibraryFile, LibraryMaterial, MaterialTable};
use super::super::presets::folded;
use super::super::tissue_preset::TissuePreset;
use super::Check;

/// Reads and checks a library; the error is the rendered text of all problems, with the name of the library.
pub fn read(path: &Path, source: &str) -> std::result::Result<Vec<TissuePreset>, String> {
    let document = Document::parse(path, source, &[])?;
    let mut check = Check::new(&document, path);
    check.finite_numbers(&document)?;
    let file: LibraryFile = document.deserialize()?;
    if file.material.is_empty() {
        check.problems.report("", "the library holds no material", "empty", "add [[material]] with name and source");
    }
    let mut presets: Vec<TissuePreset> = Vec::new();
    for (index, entry) in file.material.iter().enumerate() {
        let at = format!("material.{index}");
        if entry.name.trim().is_empty() || presets.iter().any(|preset| preset.name == entry.name) {
            check.problems.report(
                &format!("{at}.name"),
                format!("the name \"{}\" is empty or taken", entry.name),
                "no name of its own",
                "write a name that no other material of this library has",
            );
        }
        presets.extend(check.library_material(&at, entry));
    }
    check.aliases(&file.material);
    check.problems.check()?;
    Ok(presets)
}

impl Check<'_> {
    /// Every alias leads to one material: it is neither another's name nor another's alias.
    fn aliases(&mut self, materials: &[LibraryMaterial]) {
        let mut owners: HashMap<String, usize> = HashMap::new();
        for (index, entry) in materials.iter().enumerate() {
            owners.entry(folded(&entry.name)).or_insert(index);
        }
        for (index, entry) in materials.iter().enumerate() {
            for (number, alias) in entry.aliases.iter().enumerate() {
                let at = format!("material.{index}.aliases.{number}");
                let word = folded(alias);
                if word.trim().is_empty() {
                    self.problems.report(&at, "an alias is empty", "no name", "write a name, or remove it");
                    continue;
                }
                let owner = *owners.entry(word).or_insert(index);
                if owner != index {
                    let (this, other) = (&entry.name, &materials[owner].name);
                    self.problems.report(
                        &at,
                        format!("the alias \"{alias}\" of \"{this}\" leads to \"{other}\" as well"),
                        "two materials",
                        "write an alias that no other material of this library has as its name or alias",
                    );
                }
            }
        }
    }

    /// One entry; `None` after a reported problem. Stability is judged where the preset is used.
    fn library_material(&mut self, at: &str, entry: &LibraryMaterial) -> Option<TissuePreset> {
        let table = MaterialTable {
            law: entry.law,
            bulk_modulus_kpa: entry.bulk_modulus_kpa,
            d_per_mpa: entry.d_per_mpa,
            poisson_ratio: entry.poisson_ratio,
            youngs_modulus_kpa: entry.youngs_modulus_kpa,
            c10_share: entry.c10_share,
            toughness_j_m2: entry.toughness_j_m2,
            tear_stretch: entry.tear_stretch,
            ..MaterialTable::default()
        }
        .with_constants(&entry.constants());
        let density = self.density(at, entry.density_kg_m3);
        self.material_ranges(at, &table);
        let law = self.law(at, &table);
        self.own_tables(&format!("{at}."), entry.own_tables());
        let cutting = entry.cutting.unwrap_or_default();
        self.cutting_table(&format!("{at}.cutting"), &cutting);
        Some(TissuePreset {
            name: entry.name.clone(),
            aliases: entry.aliases.clone(),
            summary: entry.summary.clone().unwrap_or_default(),
            source: entry.source.clone(),
            range: entry.range.clone(),
            law: law?,
            density,
            plasticity: entry.plasticity.clone(),
            fibres: entry.fibres.clone(),
            viscoelastic: entry.viscoelastic.clone(),
            damage: entry.damage.clone(),
            cutting: (cutting != CuttingTable::default()).then_some(cutting),
            toughness: entry.toughness_j_m2,
            tear_stretch: entry.tear_stretch,
        })
    }
}
