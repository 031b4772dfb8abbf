//! One HTML page that needs nothing but itself: style, charts and pictures stand inside it, no script runs. It is
//! well-formed XML too, so that a test can read it.

/// Light and dark by the reader's choice; wide tables and rows of pictures scroll on a narrow screen and never on paper.
const STYLE: &str = "
:root { color-scheme: light dark; --ink: #1d2327; --soft: #59646b; --paper: #ffffff; --card: #f4f6f7; --line: #d3d9dd;
  --good: #006b4c; --bad: #a8420a; --link: #0067a3; }
@media (prefers-color-scheme: dark) { :root { --ink: #e4e8ea; --soft: #a3adb3; --paper: #14181b; --card: #1d2327;
  --line: #3a434a; --good: #45c79b; --bad: #f39a61; --link: #6bb8ea; } }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 1rem; max-width: 72rem; background: var(--paper); color: var(--ink);
  font: 1rem/1.55 system-ui, -apple-system, 'Segoe UI', Roboto, 'Noto Sans', sans-serif; }
h1 { font-size: 1.7rem; line-height: 1.2; margin: 0.6rem 0; }
h2 { font-size: 1.25rem; margin: 2.4rem 0 0.6rem; padding-top: 0.6rem; border-top: 1px solid var(--line); }
p, ul { max-width: 46rem; }
li { margin: 0.3rem 0; }
a { color: var(--link); }
nav { columns: 16rem; font-size: 0.95rem; }
nav a { display: block; padding: 0.15rem 0; }
.soft, figcaption { color: var(--soft); font-size: 0.92rem; }
.good { color: var(--good); font-weight: 600; }
.bad { color: var(--bad); font-weight: 600; }
.notice { border-left: 0.3rem solid var(--bad); background: var(--card); padding: 0.6rem 0.9rem; max-width: 46rem; }
.scroll { overflow-x: auto; margin: 0.8rem 0; }
table { border-collapse: collapse; font-size: 0.95rem; font-variant-numeric: tabular-nums; }
p.caption { margin: 0.8rem 0 -0.4rem; }
th, td { padding: 0.35rem 0.7rem; border-bottom: 1px solid var(--line); text-align: left; vertical-align: top; }
th { font-weight: 600; background: var(--card); }
td.number, th.number { text-align: right; }
td.number { white-space: nowrap; }
td:not(.number):not(:first-child) { min-width: 7rem; }
th { vertical-align: bottom; }
.raw { font-size: 0.82rem; }
.raw td { white-space: nowrap; }
.charts { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(100%, 26rem), 1fr)); gap: 1rem; }
figure { margin: 0; padding: 0.7rem; background: var(--card); border: 1px solid var(--line); border-radius: 0.4rem; }
figure > svg { display: block; width: 100%; height: auto; }
section > figure { max-width: 38rem; }
figcaption { margin-top: 0.4rem; }
.legend { display: flex; flex-wrap: wrap; gap: 0.2rem 1rem; margin: 0.2rem 0; font-size: 0.92rem; color: var(--ink); }
.legend span { white-space: nowrap; }
.legend svg { display: inline-block; width: 1.9rem; height: 0.8rem; margin-right: 0.35rem; vertical-align: -0.05rem; }
.pictures { display: grid; gap: 0.6rem; min-width: 36rem; }
.pictures figure { padding: 0.3rem; }
.pictures img { display: block; width: 100%; height: auto; border-radius: 0.2rem; }
.pictures .head { font-weight: 600; align-self: end; }
@media (prefers-color-scheme: dark) { img { filter: brightness(0.88); } }
@media screen and (max-width: 40rem) {
  .words thead { display: none; } .words tr { display: block; padding: 0.5rem 0; border-bottom: 1px solid var(--line); }
  .words td { display: block; border: 0; padding: 0.1rem 0; } .words td:first-child { font-weight: 600; }
  .words td:not(:first-child)::before { content: attr(data-head) ': '; color: var(--soft); } }
