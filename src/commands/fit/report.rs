//! What a fit tells: text, JSON, preset, table.

use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value, json};

use super::*;

impl FitReport {
    /// The law of a fit with the bulk modulus of the options.
    fn elastic(&self, isochoric: Isochoric) -> ElasticLaw {
        let bulk_modulus = match self.volumetric {
            // A negative shear modulus would make a negative bulk modulus, and the verdict would name the wrong one.
            Volumetric::PoissonRatio(nu) => bulk_modulus_from_poisson(isochoric.shear_modulus().abs(), nu),
            Volumetric::BulkModulus(k) => k,
        };
        ElasticLaw { isochoric, bulk_modulus }
    }

    /// Modes that occur, in the order of [`Mode::ALL`].
    fn modes(&self) -> Vec<Mode> {
        Mode::ALL.into_iter().filter(|mode| self.curves.points.iter().any(|p| p.mode == *mode)).collect()
    }

    /// Smallest and largest principal stretch of the points.
    fn principal_range(&self) -> (f64, f64) {
        let stretches = self.curves.points.iter().flat_map(|p| p.mode.principal_stretches(p.x));
        stretches.fold((1.0, 1.0), |(low, high), l| (low.min(l), high.max(l)))
    }

    /// Both variants of every law, with their names in tables.
    fn variants(&self) -> impl Iterator<Item = (&'static str, &'static str, Option<Fit>)> {
        self.fits.iter().flat_map(|f| [(f.key, "best", f.unconstrained), (f.key, "stable", f.stable)])
    }

    /// What a person reads.
    pub fn text(&self) -> String {
        let mut out = String::new();
        // Writing to a String cannot fail.
        let mut line = |text: String| {
            let _ = writeln!(out, "{}", text.trim_end());
        };
        line(format!("data       {}", self.files.join(", ")));
        for mode in self.modes() {
            let of_mode = || self.curves.points.iter().filter(|p| p.mode == mode);
            let (x, s) = (range(of_mode().map(|p| p.x)), range(of_mode().map(|p| p.stress * 1e-3)));
            line(format!(
                "           {}: {}, {} {} to {}, nominal stress {} to {} kPa",
                mode.key(),
                counted(of_mode().count(), "point"),
                if mode == Mode::Shear { "amount of shear" } else { "stretch" },
                digits(x.0, 4),
                digits(x.1, 4),
                digits(s.0, 4),
                digits(s.1, 4)
            ));
        }
        for note in &self.curves.notes {
            line(format!("note       {note}"));
        }
        line("fit        closed forms of incompressible samples, least squares of the nominal stress".into());
        line(
            "           best: whatever the constants; stable: best of those stable for every deformation (Yeoh: none negative)"
                .into(),
        );
        line(String::new());
        line(format!(
            "{:<14} {:<7} {:<50} {:>9} {:>7} {:>8}  verdict",
            "law", "fit", "constants", "rms kPa", "rms %", "R2"
        ));
        for (key, variant, fit) in self.variants() {
            let name = if variant == "best" { key } else { "" };
            match fit {
                None => line(format!("{name:<14} {variant:<7} none: the points determine no such constants")),
                Some(fit) => line(format!(
                    "{name:<14} {variant:<7} {:<50} {:>9} {:>7} {:>8.5}  {}",
                    constants(&fit.law),
                    digits(fit.rms * 1e-3, 3),
                    digits(fit.relative * 1e2, 3),
                    fit.r2,
                    short_verdict(&fit)
                )),
            }
        }
        line(String::new());
        let (low, high) = self.principal_range();
        line(format!("verdicts   the points reach principal stretches {} to {}", digits(low, 4), digits(high, 4)));
        for fit in &self.fits {
            if let Some(best) = fit.unconstrained.filter(|f| f.verdict != Verdict::Stable) {
                line(format!("  {}, best: {}", fit.key, describe_verdict(&self.elastic(best.law))));
            }
            if let Some(stable) = fit.stable {
                line(format!("  {}, stable: {}", fit.key, describe_verdict(&self.elastic(stable.law))));
            }
        }
        line(String::new());
        match best_stable(&self.fits).and_then(|f| f.stable) {
            Some(fit) => line(format!(
                "best stable law: {} ({}), rms {} kPa, {} % of the largest stress",
                fit.law.key(),
                constants(&fit.law),
                digits(fit.rms * 1e-3, 3),
                digits(fit.relative * 1e2, 3)
            )),
            None => {
                line("best stable law: none; the stress falls with the deformation, check signs and columns".into())
            }
        }
        if let Some(preset) = &self.preset {
            line(String::new());
            line(preset.clone());
        }
        for path in &self.written {
            line(format!("wrote {}", path.display()));
        }
        out.trim_end().into()
    }

    /// The same for programs.
    pub fn json(&self) -> String {
        let fit = |fit: Option<Fit>| match fit {
            None => Value::Null,
            Some(fit) => {
                let limit = match fit.verdict {
                    Verdict::StableBelow(limit) => json!({ "stretch_below": limit }),
                    Verdict::StableAbove(limit) => json!({ "stretch_above": limit }),
                    Verdict::Stable | Verdict::Unstable => Value::Null,
                };
                json!({
                    "constants": fit.law.constants().into_iter().collect::<std::collections::BTreeMap<_, _>>(),
                    "rms_kpa": fit.rms * 1e-3,
                    "rms_percent": fit.relative * 1e2,
                    "r2": finite(fit.r2),
                    "stable": fit.verdict == Verdict::Stable,
                    "stable_limit": limit,
                    "stable_within_data": fit.stable_within_data,
                    "verdict": describe_verdict(&self.elastic(fit.law)),
                })
            }
        };
        let laws: Vec<Value> = self
            .fits
            .iter()
            .map(|f| json!({ "law": f.key, "best": fit(f.unconstrained), "stable": fit(f.stable) }))
            .collect();
        let report = json!({
            "files": self.files,
            "points": self.curves.points.len(),
            "modes": self.modes().into_iter().map(Mode::key).collect::<Vec<_>>(),
            "principal_stretches": [self.principal_range().0, self.principal_range().1],
            "notes": self.curves.notes,
            "laws": laws,
            "best_stable": best_stable(&self.fits).map(|f| f.key),
            "preset": self.preset,
            "written": self.written.iter().map(|p| p.display().to_string()).collect::<Vec<_>>(),
        });
        format!("{report:#}")
    }

