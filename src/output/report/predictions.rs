//! The page of the predictions: published needle experiments beside the theory of the wedged slit, with nothing calibrated.

use plotters::style::{BLACK, RGBColor};

use super::words::and;
use crate::output::chart::{Curve, FINER, GREEN, INWARD, ORANGE, OUTWARD, PINK};
use crate::output::log_plot::{LogPlot, Point, Shape};
use crate::output::page::{document, escape, figure, numbers, table, words};
use crate::output::plot::{legend_dot, legend_line, legend_row};
use crate::predictions::rows::{input_in_words, triple};
use crate::predictions::{Experiment, Quantity, Row, Totals, Variable, rows};
use crate::units::{digits, three_digits};
use crate::{Error, Result};

/// File of the page in its folder.
pub const PAGE: &str = "predictions.html";
/// File of the table in its folder.
pub const TABLE: &str = "predictions.csv";

const TITLE: &str = "Predictions beside measurements";

/// Columns of the table.
const COLUMNS: [&str; 19] = [
    "id",
    "authors",
    "year",
    "doi",
    "tissue",
    "needle",
    "quantity",
    "unit",
    "predicted_low",
    "predicted",
    "predicted_high",
    "measured_low",
    "measured",
    "measured_high",
    "ratio",
    "inside",
    "counts",
    "sourced",
    "not_covered",
];

/// The whole page; `command` makes it again.
///
/// # Errors
/// `Error::File` where the chart cannot be drawn.
pub fn page(experiments: &[Experiment], command: &str) -> Result<String> {
    let rows = rows(experiments);
    let sections = [
        ("result", "Result", result(&rows)?),
        ("table", "Predicted and measured", comparison(&rows)),
        ("rows", "Every row: inputs, what is not covered, what it says", details(&rows)),
        ("theory", "The theory in words", theory(&rows)),
        ("sources", "Sources", sources(experiments)),
    ];
    let mut body = format!("<header>\n<h1>{TITLE}</h1>\n{}</header>\n<nav>\n", lead());
    for (id, title, _) in &sections {
        body += &format!("<a href=\"#{id}\">{}</a>\n", escape(title));
    }
    body += "</nav>\n<main>\n";
    for (id, title, content) in &sections {
        body += &format!("<section id=\"{id}\">\n<h2>{}</h2>\n{content}</section>\n", escape(title));
    }
    body +=
        &format!("</main>\n<footer><p class=\"soft\">Made again by <code>{}</code>.</p></footer>\n", escape(command));
    Ok(document(TITLE, &body))
}

/// The rows as CSV, numbers with six significant digits in the unit of their row.
///
/// # Errors
/// `Error::Input` where the writer fails, which memory does not.
pub fn csv(experiments: &[Experiment]) -> Result<Vec<u8>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let broken = |reason: &dyn std::fmt::Display| Error::input(reason.to_string(), "report this as a defect");
    writer.write_record(COLUMNS).map_err(|e| broken(&e))?;
    let number = |value: Option<f64>| value.map_or(String::new(), |value| digits(value, 6));
    for row in rows(experiments) {
        let e = row.experiment;
        let band = row.prediction.ok();
        let [low, value, high] = e.measured.values.map(|v| digits(v, 6));
        let gaps: Vec<&str> = e.uncovered.iter().map(|gap| gap.words()).collect();
        let fields = [
            e.id.clone(),
            e.authors.clone(),
            e.year.to_string(),
            e.doi.clone(),
            e.tissue.clone(),
            e.needle.clone(),
            e.quantity.name().into(),
            e.quantity.unit().0.into(),
            number(band.map(|b| b.low)),
            number(band.map(|b| b.best)),
            number(band.map(|b| b.high)),
            low,
            value,
            high,
            number(row.ratio()),
            row.is_inside().map_or(String::new(), |inside| inside.to_string()),
            row.counts().to_string(),
            e.is_sourced().to_string(),
            gaps.join("; "),
        ];
        writer.write_record(&fields).map_err(|e| broken(&e))?;
    }
    writer.into_inner().map_err(|e| broken(&e))
}

