//! Masking of parts of a volume, by clip planes and by the labels of a segmentation.

use super::layer::layer;
use super::presets::{self, Found, ResolvedTransferFunction, Suiting};
use super::{Diagnostic, VolumeSpec};
use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::transfer::formats::with_quantity_of;
use crate::transfer::{ClipPlane, LabelRule, LabelVisibility, MOST_CLIP_PLANES, Quantity, TransferFunction};
use crate::volume::{Labels, Segment, Volume};
use clap::Args;
use serde::{Serialize, Serializer};
use std::collections::BTreeSet;
use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

/// Largest number of segmentation labels in the value of one command-line flag.
const MOST_NAMED: usize = 4096;
/// Relative error of the extinction above which the conversion of a label's transfer function gives the user a
/// warning.
const OFF_SAID: f64 = 0.002;
/// Largest number of segmentation labels that a message lists.
const MOST_SHOWN: usize = 12;

layer! {
/// Command-line flags that mask parts of a volume, by clip planes or segmentation labels.
#[derive(Debug, Clone, Default, PartialEq, Args, Serialize)]
pub struct MaskFlags {
    /// Clip the volume to the half-space n·x >= d, world mm; may be given several times: outside there is no
    /// extinction [default: all]
    #[arg(long, value_name = "NX,NY,NZ,D", allow_hyphen_values = true, help_heading = "Volume")]
    pub clip: Option<Vec<ClipPlane>>,
    /// Segmentation of the volume, a file of integer labels: each voxel takes the label of the nearest segmentation
    /// voxel, 0 outside [default: none]
    #[arg(long, value_name = "FILE", help_heading = "Volume")]
    pub labels: Option<String>,
    /// Segmentation labels to hide (zero extinction): numbers, or names of segments, such as 1,4-6,liver [default:
    /// none]
    #[arg(long, value_name = "LABELS", help_heading = "Volume")]
    pub hide: Option<LabelList>,
    /// Transfer function of some segmentation labels, LABELS=FILE|PRESET; may be given several times: the last for a
    /// label counts [default: that of --tf for all]
    #[arg(id = "label-tf", long, value_name = "LABELS=TF", help_heading = "Volume")]
    #[serde(rename = "label-tf")]
    pub label_tf: Option<Vec<LabelFunction>>,
}
}

/// List of segmentation labels, written as `1,4-6,liver`: numbers, ranges, and names of segments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelList {
    labels: Vec<u32>,
    names: Vec<String>,
}

impl FromStr for LabelList {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let refuse = || format!("`{text}` is not a list of labels such as 1,4-6,liver");
        let number = |text: &str| text.trim().parse::<u32>().map_err(|_| refuse());
        let mut labels = BTreeSet::new();
        let mut names = Vec::new();
        for part in text.split(',').map(str::trim) {
            if part.contains(char::is_alphabetic) {
                names.push(part.to_owned());
                continue;
            }
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
        Ok(Self { labels: labels.into_iter().collect(), names })
    }
}

impl FromIterator<u32> for LabelList {
    fn from_iter<I: IntoIterator<Item = u32>>(labels: I) -> Self {
        let labels: BTreeSet<u32> = labels.into_iter().collect();
        Self { labels: labels.into_iter().collect(), names: Vec::new() }
    }
}

impl fmt::Display for LabelList {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let runs = self.labels.chunk_by(|a, b| *b == a + 1).map(|run| match run {
            [one] => one.to_string(),
            [first, .., last] => format!("{first}-{last}"),
            [] => String::new(),
        });
        f.write_str(&runs.chain(self.names.iter().cloned()).collect::<Vec<_>>().join(","))
    }
}

