//! A small stroke font, drawn for this program.
//!
//! A glyph is a list of strokes; a stroke is a list of points, two characters each (x, y) in base 36. Baseline y = 4,
//! x-height y = 14 (`e`), capitals y = 18 (`i`), descenders y = 0. A stroke that starts with `~` is the control
//! polygon of a quadratic B-spline, closed where first and last point coincide.

use glam::DVec2;

/// Height of the baseline and of capital letters above it, in glyph units.
const BASELINE: f64 = 4.0;
const CAPITAL: f64 = 14.0;
/// Room between letters and width of a space, in glyph units.
const LETTER_SPACING: f64 = 3.8;
const SPACE: f64 = 5.0;
/// Stroke width over capital height.
const WEIGHT: f64 = 0.13;
/// Rounds of corner cutting that turn a control polygon into a curve.
const ROUNDS: usize = 3;

/// Strokes of a character; of `?` for characters that the font does not hold.
#[rustfmt::skip]
fn strokes(character: char) -> &'static str {
    match character {
        'a' => "~04848e0e04 8e84", 'b' => "0i04 ~04848e0e04", 'c' => "~8c8e0e048486", 'd' => "8i84 ~04848e0e04",
        'e' => "0989 ~898e0e048486", 'f' => "~7i3i3d 3d34 0e6e", 'g' => "~04848e0e04 ~8e83800002",
        'h' => "0i04 ~090e8e8884", 'i' => "0e04 0h0i", 'j' => "~3e323000 3h3i", 'k' => "0i04 7e08 3a84", 'l' => "0i04",
        'm' => "0e04 ~0a0e6e6964 ~6a6ecec9c4", 'n' => "0e04 ~090e8e8884", 'o' => "~04848e0e04",
        'p' => "0e00 ~04848e0e04", 'q' => "8e80 ~04848e0e04", 'r' => "0e04 ~090e6e", 's' => "~7c7e0e0979740406",
        't' => "~2i272464 0e6e", 'u' => "~0e0a048489 8e84", 'v' => "0e448e", 'w' => "0e346e94ce", 'x' => "0e84 048e",
        'y' => "0e44 8e20", 'z' => "0e8e0484",
        'A' => "045ia4 1898", 'B' => "040i5i ~5i9i9b5b 0b5b ~5baba454 0454", 'C' => "~aeai0i04a4a8",
        'D' => "040i4i ~4iaia444 4404", 'E' => "9i0i0494 0b7b", 'F' => "9i0i04 0b7b", 'G' => "~aeai0i04a4aa 6aaa",
        'H' => "040i a4ai 0bab", 'I' => "0i4i 2i24 0444", 'J' => "~7i78740408", 'K' => "040i 9i09 3ca4", 'L' => "0i0494",
        'M' => "040i68cic4", 'N' => "040ia4ai", 'O' => "~04a4ai0i04", 'P' => "040i5i ~5iaiaa5a 0a5a",
        'Q' => "~04a4ai0i04 67b3", 'R' => "040i5i ~5iaiaa5a 0a5a 5aa4", 'S' => "~9f9i0i0b9b940407", 'T' => "0iai 5i54",
        'U' => "~0i0a04a4aaai", 'V' => "0i54ai", 'W' => "0i347ib4ei", 'X' => "0ia4 04ai", 'Y' => "0i5bai 5b54",
        'Z' => "0iai04a4",
        '0' => "~04848i0i04", '1' => "1f4i44", '2' => "~0e0i8i8c04 0484", '3' => "~0f0i8i8b3b ~3b8b840407",
        '4' => "646i0888", '5' => "7i1i0b ~0b1d8d840407", '6' => "~7i3i0e08 ~04848c0c04", '7' => "0i8i34",
        '8' => "~1b7b7i1i1b ~04848b0b04", '9' => "~1454888e ~8i0i0a8a8i",
        '.' => "0405", ',' => "1502", ':' => "0405 0c0d", ';' => "1502 1c1d", '!' => "0405 090i", '\'' | '’' => "0i0e",
        '"' | '“' | '”' => "0i0e 3i3e", '-' | '–' => "0a6a", '—' => "0aca", '_' => "0282", '+' => "0a8a 464e",
        '=' => "0888 0c8c", '/' => "028i", '\\' => "0i82", '|' => "0i02", '(' => "~3i0f0532", ')' => "~0i3f3502",
        '[' => "3i0i0232", ']' => "0i3i3202", '{' => "~4i1i1b0a ~0a194212", '}' => "~0i3i3b4a ~4a390232",
        '%' => "~0e4e4i0i0e ~5494985854 049i", '*' => "484g 1a7e 1e7a", '<' | '≤' => "8e0a86", '>' => "0e8a06",
        '≥' => "0h8d09 0585", '#' => "243i 647i 0898 0d9d", '&' => "~942e2i7i7e07045499", '~' => "~090d4d49898d",
        '°' => "~0e4e4i0i0e", 'µ' | 'μ' => "0e00 ~0a048489 8e84", '²' => "~0g0i4i4f0c 0c4c", '³' => "~0h0i4i4f1f ~1f4f4c0c0d",
        '·' => "0a0b", '×' => "167c 1c76", '$' => "~9f9i0i0b9b940407 5352 5j5k", '^' => "0e4i8e",
        _ => "~0e0i7i7d3c38 3435",
    }
}

