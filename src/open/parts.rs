//! Which parts of a volume are shown, and through what: clip planes, and the labels of a segmentation.

use super::presets::{self, Found, ResolvedTransferFunction, Suiting};
use super::remark::Remark;
use super::{VolumeSpec, load_with};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::transfer::formats::{have_same_quantity, with_quantity_of};
use crate::transfer::{ClipPlane, LabelRule, LabelVisibility, MOST_CLIP_PLANES, Quantity, TransferFunction};
use crate::volume::{Labels, Volume};
use clap::Args;
use serde::{Serialize, Serializer};
use std::collections::BTreeSet;
use std::fmt;
use std::path::Path;
use std::str::FromStr;
use std::sync::Arc;

/// Labels that one flag may name.
const MOST_NAMED: usize = 4096;
/// Share of an amount from which on it is said that a function of another kind is not quite the same.
const OFF_SAID: f64 = 0.002;
/// Labels that a message shows.
const MOST_SHOWN: usize = 12;

/// Flags that say what of a volume has extinction.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
pub struct PartFlags {
    /// Only the half-space n·x >= d in world mm, may be given more than once: what is outside has no extinction
    /// [default: all]
    #[arg(long, value_name = "NX,NY,NZ,D", value_parser = ClipPlane::from_str, allow_hyphen_values = true, help_heading = "Volume")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub clip: Option<Vec<ClipPlane>>,
    /// A segmentation of the volume, of whole numbers: each voxel has the label of the nearest of its voxels, 0 outside
    /// [default: none]
    #[arg(long, value_name = "FILE", help_heading = "Volume")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub labels: Option<String>,
    /// Labels that have no extinction, such as 1,4-6 [default: none]
    #[arg(long, value_name = "LABELS", value_parser = LabelList::from_str, help_heading = "Volume")]
    #[serde(skip_serializing_if = "Option::is_none")]
    pub hide: Option<LabelList>,
    /// Another transfer function for some labels, LABELS=FILE|PRESET, may be given more than once: the last for a label
    /// counts [default: that of --tf for all]
    #[arg(id = "label-tf", long, value_name = "LABELS=TF", value_parser = LabelFunction::from_str, help_heading = "Volume")]
    #[serde(rename = "label-tf", skip_serializing_if = "Option::is_none")]
    pub label_tf: Option<Vec<LabelFunction>>,
}

/// Labels, as `1,4-6`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelList {
    labels: Vec<u32>,
}

impl FromStr for LabelList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refuse = || format!("`{text}` is no list of labels such as 1,4-6");
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| refuse());
        let mut labels = BTreeSet::new();
        for part in text.split(',') {
            let (first, last) = match part.split_once('-') {
                Some((first, last)) => (number(first)?, number(last)?),
                None => (number(part)?, number(part)?),
            };
            if first > last {
                return Err(format!("`{part}` ends before it begins"));
            }
            if (last - first) as usize + labels.len() >= MOST_NAMED {
                return Err(format!("`{text}` names more than {MOST_NAMED} labels"));
            }
            labels.extend(first..=last);
        }
        Ok(Self { labels: labels.into_iter().collect() })
    }
}

impl FromIterator<u32> for LabelList {
    fn from_iter<I: IntoIterator<Item = u32>>(labels: I) -> Self {
        let labels: BTreeSet<u32> = labels.into_iter().collect();
        Self { labels: labels.into_iter().collect() }
    }
}

impl fmt::Display for LabelList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs = self.labels.chunk_by(|a, b| *b == a + 1).map(|run| match run {
            [one] => one.to_string(),
            [first, .., last] => format!("{first}-{last}"),
            [] => String::new(),
        });
        f.write_str(&runs.collect::<Vec<_>>().join(","))
    }
}

impl Serialize for LabelList {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// A transfer function for some labels, as `1,4-6=bone`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelFunction {
    /// Which.
    pub labels: LabelList,
    /// A preset or a file.
    pub tf: String,
}

