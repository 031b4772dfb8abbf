//! Several layers of labels, whose segments may overlap, laid into one.

use std::collections::{BTreeMap, HashMap};

use super::voxels::{self, Fault};

/// Way out of too many segments.
const FEWER: &str = "save fewer segments at once";

/// The map under way. Every segment has its own label from 1 on, in the order of the file; where two overlap, the later one wins.
pub(super) struct Layers {
    labels: Vec<u16>,
    names: BTreeMap<u16, String>,
    label_of: HashMap<(usize, u16), u16>,
    /// What was looked up last: neighbours are alike.
    last: ((usize, u16), u16),
    /// Next free label; none once all are given away.
    next: Option<u16>,
    /// Whether a segment found none.
    is_full: bool,
    /// One bit per voxel in which segments overlap; empty until there is one.
    decided: Vec<u64>,
    /// Number of segments that the file names.
    named: usize,
}

impl Layers {
    /// An empty map of so many voxels; segments are layer, label in it, and name.
    pub fn new(count: usize, segments: impl Iterator<Item = (usize, u16, String)>) -> Result<Layers, Fault> {
        let mut labels = voxels::room(count)?;
        labels.resize(count, 0);
        let (names, label_of) = (BTreeMap::new(), HashMap::new());
        let mut layers = Layers {
            labels,
            names,
            label_of,
            last: ((0, 0), 0),
            next: Some(1),
            is_full: false,
            decided: Vec::new(),
            named: 0,
        };
        for (layer, label, name) in segments {
            if layers.label_of.contains_key(&(layer, label)) {
                let what = format!(
                    "two segments have the label {label} in layer {layer}, the second is `{}`",
                    voxels::shown(&name)
                );
                return Err(Fault::new(what, "save the segmentation again, e.g. with 3D Slicer"));
            }
            let own = layers.new_label((layer, label));
            layers.names.insert(own, name);
        }
        layers.named = layers.label_of.len();
        Ok(layers)
    }

    fn new_label(&mut self, key: (usize, u16)) -> u16 {
        let Some(label) = self.next else {
            self.is_full = true;
            return 0;
        };
        self.next = label.checked_add(1);
        self.label_of.insert(key, label);
        label
    }

    /// Puts what layer `layer` holds in voxel `n`.
    pub fn put(&mut self, n: usize, layer: usize, label: u16) {
        if label == 0 {
            return;
        }
        let key = (layer, label);
        if self.last.0 != key {
            let known = self.label_of.get(&key).copied();
            self.last = (key, known.unwrap_or_else(|| self.new_label(key)));
        }
        let own = self.last.1;
        let words = self.labels.len().div_ceil(64);
        let Some(slot) = self.labels.get_mut(n) else { return };
        if *slot != 0 {
            if self.decided.is_empty() {
                self.decided = vec![0; words];
            }
            self.decided[n / 64] |= 1 << (n % 64);
        }
        *slot = own.max(*slot);
    }

    /// Labels and names, with what is to be said about them.
    pub fn finish(self, notices: &mut Vec<String>) -> Result<(Vec<u16>, BTreeMap<u16, String>), Fault> {
        if self.is_full {
            return Err(Fault::new("there are more than 65535 segments", FEWER));
        }
        notices.push(
            "The file has several layers of segments; they are labelled 1, 2, ... in the order of the file.".into(),
        );
        if self.label_of.len() > self.named {
            let count = self.label_of.len() - self.named;
            notices.push(format!(
                "{count} labels in its layers belong to no segment that it names; they come after the others."
            ));
        }
        let overlap: u32 = self.decided.iter().map(|bits| bits.count_ones()).sum();
        if overlap > 0 {
            notices.push(format!("Segments overlap in {overlap} voxels; there the later segment is taken."));
        }
        Ok((self.labels, self.names))
    }
}