impl Serialize for LabelList {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl LabelList {
    /// Returns the list with the labels of all segments of its names. Upper and lower case do not matter.
    ///
    /// # Errors
    /// No segment has one of the names.
    fn numbered(&self, labels: Option<&Labels>) -> Result<Self> {
        let segments = labels.map_or(&[][..], |labels| &labels.segments);
        let mut numbers = self.labels.clone();
        for name in &self.names {
            // Several segments may have one name.
            let named = segments.iter().filter(|segment| segment.name.to_lowercase() == name.to_lowercase());
            let before = numbers.len();
            numbers.extend(named.map(|segment| segment.label));
            if numbers.len() == before {
                return Err(no_segment(name, segments));
            }
        }
        Ok(numbers.into_iter().collect())
    }
}

/// Error for the name of a segment that does not exist.
fn no_segment(name: &str, segments: &[Segment]) -> Error {
    let error = Error::input("cannot use labels", name, "no segment has this name");
    match segments {
        [] => error.hint("the segmentation has no names of segments: use the numbers of its labels"),
        _ => {
            let names: Vec<_> = segments.iter().map(|segment| &segment.name).collect();
            error.hint(format!("the segments are {}", shown(&names)))
        }
    }
}

/// Transfer function for some segmentation labels, written as `1,4-6=bone`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LabelFunction {
    /// Segmentation labels that this transfer function is for.
    pub labels: LabelList,
    /// Preset name or file path of the transfer function for these labels.
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

impl MaskFlags {
    /// Returns the clip planes that the flag `--clip` gives.
    ///
    /// # Errors
    /// There are too many clip planes, or the volume is made from strands, which cannot be clipped.
    pub fn planes(&self, is_of_strands: bool) -> Result<Vec<ClipPlane>> {
        let refuse = |why: String| Err(Error::input("cannot clip", "--clip", why));
        let planes = self.clip.clone().unwrap_or_default();
        if is_of_strands && !planes.is_empty() {
            return refuse("strands cannot be clipped".into());
        }
        if planes.len() > MOST_CLIP_PLANES {
            return refuse(format!("{} planes, at most {MOST_CLIP_PLANES} clip a volume", planes.len()));
        }
        Ok(planes)
    }

    /// Finds the transfer functions of segmentation labels before the volume is read. `is_labelled` says that the
    /// volume already has segmentation labels.
    ///
    /// # Errors
    /// A transfer function cannot be found or read, or a flag needs a segmentation and there is none.
    pub fn find(&self, is_labelled: bool) -> Result<Vec<(LabelList, Found)>> {
        let flag = if self.hide.is_some() { "--hide" } else { "--label-tf" };
        if self.labels.is_none() && !is_labelled && (self.hide.is_some() || self.label_tf.is_some()) {
            return Err(Error::input("cannot use flag", flag, format!("{flag} needs --labels FILE")));
        }
        let functions = self.label_tf.iter().flatten();
        functions
            .map(|f| Ok((f.labels.clone(), presets::find(&f.tf).map_err(|e| e.at("--label-tf"))?)))
            .collect()
    }

    /// Reads the segmentation file of `--labels`, if given, and adds its labels to the volume.
    ///
    /// # Errors
    /// The segmentation cannot be read, or does not hold whole numbers.
    pub fn label(
        &self,
        volume: Volume,
        is_of_strands: bool,
        diagnostics: &mut Vec<Diagnostic>,
        loading: &Loading,
    ) -> Result<Volume> {
        let Some(file) = &self.labels else { return Ok(volume) };
        if is_of_strands {
            let why = "strands have no labels";
            return Err(Error::input("cannot use labels", "--labels", why));
        }
        let segmentation = VolumeSpec::new(file.clone()).read(loading)?.volume;
        let warnings = segmentation.provenance.warnings.iter();
        diagnostics.extend(warnings.map(|w| Diagnostic::warning(format!("{file}: {w}"))));
        let labels = Labels::sampled(&segmentation, &volume)?;
        if labels.resampled {
            let text = format!("{file} has another grid: each voxel takes the nearest of its labels");
            diagnostics.push(Diagnostic::note(text));
        }
        if labels.ids() == [0] {
            let text = format!("{file} labels no voxel of the volume: do both lie at the same place?");
            diagnostics.push(Diagnostic::warning(text));
        }
        let mut missing = BTreeSet::new();
        for list in self.hide.iter().chain(self.label_tf.iter().flatten().map(|f| &f.labels)) {
            let numbers = list.numbered(Some(&labels))?.labels;
            missing.extend(numbers.into_iter().filter(|label| !labels.ids().contains(label)));
        }
        let missing: Vec<u32> = missing.into_iter().collect();
        if !missing.is_empty() {
            let (missing, present) = (shown(&missing), shown(labels.ids()));
            diagnostics
                .push(Diagnostic::warning(format!("no voxel has label {missing}: {file} has {present}")));
        }
        volume.labelled(Arc::new(labels))
    }

