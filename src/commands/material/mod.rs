//! `stylet material`: stresses of a homogeneous sample, for a preset, for constants, or for a material of a scene.

mod text;

use std::path::PathBuf;
use std::sync::LazyLock;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Arg, ArgMatches, Args, Command, FromArgMatches, ValueEnum, value_parser};
use glam::DVec3;
use serde::Serialize;

use crate::effects::viscoelastic::{LARGEST_TERM_COUNT, Term};
use crate::effects::{Effect, Kind, SELF_CONTAINED, damage, fibres, keys_of, plasticity, viscoelastic};
use crate::error::{Error, Result};
use crate::material::law::{Constant, constants, owners};
use crate::material::{Continuation, ElasticLaw, LAWS, LawWord, Mode, Verdict, describe_verdict};
use crate::material_point::Material;
use crate::material_test::{self, Leg, Protocol, Row};
use crate::output::material_chart::material_chart;
use crate::scene::document::closest;
use crate::scene::{Scene, presets};
use crate::units::four_digits;
use crate::whole_file;
use text::{Record, csv, effect_keys, head, preset_list, record, table};

const KPA: f64 = 1e3;
const MM: f64 = 1e-3;
/// Density of tissue; it plays no part in a test without inertia [kg/m^3].
const DENSITY: f64 = 1060.0;
/// Rows of one leg from which peaks are read and figures are drawn.
const FINE_POINTS: usize = 201;
/// Columns of a narrow terminal.
const COLUMNS: usize = 80;

/// Which sample, which test, which output. The loading axis is x.
#[derive(Args, Debug)]
pub struct MaterialArgs {
    /// Tissue preset, e.g. across-fibre; or give constants, or --scene
    preset: Option<String>,
    /// List the presets with their moduli at rest, toughness and aliases, and end
    #[arg(long, exclusive = true)]
    list: bool,
    /// Elastic law of the constants [default: mooney_rivlin]
    #[arg(long, value_parser = law_parser(), help_heading = CONSTANTS)]
    law: Option<LawWord>,
    #[command(flatten)]
    constants: LawConstants,
    /// Poisson's ratio at rest; fixes the bulk modulus
    #[arg(long, value_name = "NU", conflicts_with = "bulk_modulus_kpa", help_heading = CONSTANTS)]
    poisson_ratio: Option<f64>,
    /// Bulk modulus K = 2/D
    #[arg(long, value_name = "KPA", help_heading = CONSTANTS)]
    bulk_modulus_kpa: Option<f64>,
    /// Compute constants that are unstable at rest instead of refusing them
    #[arg(long, help_heading = CONSTANTS)]
    allow_unstable: bool,
    /// Take material and effects from a scene file
    #[arg(long, value_name = "FILE", conflicts_with = "preset")]
    scene: Option<PathBuf>,
    /// The material of this region of the scene
    #[arg(long, value_name = "NAME", requires = "scene")]
    region: Option<String>,

    /// Modes of loading
    #[arg(long, value_enum, value_delimiter = ',', default_value = "all", help_heading = "Test")]
    mode: Vec<ModeName>,
    /// Stretch to go to, below 1 a compression [default: 1.5]. In a test of shear alone the amount of shear
    /// [default: 0.5]; beside other modes the shear goes to this stretch minus 1
    #[arg(long, value_name = "STRETCH", allow_negative_numbers = true, help_heading = "Test")]
    to: Option<f64>,
    /// Stretch (or shear) to begin and end at [default: rest]
    #[arg(long, value_name = "STRETCH", allow_negative_numbers = true, help_heading = "Test")]
    from: Option<f64>,
    /// Rows of loading, of holding and of unloading
    #[arg(long, value_name = "N", default_value_t = 11, help_heading = "Test")]
    points: usize,
    /// Rate of the stretch [1/s]; matters with viscoelastic
    #[arg(long, value_name = "RATE", default_value_t = 0.01, help_heading = "Test")]
    rate: f64,
    /// Time held after loading [s]
    #[arg(long, value_name = "S", default_value_t = 0.0, help_heading = "Test")]
    hold: f64,
    /// Times that the test is repeated on the same sample
    #[arg(long, value_name = "N", default_value_t = 1, help_heading = "Test")]
    cycles: usize,
    /// End after loading and holding
    #[arg(long, help_heading = "Test")]
    no_unload: bool,

