//! Names of labels in the extensions of a NIfTI file: the `LabelTable` that Connectome Workbench made known and TotalSegmentator writes.
//!
//! Behind the header stand four bytes, the first not zero where extensions follow: each its length (with these eight bytes), a code, and
//! what it holds. Writers do not agree on the code of this table, so the content tells it.

use std::collections::BTreeMap;

use roxmltree::{Document, ParsingOptions};

use crate::mesh::import::vtu::{MOST_ATTRIBUTES, crowded_tag};

/// Most bytes of extensions that are looked at: a table of a thousand labels has a tenth of that.
pub(super) const LONGEST: u64 = 1 << 20;

/// The names in what stands between the header and the voxels; a table that cannot be read is told and left out.
pub(super) fn of_extensions(bytes: &[u8], big_endian: bool, notices: &mut Vec<String>) -> BTreeMap<u16, String> {
    let mut names = BTreeMap::new();
    let Some((&[follows, ..], mut rest)) = bytes.split_first_chunk::<4>() else { return names };
    if follows == 0 {
        return names;
    }
    while let Some((length, _)) = rest.split_first_chunk::<4>() {
        let length = if big_endian { i32::from_be_bytes(*length) } else { i32::from_le_bytes(*length) };
        let Some(length) = usize::try_from(length).ok().filter(|n| (8..=rest.len()).contains(n)) else { break };
        let (extension, behind) = rest.split_at(length);
        rest = behind;
        match table(&extension[8..]) {
            Some(Ok(found)) => names.extend(found),
            Some(Err(reason)) => {
                notices.push(format!("The table of names behind the header cannot be read and is left out: {reason}."));
            }
            None => {}
        }
    }
    names
}

/// The table in an extension; `None` where it is something else.
fn table(bytes: &[u8]) -> Option<Result<BTreeMap<u16, String>, String>> {
    let end = bytes.iter().rposition(|b| *b != 0)? + 1;
    let text = std::str::from_utf8(&bytes[..end]).ok()?.trim();
    if !text.starts_with('<') || !text.contains("<LabelTable") {
        return None;
    }
    if crowded_tag(text).is_some() || text.matches("xmlns").count() > MOST_ATTRIBUTES {
        return Some(Err("it has more attributes than any such table".into()));
    }
    // A document type could blow up entities; no writer of these tables makes one.
    let options = ParsingOptions { allow_dtd: false, nodes_limit: 1 << 18, ..ParsingOptions::default() };
    let document = match Document::parse_with_options(text, options) {
        Ok(document) => document,
        Err(reason) => return Some(Err(reason.to_string())),
    };
    let labels = document.descendants().filter(|node| node.has_tag_name("Label"));
    let named = labels.filter_map(|node| {
        let label = node.attribute("Key")?.trim().parse().ok().filter(|label: &u16| *label != 0)?;
        let name = node.text().map(str::trim).filter(|name| !name.is_empty())?;
        Some((label, name.to_string()))
    });
    Some(Ok(named.collect()))
}