impl FromStr for LabelFunction {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (labels, tf) =
            text.split_once('=').ok_or_else(|| format!("`{text}` is not LABELS=FILE|PRESET"))?;
        if tf.trim().is_empty() {
            return Err(format!("`{text}` names no transfer function"));
        }
        Ok(Self { labels: labels.parse()?, tf: tf.trim().to_owned() })
    }
}

impl Serialize for LabelFunction {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{}={}", self.labels, self.tf))
    }
}

impl PartFlags {
    /// The clip planes.
    ///
    /// # Errors
    /// Too many, or some for strands, which would have to be cut themselves.
    pub fn planes(&self, is_of_strands: bool) -> Result<Vec<ClipPlane>> {
        let refuse = |why: String| Err(Error::input("cannot clip", "--clip", why));
        let planes = self.clip.clone().unwrap_or_default();
        if is_of_strands && !planes.is_empty() {
            return refuse("it clips volumes, and these are strands".into());
        }
        if planes.len() > MOST_CLIP_PLANES {
            return refuse(format!("{} planes, at most {MOST_CLIP_PLANES} clip a volume", planes.len()));
        }
        Ok(planes)
    }

    /// The transfer functions of labels, found before anything large is read; `is_labelled` where the voxels have labels
    /// without a file of them.
    ///
    /// # Errors
    /// A function that cannot be found or read, or labels that are spoken of without a segmentation.
    pub fn find(&self, is_labelled: bool) -> Result<Vec<(LabelList, Found)>> {
        let flag = if self.hide.is_some() { "--hide" } else { "--label-tf" };
        if self.labels.is_none() && !is_labelled && (self.hide.is_some() || self.label_tf.is_some()) {
            let why = "it is about labels, and there is no segmentation";
            return Err(Error::input("cannot use flag", flag, why).hint("--labels FILE gives one"));
        }
        let functions = self.label_tf.iter().flatten();
        functions
            .map(|f| Ok((f.labels.clone(), presets::find(&f.tf).map_err(|e| e.at("--label-tf"))?)))
            .collect()
    }

    /// The volume with the labels of its segmentation, where there is one.
    ///
    /// # Errors
    /// The segmentation cannot be read, or is none.
    pub fn label(
        &self,
        volume: Volume,
        is_of_strands: bool,
        remarks: &mut Vec<Remark>,
        loading: &Loading,
    ) -> Result<Volume> {
        let Some(file) = &self.labels else { return Ok(volume) };
        if is_of_strands {
            let why = "they are of voxels, and these are strands";
            return Err(Error::input("cannot use labels", "--labels", why));
        }
        let segmentation = load_with(&VolumeSpec::new(file.clone()), loading)?;
        let warnings = segmentation.provenance.warnings.iter().map(|w| ("warning", format!("{file}: {w}")));
        remarks.extend(warnings);
        let labels = Labels::sampled(&segmentation, &volume)?;
        if labels.resampled {
            remarks.push((
                "note",
                format!("{file} has another grid: each voxel takes the nearest of its labels"),
            ));
        }
        if labels.ids() == [0] {
            remarks.push((
                "warning",
                format!("{file} labels no voxel of the volume: do both lie at the same place?"),
            ));
        }
        let named = self.hide.iter().chain(self.label_tf.iter().flatten().map(|f| &f.labels));
        let strangers = named.flat_map(|list| &list.labels).filter(|label| !labels.ids().contains(label));
        let strangers: BTreeSet<u32> = strangers.copied().collect();
        if !strangers.is_empty() {
            let strangers: Vec<u32> = strangers.into_iter().collect();
            let (asked, there) = (shown(&strangers), shown(labels.ids()));
            remarks.push(("warning", format!("no voxel has label {asked}: {file} has {there}")));
        }
        volume.labelled(Arc::new(labels))
    }