fn lead() -> String {
    "<p>Published needle experiments beside what the theory of a slit that a needle cuts and wedges open says of them. Modulus, \
     toughness, friction and radius go in; no force is fitted, and no number of this page may be used to fit one. An input that the \
     experiment itself does not give is borrowed from another text on the same kind of tissue, or assumed in a wide range where no \
     text was at hand: the page says which.</p>\n"
        .into()
}

fn result(rows: &[Row]) -> Result<String> {
    let sentences: String = Totals::of(rows).sentences().iter().map(|s| format!("<li>{}</li>\n", escape(s))).collect();
    let mut text = format!("<ul>\n{sentences}</ul>\n");
    if rows.iter().any(|row| row.prediction.is_ok()) {
        text += &chart(rows)?;
    }
    Ok(text
        + "<p class=\"soft\">A band is the hull of the theory at all corners of the ranges of its inputs and at their best values. It is \
           wide where little is known, and a measurement that meets a wide band proves little.</p>\n")
}

/// Colour of a quantity; units share one.
fn colour(quantity: Quantity) -> RGBColor {
    match quantity.unit().0 {
        "N" => INWARD,
        "N/mm" => ORANGE,
        "kPa" => GREEN,
        "mm" => PINK,
        _ => OUTWARD,
    }
}

/// Predicted against measured, every row in its own unit.
fn chart(rows: &[Row]) -> Result<String> {
    let line = |colour, width: u32, dash, points| Curve { label: "", colour, width, dash, points };
    let (mut low, mut high) = (f64::INFINITY, 0.0_f64);
    let mut plot = LogPlot { x_label: "measured, in the unit of the row", y_label: "predicted", ..LogPlot::default() };
    let mut units: Vec<Quantity> = Vec::new();
    for (number, row) in rows.iter().enumerate() {
        let Ok(band) = row.prediction else { continue };
        let measured = row.experiment.measured.values;
        let colour = colour(row.experiment.quantity);
        let inside = band.meets(measured);
        plot.lines.push(line(colour, 2 * FINER, None, vec![(measured[1], band.low), (measured[1], band.high)]));
        plot.lines.push(line(colour, 2 * FINER, None, vec![(measured[0], band.best), (measured[2], band.best)]));
        plot.points.push(Point {
            at: (measured[1], band.best),
            colour,
            shape: if inside { Shape::Circle } else { Shape::Square },
            strong: true,
            text: Some((number + 1).to_string()),
        });
        for value in measured.into_iter().chain([band.low, band.high]) {
            (low, high) = (low.min(value), high.max(value));
        }
        if !units.iter().any(|q| q.unit().0 == row.experiment.quantity.unit().0) {
            units.push(row.experiment.quantity);
        }
    }
    plot.lines.insert(0, line(BLACK, FINER, Some((6, 4)), vec![(low, low), (high, high)]));
    let drawn = plot.inline("Predicted against measured value of every row, both axes logarithmic");
    let drawn = drawn.map_err(|reason| Error::file(PAGE, std::io::Error::other(format!("chart: {reason}"))))?;
    let mut entries: Vec<String> =
        units.iter().map(|q| legend_dot(colour(*q), &format!("in {}", q.unit().0))).collect();
    entries.push(legend_line(BLACK, 1.0, Some((6, 4)), "predicted = measured"));
    Ok(figure(
        &format!("{}{drawn}", legend_row(&entries)),
        "Numbers are those of the table below. Upright: the band; level: the scatter of the measurement, where it is known. A square is a \
         measurement outside the band.",
    ))
}