    /// Effects beside the elastic law, with the program's default parameters (with --scene: those of the scene)
    #[arg(long, value_parser = PossibleValuesParser::new(keys_of(Kind::Constitutive)), value_delimiter = ',', value_name = "LIST",
        help_heading = "Effects")]
    effects: Option<Vec<String>>,
    /// plasticity: yield stress
    #[arg(long, value_name = "KPA", help_heading = "Effects")]
    yield_kpa: Option<f64>,
    /// plasticity: hardening modulus
    #[arg(long, value_name = "KPA", help_heading = "Effects")]
    hardening_kpa: Option<f64>,
    /// fibres: stiffness
    #[arg(long, value_name = "KPA", help_heading = "Effects")]
    k1_kpa: Option<f64>,
    /// fibres: exponent
    #[arg(long, help_heading = "Effects")]
    k2: Option<f64>,
    /// fibres: x, y, z, or the angle from the loading axis x towards y [deg]
    #[arg(long, value_name = "AXIS", allow_negative_numbers = true, help_heading = "Effects")]
    fibre: Option<String>,
    /// viscoelastic: terms as share:seconds, e.g. 0.25:0.5,0.15:5
    #[arg(long, value_name = "G:TAU,..", help_heading = "Effects")]
    prony: Option<String>,
    /// damage: plastic strain at which it begins
    #[arg(long, value_name = "ALPHA", help_heading = "Effects")]
    damage_onset: Option<f64>,
    /// damage: plastic displacement at which nothing would be left
    #[arg(long, value_name = "MM", help_heading = "Effects")]
    failure_displacement_mm: Option<f64>,
    /// damage: edge of the cell
    #[arg(long, value_name = "MM", default_value_t = 1.0, help_heading = "Effects")]
    cell_mm: f64,

    /// Print JSON: an array of rows in SI units
    #[arg(long, conflicts_with = "csv", help_heading = "Output")]
    json: bool,
    /// Print CSV in SI units
    #[arg(long, help_heading = "Output")]
    csv: bool,
    /// Draw all modes into this file
    #[arg(long, value_name = "FILE", help_heading = "Output")]
    svg: Option<PathBuf>,
}

/// Heading of the constants in the help.
const CONSTANTS: &str = "Constants";

/// The words of the table of laws.
fn law_parser() -> impl TypedValueParser<Value = LawWord> {
    let word = |key: String| LawWord::ALL.into_iter().find(|word| word.law().key == key);
    PossibleValuesParser::new(LAWS.iter().map(|law| law.key)).try_map(move |key| word(key).ok_or("no law"))
}

/// A constant of the table of laws as an option: id and name of its value.
struct ConstantOption {
    constant: &'static Constant,
    /// `c10-kpa`
    long: String,
    /// `KPA`, or its letter.
    value_name: String,
    /// The laws that have it, and what it is.
    help: String,
}

/// One option per constant of the laws.
static CONSTANT_OPTIONS: LazyLock<Vec<ConstantOption>> = LazyLock::new(|| {
    let option = |constant: &'static Constant| {
        let laws = owners(constant.key).map(|law| law.key).collect::<Vec<_>>().join(", ");
        let unit = if constant.key.ends_with("_kpa") { "kpa" } else { constant.key };
        ConstantOption {
            constant,
            long: constant.key.replace('_', "-"),
            value_name: unit.to_uppercase(),
            help: if constant.what.is_empty() { laws } else { format!("{laws}: {}", constant.what) },
        }
    };
    constants().into_iter().map(option).collect()
});