/// A straight piece of a stroke: its ends [px], y downwards.
pub type Segment = [DVec2; 2];

/// Width of a line of text [px] at the given height of capitals [px].
pub fn width(text: &str, capital: f64) -> f64 {
    let units: f64 = text.chars().map(advance).sum();
    (units - LETTER_SPACING).max(0.0) * capital / CAPITAL
}

/// Stroke width [px] that suits a height of capitals [px].
pub fn stroke_width(capital: f64) -> f64 {
    WEIGHT * capital
}

/// The segments of a line of text that starts at `origin` (left end of the baseline) [px].
pub fn segments(text: &str, origin: DVec2, capital: f64) -> Vec<Segment> {
    let scale = capital / CAPITAL;
    let mut pen = 0.0;
    let mut all = Vec::new();
    for character in text.chars() {
        for stroke in glyph(character) {
            let at = |p: DVec2| origin + scale * DVec2::new(pen + p.x, BASELINE - p.y);
            all.extend(stroke.windows(2).map(|ends| [at(ends[0]), at(ends[1])]));
        }
        pen += advance(character);
    }
    all
}

/// The text, cut to fit into `room` [px] with dots at the end.
pub fn shortened(text: &str, capital: f64, room: f64) -> String {
    if width(text, capital) <= room {
        return text.to_string();
    }
    let mut kept: Vec<char> = text.chars().collect();
    while kept.pop().is_some() {
        let candidate = format!("{}...", kept.iter().collect::<String>().trim_end());
        if width(&candidate, capital) <= room {
            return candidate;
        }
    }
    String::new()
}

fn advance(character: char) -> f64 {
    if character.is_whitespace() {
        return SPACE + LETTER_SPACING;
    }
    let right = glyph(character).iter().flatten().map(|p| p.x).fold(0.0, f64::max);
    right + LETTER_SPACING
}

/// Strokes as lists of points in glyph units.
fn glyph(character: char) -> Vec<Vec<DVec2>> {
    if character.is_whitespace() {
        return Vec::new();
    }
    strokes(character)
        .split(' ')
        .map(|stroke| {
            let (points, smooth) = match stroke.strip_prefix('~') {
                Some(points) => (points, true),
                None => (stroke, false),
            };
            let digit = |b: u8| f64::from((b as char).to_digit(36).expect("a base-36 digit"));
            let points: Vec<DVec2> =
                points.as_bytes().chunks(2).map(|pair| DVec2::new(digit(pair[0]), digit(pair[1]))).collect();
            if smooth { (0..ROUNDS).fold(points, |points, _| cut_corners(&points)) } else { points }
        })
        .collect()
}

/// One round of Chaikin's corner cutting.
fn cut_corners(points: &[DVec2]) -> Vec<DVec2> {
    let closed = points.first() == points.last();
    let mut cut: Vec<DVec2> = points.windows(2).flat_map(|e| [e[0].lerp(e[1], 0.25), e[0].lerp(e[1], 0.75)]).collect();
    if closed {
        cut.push(cut[0]);
    } else {
        let last = cut.len() - 1;
        cut[0] = points[0];
        cut[last] = points[points.len() - 1];
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_printable_character_has_strokes_inside_its_box() {
        for character in (33u8..127).map(char::from).chain("°µ²³·×≥≤–—".chars()) {
            let text = strokes(character);
            for stroke in text.split(' ') {
                let points = stroke.strip_prefix('~').unwrap_or(stroke);
                assert!(points.len() % 2 == 0 && points.len() >= 4, "{character}: {text}");
            }
            for p in glyph(character).iter().flatten() {
                assert!((0.0..=14.0).contains(&p.x), "{character}");
                assert!((0.0..=20.0).contains(&p.y), "{character}");
            }
        }
    }

    #[test]
    fn width_grows_with_text_and_size() {
        assert_eq!(width("", 10.0), 0.0);
        assert!(width("ab", 10.0) > width("a", 10.0));
        assert!((width("depth", 20.0) - 2.0 * width("depth", 10.0)).abs() < 1e-9);
    }

    #[test]
    fn long_text_is_shortened() {
        let text = "a very long title that does not fit";
        let short = shortened(text, 10.0, 100.0);
        assert!(short.ends_with("...") && width(&short, 10.0) <= 100.0, "{short}");
        assert_eq!(shortened("short", 10.0, 100.0), "short");
        assert_eq!(shortened(text, 10.0, 1.0), "");
    }
}