    /// A `[[material]]` block of a library of presets.
    pub(super) fn preset_text(&self, name: &str, options: &FitOptions) -> Result<String> {
        let chosen = match &options.law {
            None => best_stable(&self.fits).and_then(|f| f.stable),
            Some(law) => self.fits.iter().find(|f| f.key == law).and_then(|f| f.stable),
        };
        let Some(fit) = chosen else {
            return Err(Error::input(
                format!("{} has no stable constants for these points", options.law.as_deref().unwrap_or("no law")),
                "look at the table without --preset; check signs and columns, or choose another --law",
            ));
        };
        let law = self.elastic(fit.law);
        let text = |value: String| toml::Value::String(value).to_string();
        let modes = self.modes().into_iter().map(Mode::key).collect::<Vec<_>>().join(", ");
        let (low, high) = self.principal_range();
        let mut out = String::from("[[material]]\n");
        let mut line = |key: &str, value: String| {
            let _ = writeln!(out, "{key} = {value}");
        };
        line("name", text(name.into()));
        line("summary", text(format!("{} law fitted to {}", fit.law.key(), self.files.join(", "))));
        line(
            "source",
            text(format!(
                "stylet fit, {} in {modes}; rms error {} kPa, {} % of the largest stress, R2 {:.5}",
                counted(self.curves.points.len(), "point"),
                digits(fit.rms * 1e-3, 3),
                digits(fit.relative * 1e2, 3),
                fit.r2
            )),
        );
        line(
            "range",
            text(format!(
                "fitted at principal stretches {} to {}; stable for every deformation; mu0 {} kPa, E0 {} kPa, nu0 {}",
                digits(low, 3),
                digits(high, 3),
                digits(law.shear_modulus() * 1e-3, 4),
                digits(law.youngs_modulus() * 1e-3, 4),
                digits(law.poisson_ratio(), 4)
            )),
        );
        line("law", text(fit.law.key().into()));
        for (key, value) in fit.law.constants() {
            line(key, number(value));
        }
        match self.volumetric {
            Volumetric::PoissonRatio(nu) => line("poisson_ratio", number(nu)),
            Volumetric::BulkModulus(k) => line("bulk_modulus_kpa", number(k * 1e-3)),
        }
        line("density_kg_m3", number(options.density));
        Ok(out)
    }

    pub(super) fn write(&mut self, folder: &Path, options: &FitOptions) -> Result<()> {
        let contents = [self.chart(folder)?, self.table()].into_iter().chain(self.preset.clone());
        let files: Vec<(PathBuf, String)> =
            file_names(options).iter().map(|name| folder.join(name)).zip(contents).collect();
        for (path, text) in files {
            whole_file::write(&path, text.as_bytes())?;
            self.written.push(path);
        }
        Ok(())
    }

    fn chart(&self, folder: &Path) -> Result<String> {
        let best = best_stable(&self.fits).map(|f| f.key);
        let title = format!("Elastic laws fitted to {}", self.files.join(", "));
        fit_chart(&title, &self.curves.points, &self.fits, best)
            .map_err(|reason| Error::file(folder.join(CHART), std::io::Error::other(format!("chart: {reason}"))))
    }

    /// Points and fits as CSV.
    fn table(&self) -> String {
        let mut out = String::from("mode,stretch_or_shear,weight,nominal_stress_kpa");
        for (key, variant, _) in self.variants() {
            let _ = write!(out, ",{key}_{variant}_kpa");
        }
        for point in &self.curves.points {
            let _ = write!(out, "\n{},{},{},{}", point.mode.key(), point.x, point.weight, number(point.stress * 1e-3));
            for (_, _, fit) in self.variants() {
                // An empty cell where a law has no such fit.
                let value = fit.map(|f| number(nominal_stress(&f.law, point.mode, point.x) * 1e-3));
                let _ = write!(out, ",{}", value.unwrap_or_default());
            }
        }
        out + "\n"
    }
}

/// Constants with names and units.
fn constants(law: &Isochoric) -> String {
    let constant = |(key, value): (&str, f64)| match key.strip_suffix("_kpa") {
        Some(name) => format!("{name} {} kPa", digits(value, 4)),
        None => format!("{key} {}", digits(value, 4)),
    };
    law.constants().into_iter().map(constant).collect::<Vec<_>>().join(", ")
}

fn short_verdict(fit: &Fit) -> String {
    let within = if fit.stable_within_data { "data inside" } else { "data outside" };
    match fit.verdict {
        Verdict::Stable => "stable".into(),
        Verdict::StableBelow(limit) => format!("limited: stretches < {}, {within}", digits(limit, 4)),
        Verdict::StableAbove(limit) => format!("limited: stretches > {}, {within}", digits(limit, 4)),
        Verdict::Unstable => "REFUSED: unstable at rest".into(),
    }
}

fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

fn range(values: impl Iterator<Item = f64>) -> (f64, f64) {
    values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
}

/// A number for a file: six significant digits, always read back as a floating-point number.
fn number(value: f64) -> String {
    format!("{:?}", significant(value, 6))
}