/// The constants that are given, with their keys.
#[derive(Debug, Default)]
struct LawConstants(Vec<(&'static str, f64)>);

impl Args for LawConstants {
    fn augment_args(command: Command) -> Command {
        command.args(CONSTANT_OPTIONS.iter().map(|option| {
            Arg::new(option.constant.key)
                .long(option.long.as_str())
                .value_name(option.value_name.as_str())
                .value_parser(value_parser!(f64))
                .allow_negative_numbers(true)
                .help(option.help.as_str())
                .help_heading(CONSTANTS)
        }))
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for LawConstants {
    fn from_arg_matches(matches: &ArgMatches) -> std::result::Result<Self, clap::Error> {
        let given = |option: &ConstantOption| {
            let key = option.constant.key;
            matches.get_one::<f64>(key).map(|value| (key, *value))
        };
        Ok(LawConstants(CONSTANT_OPTIONS.iter().filter_map(given).collect()))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> std::result::Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

/// The option of a constant.
fn option(key: &str) -> String {
    format!("--{}", key.replace('_', "-"))
}

#[derive(ValueEnum, Debug, Clone, Copy, PartialEq, Eq)]
enum ModeName {
    Uniaxial,
    Equibiaxial,
    Planar,
    Shear,
    All,
}

/// A material with its name, as the head of the table tells it.
struct Subject {
    name: String,
    material: Material,
}

/// Runs the test and renders it. What concerns the user beside the rows goes to standard error, so that JSON and CSV
/// stay clean.
pub fn material(args: &MaterialArgs) -> Result<String> {
    if args.list {
        return Ok(preset_list(presets::tissues()));
    }
    let subject = subject(args)?;
    let law = &subject.material.law;
    let verdict = law.verdict();
    if verdict == Verdict::Unstable && !args.allow_unstable {
        return Err(Error::input(
            format!("REFUSED material: {}", describe_verdict(law)),
            "constants with a positive shear and bulk modulus, a preset such as lv2022-refit, or --allow-unstable to \
             look at the curves of these",
        ));
    }
    let modes = modes(args);
    let points = args.points.clamp(2, 100_000);
    check_protocol(args)?;
    // The fine rows hold the wanted ones.
    let every = FINE_POINTS.div_ceil(points - 1).max(1);
    let mut curves = Vec::new();
    for mode in modes.iter().copied() {
        let (from, to) = range(args, mode, modes.len() == 1)?;
        let protocol = Protocol {
            from,
            to,
            points: (points - 1) * every + 1,
            rate: args.rate,
            hold: args.hold,
            cycles: args.cycles,
            unload: !args.no_unload,
            cell_length: args.cell_mm * MM,
        };
        curves.push((mode, material_test::run(&subject.material, mode, &protocol)?));
    }
    // The table marks these rows.
    let continued = curves.iter().flat_map(|(_, rows)| rows).filter_map(|row| row.continuation).next();
    if let (true, Some(continuation)) = (args.json || args.csv, continued) {
        eprintln!(
            "note: rows with an entry in `continuation`, e.g. {}: {}",
            continuation.key(),
            continuation.describe()
        );
    }
    // The table has the verdict in its head.
    if (args.json || args.csv) && verdict != Verdict::Stable {
        eprintln!("warning: {}", describe_verdict(law));
    }
    if let Some(path) = &args.svg {
        let text = material_chart(&format!("{}: {}", subject.name, effect_keys(&subject.material)), &curves)
            .map_err(|reason| Error::file(path, std::io::Error::other(format!("chart: {reason}"))))?;
        whole_file::write(path, text.as_bytes())?;
    }
    let rows: Vec<(Mode, Vec<Row>)> = curves.iter().map(|(mode, rows)| (*mode, thinned(rows, every))).collect();
    if args.json {
        let records: Vec<Record> = rows.iter().flat_map(|(mode, rows)| rows.iter().map(|r| record(*mode, r))).collect();
        return serde_json::to_string_pretty(&records).map_err(|e| Error::input(e.to_string(), "report this defect"));
    }
    if args.csv {
        return Ok(csv(&rows));
    }
    let mut text = head(args, &subject);
    for ((mode, rows), (_, fine)) in rows.iter().zip(&curves) {
        table(&mut text, &subject.material, *mode, rows, fine);
    }
    Ok(text)
}

/// Every `every`-th row of each leg, its end included.
fn thinned(rows: &[Row], every: usize) -> Vec<Row> {
    let mut last = None;
    let mut count = 0;
    let mut kept = Vec::new();
    for row in rows {
        if last != Some((row.cycle, row.leg)) {
            last = Some((row.cycle, row.leg));
            // Loading begins with a row, the other legs after one.
            count = if row.leg == Leg::Loading { 0 } else { 1 };
        }
        if count % every == 0 {
            kept.push(*row);
        }
        count += 1;
    }
    kept
}

fn modes(args: &MaterialArgs) -> Vec<Mode> {
    let wanted = |mode: Mode| {
        args.mode.iter().any(|name| match name {
            ModeName::All => true,
            ModeName::Uniaxial => mode == Mode::Uniaxial,
            ModeName::Equibiaxial => mode == Mode::Equibiaxial,
            ModeName::Planar => mode == Mode::Planar,
            ModeName::Shear => mode == Mode::Shear,
        })
    };
    Mode::ALL.into_iter().filter(|mode| wanted(*mode)).collect()
}

/// Begin and end of a leg.
fn range(args: &MaterialArgs, mode: Mode, alone: bool) -> Result<(f64, f64)> {
    let shift = if mode == Mode::Shear && !alone { 1.0 } else { 0.0 };
    let default = if mode == Mode::Shear { 0.5 } else { 1.5 };
    let from = args.from.map_or(mode.at_rest(), |v| v - shift);
    let to = args.to.map_or(default, |v| v - shift);
    let (quantity, low, high) = if mode == Mode::Shear { ("shear", -10.0, 10.0) } else { ("stretch", 0.05, 10.0) };
    for (option, value) in [("--from", from), ("--to", to)] {
        if !(low..=high).contains(&value) {
            return Err(Error::input(
                format!("{option}: a {quantity} of {value} is outside {low} to {high}"),
                format!("a {quantity} from {low} to {high}; a stretch of 1.5 is 50 % longer, 0.7 is 30 % shorter"),
            ));
        }
    }
    if from == to {
        return Err(Error::input(
            format!("{} test: --from and --to are both {from}", mode.key()),
            "two different values",
        ));
    }
    Ok((from, to))
}

fn check_protocol(args: &MaterialArgs) -> Result<()> {
    for (option, value, low, high) in [
        ("--rate", args.rate, 1e-9, 1e6),
        ("--hold", args.hold, 0.0, 1e9),
        ("--cycles", args.cycles as f64, 1.0, 100.0),
        ("--points", args.points as f64, 2.0, 10_000.0),
        ("--cell-mm", args.cell_mm, 1e-6, 1e3),
    ] {
        number(option, value, low, high)?;
    }
    Ok(())
}

/// The value where it lies in the range.
fn number(option: &str, value: f64, low: f64, high: f64) -> Result<f64> {
    if (low..=high).contains(&value) {
        Ok(value)
    } else {
        Err(Error::input(format!("{option} is {value}"), format!("a number from {low} to {high}")))
    }
}

fn subject(args: &MaterialArgs) -> Result<Subject> {
    if let (Some((key, _)), true) = (args.constants.0.first(), args.preset.is_some() || args.scene.is_some()) {
        let option = option(key);
        let other = if args.scene.is_some() { "a scene" } else { "a preset" };
        return Err(Error::input(
            format!("{option} beside {other}: one of them decides the law"),
            format!("remove {option} or {other}"),
        ));
    }
    let mut subject = match (&args.preset, &args.scene) {
        (Some(name), _) => from_preset(name)?,
        (None, Some(path)) => from_scene(args, path)?,
        (None, None) => {
            let law = from_constants(args)?;
            Subject { name: format!("{} (constants)", law.isochoric.key()), material: elastic(law) }
        }
    };
    let law = &mut subject.material.law;
    if (args.preset.is_some() || args.scene.is_some())
        && let Some(bulk) = bulk_modulus(args, law.shear_modulus())?
    {
        law.bulk_modulus = bulk;
    }
    effects(args, &mut subject.material)?;
    Ok(subject)
}

fn elastic(law: ElasticLaw) -> Material {
    Material::elastic(law, DENSITY)
}

fn from_preset(name: &str) -> Result<Subject> {
    let Some(preset) = presets::tissue(name) else {
        let names: Vec<&str> = presets::tissues().iter().map(|p| p.name.as_str()).collect();
        let near = presets::near_name(presets::tissues(), name).map(|n| format!("did you mean `{n}`? "));
        let near = near.unwrap_or_default();
        return Err(Error::input(
            format!("there is no tissue preset `{name}`"),
            format!("{near}Presets: {}", names.join(", ")),
        ));
    };
    Ok(Subject { name: preset.name.clone(), material: preset.material() })
}

fn from_scene(args: &MaterialArgs, path: &std::path::Path) -> Result<Subject> {
    let scene = Scene::load(path, &[])?;
    let (name, tissue) = match &args.region {
        None => (scene.material.name.clone(), &scene.material),
        Some(wanted) => match scene.regions.iter().find(|r| r.name == *wanted) {
            Some(region) => (format!("{} ({wanted})", region.material.name), &region.material),
            None => {
                let names: Vec<&str> = scene.regions.iter().map(|r| r.name.as_str()).collect();
                let near = closest(wanted, names.iter().copied()).map(|n| format!("did you mean `{n}`? "));
                let list = if names.is_empty() { "none".into() } else { names.join(", ") };
                return Err(Error::input(
                    format!("the scene {} has no region `{wanted}`", path.display()),
                    format!("{}Its regions: {list}", near.unwrap_or_default()),
                ));
            }
        },
    };
    let material = Material::of(tissue, &scene.effects);
    Ok(Subject { name, material })
}

fn from_constants(args: &MaterialArgs) -> Result<ElasticLaw> {
    let given = &args.constants.0;
    if given.is_empty() {
        let names: Vec<&str> = presets::tissues().iter().map(|p| p.name.as_str()).collect();
        return Err(Error::input(
            "no material is named",
            format!(
                "a preset ({}), --scene FILE, or constants, e.g. --c10-kpa 2.3 --c01-kpa 1 --bulk-modulus-kpa 500",
                names.join(", ")
            ),
        ));
    }
    let law = args.law.unwrap_or(LawWord::MooneyRivlin).law();
    let list = law.keys().into_iter().map(option).collect::<Vec<_>>().join(", ");
    for (key, value) in given {
        let option = option(key);
        if !law.keys().contains(key) {
            return Err(Error::input(
                format!("{option} is no constant of the law {}", law.key),
                format!("its constants: {list}; or choose another --law"),
            ));
        }
        number(&option, *value, -1e6, 1e6)?;
    }
    let value = |key: &str| given.iter().find(|(k, _)| *k == key).map(|(_, v)| *v);
    if let Some(missing) = law.constants.iter().find(|c| !c.or_zero && value(c.key).is_none()) {
        return Err(Error::input(
            format!("the law {} needs {}", law.key, option(missing.key)),
            format!("its constants: {list}"),
        ));
    }
    let isochoric = law.with(|key| value(key).unwrap_or_default());
    match bulk_modulus(args, isochoric.shear_modulus())? {
        Some(bulk_modulus) => Ok(ElasticLaw { isochoric, bulk_modulus }),
        None => Err(Error::input(
            "the law needs its volumetric part",
            "add --poisson-ratio, e.g. 0.45, or --bulk-modulus-kpa, e.g. 500",
        )),
    }
}

/// Bulk modulus of the command line [Pa].
fn bulk_modulus(args: &MaterialArgs, shear: f64) -> Result<Option<f64>> {
    if let Some(nu) = args.poisson_ratio {
        if !(0.0..0.5).contains(&nu) {
            return Err(Error::input(
                format!("--poisson-ratio is {nu}"),
                "a number from 0 to below 0.5, e.g. 0.45; 0.5 would be incompressible",
            ));
        }
        return Ok(Some(presets::bulk_modulus_from_poisson(shear, nu)));
    }
    let bulk = args.bulk_modulus_kpa.map(|k| number("--bulk-modulus-kpa", k, 1e-6, 1e9)).transpose()?;
    Ok(bulk.map(|k| k * KPA))
}

/// Switches the effects and overrides their parameters.
fn effects(args: &MaterialArgs, material: &mut Material) -> Result<()> {
    if let Some(list) = &args.effects {
        if let Some((_, twice)) = list.iter().enumerate().find(|(index, name)| list[..*index].contains(name)) {
            return Err(Error::input(format!("--effects: `{twice}` is listed twice"), "name every effect once"));
        }
        // Parameters of a scene stay; what it does not have comes with its default.
        let on = |effect: &Effect| list.iter().any(|key| key == effect.key);
        material.plasticity = on(&plasticity::EFFECT).then(|| material.plasticity.unwrap_or_default());
        material.fibres = on(&fibres::EFFECT).then(|| material.fibres.unwrap_or_default());
        material.viscoelastic = on(&viscoelastic::EFFECT).then(|| material.viscoelastic.clone().unwrap_or_default());
        material.damage = on(&damage::EFFECT).then(|| material.damage.unwrap_or_default());
        material.own.retain(|chosen| on(&chosen.effect.effect));
        for effect in SELF_CONTAINED.iter().filter(|effect| on(&effect.effect)) {
            if material.own.iter().all(|chosen| chosen.effect != *effect) {
                material.own.push(effect.chosen());
            }
        }
    }
    let without = |option: &str, effect: &str| {
        Error::input(
            format!("{option} has no meaning without the effect `{effect}`"),
            format!("add it to the list, e.g. --effects {effect}, or remove {option}"),
        )
    };
    for (option, value, range) in
        [("--yield-kpa", args.yield_kpa, (1e-6, 1e6)), ("--hardening-kpa", args.hardening_kpa, (0.0, 1e6))]
    {
        let Some(value) = value else { continue };
        let params = material.plasticity.as_mut().ok_or_else(|| without(option, "plasticity"))?;
        let pa = number(option, value, range.0, range.1)? * KPA;
        *if option == "--yield-kpa" { &mut params.yield_stress } else { &mut params.hardening } = pa;
    }
    for (option, value, range, unit) in
        [("--k1-kpa", args.k1_kpa, (0.0, 1e6), KPA), ("--k2", args.k2, (1e-9, 1e3), 1.0)]
    {
        let Some(value) = value else { continue };
        let params = material.fibres.as_mut().ok_or_else(|| without(option, "fibres"))?;
        let value = number(option, value, range.0, range.1)? * unit;
        *if option == "--k2" { &mut params.k2 } else { &mut params.k1 } = value;
    }
    if let Some(text) = &args.fibre {
        let params = material.fibres.as_mut().ok_or_else(|| without("--fibre", "fibres"))?;
        params.direction = fibre_direction(text)?;
    }
    if let Some(text) = &args.prony {
        let params = material.viscoelastic.as_mut().ok_or_else(|| without("--prony", "viscoelastic"))?;
        params.terms = prony_terms(text)?;
    }
    if let Some(onset) = args.damage_onset {
        let params = material.damage.as_mut().ok_or_else(|| without("--damage-onset", "damage"))?;
        params.onset = number("--damage-onset", onset, 0.0, 100.0)?;
    }
    if let Some(length) = args.failure_displacement_mm {
        let params = material.damage.as_mut().ok_or_else(|| without("--failure-displacement-mm", "damage"))?;
        params.failure_displacement = number("--failure-displacement-mm", length, 1e-9, 1e6)? * MM;
    }
    if material.damage.is_some() && material.plasticity.is_none() {
        return Err(Error::input(
            "the effect `damage` needs `plasticity`: plastic displacement drives it",
            "--effects plasticity,damage",
        ));
    }
    Ok(())
}

fn fibre_direction(text: &str) -> Result<DVec3> {
    match text {
        "x" => Ok(DVec3::X),
        "y" => Ok(DVec3::Y),
        "z" => Ok(DVec3::Z),
        _ => match text.parse::<f64>() {
            Ok(angle) if angle.is_finite() => {
                let (sine, cosine) = angle.to_radians().sin_cos();
                Ok(DVec3::new(cosine, sine, 0.0))
            }
            _ => Err(Error::input(
                format!("--fibre: `{text}` is neither an axis nor an angle"),
                "x, y, z, or degrees from the loading axis x towards y, e.g. --fibre 30",
            )),
        },
    }
}

fn prony_terms(text: &str) -> Result<Vec<Term>> {
    let way_out = "terms as share:seconds with a comma between them, e.g. --prony 0.25:0.5,0.15:5";
    let term = |term: &str| {
        let (ratio, time) = term.split_once(':')?;
        let (ratio, time) = (ratio.trim().parse::<f64>().ok()?, time.trim().parse::<f64>().ok()?);
        ((0.0..1.0).contains(&ratio) && time > 0.0 && time.is_finite()).then_some(Term { ratio, time })
    };
    let mut terms = Vec::new();
    for part in text.split(',') {
        match term(part) {
            Some(term) => terms.push(term),
            None => {
                let message = format!("--prony: `{part}` is no share from 0 to below 1 with a positive time");
                return Err(Error::input(message, way_out));
            }
        }
    }
    let total: f64 = terms.iter().map(|t| t.ratio).sum();
    if total >= 1.0 || terms.len() > LARGEST_TERM_COUNT {
        let message = format!(
            "--prony: {} terms with the total share {total}; at most {LARGEST_TERM_COUNT} terms and a total below 1",
            terms.len()
        );
        return Err(Error::input(message, way_out));
    }
    Ok(terms)
}