@media print { :root { color-scheme: light; --ink: #000000; --soft: #333333; --paper: #ffffff; --card: #ffffff;
  --line: #999999; --good: #006b4c; --bad: #a8420a; --link: #000000; }
  body { max-width: none; padding: 0; font-size: 10pt; } nav { display: none; } .scroll { overflow: visible; }
  .pictures { min-width: 0; } .charts { grid-template-columns: 1fr 1fr; } img { filter: none; }
  table { font-size: 8.5pt; } th, td { padding: 0.2rem 0.35rem; }
  figure, tr { break-inside: avoid; } h2, .caption { break-after: avoid; } .raw { font-size: 6.5pt; }
  .raw th, .raw td { padding: 0.1rem 0.3rem; min-width: 0; } }
";

/// Text as it may stand in an element or in an attribute.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // Not allowed in XML, not even escaped.
            c if c.is_control() && !c.is_ascii_whitespace() => escaped.push('\u{fffd}'),
            c => escaped.push(c),
        }
    }
    escaped
}

/// The whole page around its body, which is markup.
pub fn document(title: &str, body: &str) -> String {
    document_in("en", title, body)
}

/// The same in a language, by its code as in BCP 47.
pub fn document_in(language: &str, title: &str, body: &str) -> String {
    format!(
        "<!DOCTYPE html>\n<html lang=\"{language}\">\n<head>\n<meta charset=\"utf-8\"/>\n<meta name=\"viewport\" \
         content=\"width=device-width, initial-scale=1\"/>\n<title>{}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n\
         {body}</body>\n</html>\n",
        escape(title)
    )
}

/// A column of a table.
#[derive(Debug, Clone)]
pub struct Column {
    pub head: String,
    /// Right-aligned.
    pub number: bool,
}

/// A column of text.
pub fn words(head: &str) -> Column {
    Column { head: head.into(), number: false }
}

/// A column of numbers.
pub fn numbers(head: &str) -> Column {
    Column { head: head.into(), number: true }
}

/// A table with its caption; cells are markup. The class `words` stands the cells of a row below one another where the
/// screen is narrow, each with the head of its column; `raw` is small print.
pub fn table(class: &str, caption: &str, columns: &[Column], rows: &[Vec<String>]) -> String {
    let class_of = |column: &Column| if column.number { " class=\"number\"" } else { "" };
    let head_of = |column: &Column| match class {
        "words" => format!(" data-head=\"{}\"", escape(&column.head)),
        _ => String::new(),
    };
    let mut text = String::new();
    if !caption.is_empty() {
        // Not a caption of the table's own: that would scroll away with a wide table.
        text += &format!("<p class=\"soft caption\">{}</p>\n", escape(caption));
    }
    text += &format!("<div class=\"scroll\"><table class=\"{class}\">\n");
    let head: String =
        columns.iter().map(|c| format!("<th scope=\"col\"{}>{}</th>", class_of(c), escape(&c.head))).collect();
    text += &format!("<thead><tr>{head}</tr></thead>\n<tbody>\n");
    for row in rows {
        let cells: String =
            row.iter().zip(columns).map(|(cell, c)| format!("<td{}{}>{cell}</td>", class_of(c), head_of(c))).collect();
        text += &format!("<tr>{cells}</tr>\n");
    }
    text + "</tbody></table></div>\n"
}

/// A chart or picture (markup) with its caption (markup).
pub fn figure(content: &str, caption: &str) -> String {
    format!("<figure>{content}<figcaption>{caption}</figcaption></figure>\n")
}

/// A PNG file inside the page.
pub fn picture(png: &[u8], description: &str) -> String {
    format!("<img src=\"data:image/png;base64,{}\" alt=\"{}\"/>", base64(png), escape(description))
}

/// RFC 4648, with padding.
fn base64(bytes: &[u8]) -> String {
    const LETTERS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let word = (0..3).fold(0, |word, i| word << 8 | u32::from(group.get(i).copied().unwrap_or(0)));
        for i in 0..4 {
            let letter = LETTERS[(word >> (18 - 6 * i)) as usize & 63];
            text.push(if i <= group.len() { letter as char } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_of_the_standard() {
        for (bytes, text) in [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foobar", "Zm9vYmFy")] {
            assert_eq!(base64(bytes.as_bytes()), text);
        }
        assert_eq!(base64(&[0xff, 0xfe, 0xfd, 0xfb]), "//79+w==");
    }

    #[test]
    fn foreign_text_does_not_become_markup() {
        let page = document("a < b & \"c\"", &table("", "<i>", &[words("<b>")], &[vec![escape("x & y\u{1}")]]));
        let options = roxmltree::ParsingOptions { allow_dtd: true, ..Default::default() };
        let page = roxmltree::Document::parse_with_options(&page, options).unwrap();
        assert!(!page.descendants().any(|n| n.has_tag_name("b") || n.has_tag_name("i")));
    }
}