    /// Returns the rules for a volume's segmentation labels: first the labels with their own transfer function, then
    /// the hidden labels. Each function is adapted to the volume and converted to the quantity (opacity or
    /// extinction) of `tf`.
    ///
    /// # Errors
    /// A transfer function cannot be adapted to the volume or has a gradient opacity, or no segment has a given name.
    pub fn rules(
        &self,
        found: Vec<(LabelList, Found)>,
        tf: &TransferFunction,
        volume: &Volume,
        suiting: Suiting,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Result<Vec<LabelRule>> {
        let mut rules = Vec::new();
        for (list, found) in found {
            let ResolvedTransferFunction { tf: own, warnings, notes, .. } = found.suit(volume, suiting)?;
            diagnostics.extend(warnings.into_iter().map(Diagnostic::warning));
            diagnostics.extend(notes.into_iter().map(Diagnostic::note));
            if own.gradient_opacity.is_some() {
                let why = format!("`{}` has a gradient opacity, and there is one for all labels", own.name);
                return Err(Error::input("cannot use function of labels", "--label-tf", why)
                    .hint("--gradient-opacity or the file of --tf gives it"));
            }
            // One set of device tables stores all functions, which must therefore have the same quantity.
            if !own.has_quantity_of(tf) {
                let (name, kind) = (&own.name, kind_of(tf));
                let text = format!("`{name}`, of labels {list}, became {kind}, as --tf is");
                diagnostics.push(Diagnostic::note(text));
            }
            let (tf, off) = with_quantity_of(&own, tf);
            if off > OFF_SAID {
                let text = format!("there its amounts differ by up to {:.1} %", 100.0 * off);
                diagnostics.push(Diagnostic::warning(text));
            }
            let labels = list.numbered(volume.labels().map(Arc::as_ref))?.labels;
            rules.push(LabelRule { labels, visibility: LabelVisibility::Visible(Box::new(tf)) });
        }
        if let Some(list) = &self.hide {
            let labels = list.numbered(volume.labels().map(Arc::as_ref))?.labels;
            rules.push(LabelRule { labels, visibility: LabelVisibility::Hidden });
        }
        Ok(rules)
    }

    /// Mutable file names of the segmentation and of the transfer functions of its labels.
    pub(super) fn files_mut(&mut self) -> impl Iterator<Item = &mut String> {
        self.labels.iter_mut().chain(self.label_tf.iter_mut().flatten().map(|f| &mut f.tf))
    }
}

/// Returns text for messages that tells whether a transfer function stores opacities or extinction.
fn kind_of(tf: &TransferFunction) -> String {
    match tf.quantity {
        Quantity::Opacity => format!("opacities over {} mm", tf.reference_length_mm),
        Quantity::Extinction => "extinction".into(),
    }
}

/// Formats the first few labels or names of a list, and the number of the others, as text for a message.
fn shown(labels: &[impl ToString]) -> String {
    let first: Vec<String> = labels.iter().take(MOST_SHOWN).map(ToString::to_string).collect();
    let more = labels.len().saturating_sub(MOST_SHOWN);
    first.join(", ") + &if more > 0 { format!(" and {more} more") } else { String::new() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lists_of_labels() {
        for (text, same) in [
            ("3", "3"),
            ("4-6,1", "1,4-6"),
            ("2, 1,3,9", "1-3,9"),
            ("3rd ventricle, 7", "7,3rd ventricle"),
            ("5-5,5", "5"),
        ] {
            let list: LabelList = text.parse().unwrap();
            assert_eq!(list.to_string(), same);
            assert_eq!(same.parse::<LabelList>().unwrap(), list);
        }
        for bad in ["", "1,", "3-1", "-1", "1.5", "0-4294967295", "1--2"] {
            assert!(bad.parse::<LabelList>().is_err(), "{bad}");
        }
        let function: LabelFunction = "1,2=dir/a=b.json".parse().unwrap();
        assert_eq!((function.labels.labels, function.tf), (vec![1, 2], "dir/a=b.json".to_owned()));
        for bad in ["bone", "1=", "=bone", "-1=bone"] {
            assert!(bad.parse::<LabelFunction>().is_err(), "{bad}");
        }
    }

    #[test]
    fn names_of_segments_are_labels_in_any_case() {
        let volume = crate::phantom::Phantom::Slab.build(4).unwrap();
        let mut labels = Labels::sampled(&volume, &volume).unwrap();
        labels.segments = vec![Segment { label: 7, name: "Left lung".into(), color: None }];
        let list: LabelList = "2,left LUNG".parse().unwrap();
        assert_eq!(list.numbered(Some(&labels)).unwrap().labels, [2, 7]);
        let error = "liver".parse::<LabelList>().unwrap().numbered(Some(&labels)).unwrap_err();
        assert!(error.exit_status() == 2 && error.hint.unwrap().contains("Left lung"));
        assert!(list.numbered(None).unwrap_err().hint.unwrap().contains("numbers"));
    }

    #[test]
    fn flags_of_labels_need_a_segmentation() {
        let flags = MaskFlags { hide: "1".parse().ok(), ..MaskFlags::default() };
        assert_eq!(flags.find(false).unwrap_err().place, "--hide");
    }
}