fn comparison(rows: &[Row]) -> String {
    let columns = [
        numbers("No."),
        words("Experiment"),
        words("Quantity"),
        numbers("Predicted"),
        numbers("Measured"),
        numbers("Best / measured"),
        numbers("Width of the band"),
        words("Measured lies"),
    ];
    let cells = |(number, row): (usize, &Row)| {
        let e = row.experiment;
        let class = match row.is_inside() {
            _ if !row.counts() => "soft",
            Some(true) => "good",
            _ => "bad",
        };
        vec![
            (number + 1).to_string(),
            format!("{}: {}, {}", escape(&e.id), escape(&e.tissue), escape(&e.needle)),
            format!("{} [{}]", e.quantity.name(), e.quantity.unit().0),
            escape(&row.band_in_words()),
            triple(e.measured.values),
            row.ratio().map_or("-".into(), three_digits),
            row.prediction.map_or("-".into(), |band| format!("x {}", three_digits(band.width()))),
            format!("<span class=\"{class}\">{}</span>", escape(&row.verdict())),
        ]
    };
    let rows: Vec<Vec<String>> = rows.iter().enumerate().map(cells).collect();
    table("", "Low, best and high value. Width: high over low.", &columns, &rows)
}

fn details(rows: &[Row]) -> String {
    let columns = [words("Row"), words("Inputs"), words("Not covered"), words("What it says")];
    let cells = |(number, row): (usize, &Row)| {
        let e = row.experiment;
        let inputs: String = Variable::ALL
            .into_iter()
            .filter_map(|v| Some((input_in_words(e, v)?, &e.input(v)?.source)))
            .map(|(input, source)| format!("<li>{}: {}</li>", escape(&input), escape(source)))
            .collect();
        let measured = format!(
            "<li>measured {} {}, {}: {}</li>",
            triple(e.measured.values),
            e.quantity.unit().0,
            e.measured.origin.word(),
            escape(&e.measured.source)
        );
        let gaps: Vec<String> = e.uncovered.iter().map(|gap| gap.words().to_string()).collect();
        vec![
            format!("{}. {}", number + 1, escape(&e.id)),
            format!("<ul>{inputs}{measured}</ul>"),
            escape(&and(&gaps)),
            escape(&e.note),
        ]
    };
    let rows: Vec<Vec<String>> = rows.iter().enumerate().map(cells).collect();
    table("words", "", &columns, &rows)
}

fn theory(rows: &[Row]) -> String {
    let mut used: Vec<Quantity> = Vec::new();
    for row in rows {
        if !used.contains(&row.experiment.quantity) {
            used.push(row.experiment.quantity);
        }
    }
    let list: String =
        used.iter().map(|q| format!("<li>{}: <code>{}</code></li>\n", q.name(), escape(q.formula()))).collect();
    format!(
        "<p>A sharp needle of radius R cuts a slit of rest length 2a ahead of itself and wedges it open. The slit is as long as makes the \
         steady force of the tip least: the strain energy U that it stores per length of shaft, and the work 2 a J_c that cutting it takes \
         (Shergold and Fleck 2004). N is dU/dR at fixed a: the force with which the tissue presses a unit length of shaft. A surface gives \
         way where indenting it further would take as much energy as having cut it (Fregonese and Bacca 2021). Plane strain, no change of \
         volume, steady cutting, no rate.</p>\n<ul>\n{list}</ul>\n\
         <p>Toughness is J_c over the width 2a of the slit. Azar and Hayward, and Gokgol and others, divide the difference of a first and a \
         second insertion into one hole by the diameter 2R. That difference is 2 a J_c here, so their number is J_c a/R, and J_c is R/a times \
         theirs. Where a row has no other number it is taken as it is, which is a lower bound: for neo-Hooke, 2 a J_c is never more than \
         3.2 mu R^2 whatever the toughness, so that no J_c gives the larger numbers back.</p>\n"
    )
}

fn sources(experiments: &[Experiment]) -> String {
    let mut lines: Vec<String> = Vec::new();
    for e in experiments {
        let place = if e.doi.is_empty() { e.title.clone() } else { format!("doi {}", e.doi) };
        let line = format!("<li>{} ({}): {}</li>\n", escape(&e.authors), e.year, escape(&place));
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    format!("<ul>\n{}</ul>\n<p>Sources of borrowed inputs stand beside them in the rows.</p>\n", lines.concat())
}