    /// The rules for a volume's labels: its functions suited to it and of the kind of `tf`, then what is hidden.
    ///
    /// # Errors
    /// A function that cannot be suited.
    pub fn rules(
        &self,
        found: Vec<(LabelList, Found)>,
        tf: &TransferFunction,
        volume: &Volume,
        suiting: Suiting,
        remarks: &mut Vec<Remark>,
    ) -> Result<Vec<LabelRule>> {
        let mut rules = Vec::new();
        for (list, found) in found {
            let ResolvedTransferFunction { tf: own, warnings, notes, .. } = found.suit(volume, suiting)?;
            remarks.extend(warnings.into_iter().map(|warning| ("warning", warning)));
            remarks.extend(notes.into_iter().map(|note| ("note", note)));
            // One set of tables holds them all.
            if !have_same_quantity(&own, tf) {
                let (name, kind) = (&own.name, kind_of(tf));
                remarks.push(("note", format!("`{name}`, of labels {list}, became {kind}, as --tf is")));
            }
            let (tf, off) = with_quantity_of(&own, tf);
            if off > OFF_SAID {
                let percent = 100.0 * off;
                remarks.push((
                    "warning",
                    format!("there its amounts are off by up to {percent:.1} % of themselves"),
                ));
            }
            rules.push(LabelRule { labels: list.labels, visibility: LabelVisibility::Visible(Box::new(tf)) });
        }
        let hidden = self
            .hide
            .iter()
            .map(|list| LabelRule { labels: list.labels.clone(), visibility: LabelVisibility::Hidden });
        rules.extend(hidden);
        Ok(rules)
    }

    /// Paths of files beside a scene file in `folder`, where there are such.
    pub fn beside(&mut self, folder: &Path) {
        let functions = self.label_tf.iter_mut().flatten().map(|f| &mut f.tf);
        for name in self.labels.iter_mut().chain(functions) {
            let beside = folder.join(&*name);
            let is_preset = presets::PRESETS.iter().any(|p| p.name == name);
            if !name.is_empty() && !is_preset && Path::new(&*name).is_relative() && beside.exists() {
                *name = beside.to_string_lossy().into_owned();
            }
        }
    }
}

/// What a function gives, in words.
fn kind_of(tf: &TransferFunction) -> String {
    match tf.quantity {
        Quantity::Opacity => format!("opacities over {} mm", tf.reference_length_mm),
        Quantity::Extinction => "extinction".into(),
    }
}

/// The first of some labels, in words.
fn shown(labels: &[u32]) -> String {
    let first: Vec<String> = labels.iter().take(MOST_SHOWN).map(u32::to_string).collect();
    let more = labels.len().saturating_sub(MOST_SHOWN);
    first.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_labels() {
        for (text, same) in
            [("3", "3"), ("4-6,1", "1,4-6"), ("2, 1,3,9", "1-3,9"), ("0", "0"), ("5-5,5", "5")]
        {
            let list: LabelList = text.parse().unwrap();
            assert_eq!(list.to_string(), same);
            assert_eq!(same.parse::<LabelList>().unwrap(), list);
        }
        for bad in ["", "a", "1,", "3-1", "-1", "1.5", "0-4294967295", "1--2"] {
            assert!(bad.parse::<LabelList>().is_err(), "{bad}");
        }
        let function: LabelFunction = "1,2=dir/a=b.json".parse().unwrap();
        assert_eq!((function.labels.labels, function.tf), (vec![1, 2], "dir/a=b.json".to_owned()));
        for bad in ["bone", "1=", "=bone", "x=bone"] {
            assert!(bad.parse::<LabelFunction>().is_err(), "{bad}");
        }
    }

    #[test]
    fn rules_without_labels_are_refused() {
        let flags = PartFlags { hide: "1".parse().ok(), ..PartFlags::default() };
        assert_eq!(flags.find(false).unwrap_err().place, "--hide");
    }
}
