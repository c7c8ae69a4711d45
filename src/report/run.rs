//! Run description `run.json`: records how the comparison table of a folder was measured and which files belong to
//! it.
//!
//! The file is written before the measurement and again at the end. With it, a table can be measured again, shards of
//! one comparison can be recognised, and two runs are not mixed in one folder.

use super::names::{self, RUN};
use crate::measure::compare::slugs;
use crate::measure::facts::Facts;
use crate::measure::job::{Checked, Effort};
use crate::measure::journal::JOURNAL;
use crate::measure::table::Row;
use crate::shadow::{Method, MethodSpec};
use itertools::Itertools as _;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;
use std::str::FromStr;

/// Upper limit on the number of shards into which one comparison may be split.
const MAX_SHARDS: u32 = 10_000;

/// Record of one scene of a comparison and of its input files, as `run.json` stores it.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneRecord {
    /// Name of the scene in the comparison table.
    pub name: String,
    /// File name of the scene file (camera, lights and other settings) in the result folder; empty if there is none.
    pub file: String,
    /// Text of the scene file; it contains every setting of the scene, defaults included.
    pub settings: String,
    /// SHA-256 of the volume's file, or of header and data file together; `None` for a built-in volume (phantom).
    pub volume_sha256: Option<String>,
    /// Preset or file from which the transfer function was read.
    pub tf: String,
    /// File name of the transfer function in the result folder; empty for a preset.
    pub tf_file: String,
    /// SHA-256 of the transfer function in text form, with scalar values in the units of the volume.
    pub tf_sha256: String,
    /// Width and height of the scene's picture, pixels.
    pub size: [u32; 2],
    /// Index from 1 of the light that this copy of a scene keeps, if `--each-light` makes one copy per light;
    /// otherwise `None`.
    #[serde(default)]
    pub light: Option<u32>,
}

/// Record of one row of the comparison table, as `run.json` stores it; rows that other shards measure have records
/// too.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RowRecord {
    /// Index of the scene to which a comparison-table row belongs, from 0.
    pub scene: usize,
    /// Shadow method of a comparison-table row with its settings, as `METHOD:key=value,...`.
    pub method: String,
    /// Part of file names that identifies a comparison-table row, as in the names of its picture and difference
    /// image.
    pub slug: String,
    /// Whether the shard (part of the comparison) of this folder measures the table row.
    pub here: bool,
    /// Whether the search for settings within a budget added this row to the comparison table.
    #[serde(default)]
    pub chosen: bool,
}

impl RowRecord {
    /// Returns whether a measured table row has the recorded shadow method and settings. A record without a
    /// shadow-map size matches every size.
    pub fn is_of(&self, row: &Row) -> bool {
        self.method.parse::<MethodSpec>().is_ok_and(|spec| {
            (spec.entry().name, spec.label()) == (&*row.method, row.params.clone())
                && spec.map_size().is_none_or(|side| row.map == Some(side))
        })
    }
}

/// Shard: part of a comparison that is measured separately. It contains table row `k`, from 0, if `k` modulo `of` is
/// `index - 1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Index of this shard (part of a comparison), from 1.
    pub index: u32,
    /// Number of shards into which the comparison is split.
    pub of: u32,
}

impl Shard {
    /// Returns whether the shard (part of a comparison) measures row `k` of the whole table, from 0.
    pub fn holds(self, k: usize) -> bool {
        k % self.of as usize == self.index as usize - 1
    }
}

impl FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts = text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, of)) if index >= 1 && index <= of && of <= MAX_SHARDS => Ok(Self { index, of }),
            _ => Err(format!("expected I/N, I from 1 to N, N at most {MAX_SHARDS}")),
        }
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

/// Description of how a comparison table was measured, written as `run.json` beside the table.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Version of the program that measured the comparison table.
    pub version: String,
    /// Source code commit that the program was built from.
    pub revision: String,
    /// Build profile of the program: `release` or `debug`.
    pub profile: String,
    /// Command line with which the user started the comparison, one word per entry.
    pub command: Vec<String>,
    /// Command line that measures the comparison table again from the scene files in its folder.
    pub again: String,
    /// Name of the graphics adapter that measured the comparison table; several are joined with semicolons.
    pub adapter: String,
    /// Names of all graphics adapters of a merged table; empty if there is only one.
    pub adapters: Vec<String>,
    /// Driver of the graphics adapter that measured the comparison table.
    pub driver: String,
    /// Number of threads for parallel work on the host during the comparison.
    pub threads: u32,
    /// Shadow methods of the comparison, in the text form of `--methods`.
    pub methods: String,
    /// Number of timing repeats, and numbers of points, light rays and depths at which errors are measured.
    pub effort: Effort,
    /// Memory and time budgets within which each shadow method's settings were tuned, in the syntax of `--budget`.
    #[serde(default)]
    pub budgets: Vec<String>,
    /// Whether each scene also has a page that draws it in a browser (`--page`).
    #[serde(default)]
    pub pages: bool,
    /// Whether the comparison also measured the cost of each optimization (`--ablate`).
    pub ablate: bool,
    /// Index of this shard (part of the comparison) and number of shards, as `I/N`; `None` if the folder contains the
    /// whole comparison.
    pub shard: Option<String>,
    /// Folders from which a merged comparison table was made; empty for a measured table.
    pub merged: Vec<String>,
    /// Whether all result files of the comparison have been written.
    pub finished: bool,
    /// Records of the scenes on which shadow methods are compared.
    pub scenes: Vec<SceneRecord>,
    /// Records of all rows of the comparison table, in order; rows that other shards measure are included.
    pub rows: Vec<RowRecord>,
    /// Measurement conditions that the HTML report of the comparison lists, as names and values.
    pub conditions: Vec<(String, String)>,
    /// Notes for the reader on the measurement of the comparison table.
    pub notes: Vec<String>,
    /// Names of all files that the comparison may have written into its result folder.
    pub files: Vec<String>,
}

impl Run {
    /// Creates the run description of a comparison on one graphics adapter. `methods` is the text of `--methods`, and
    /// `parsed` the shadow methods in it, one table row each.
    pub fn new(
        facts: &Facts,
        effort: Effort,
        methods: &str,
        parsed: &[Box<dyn Method>],
        mut scenes: Vec<SceneRecord>,
        shard: Option<Shard>,
    ) -> Self {
        let several = scenes.len() > 1;
        for scene in &mut scenes {
            let prefix = names::prefix(&scene.name, several);
            if !scene.settings.is_empty() {
                scene.file = format!("{prefix}scene.toml");
            }
        }
        let mut rows = Vec::new();
        for (i, scene) in scenes.iter().enumerate() {
            let slugs = slugs(&names::prefix(&scene.name, several), parsed);
            for (method, slug) in parsed.iter().zip(slugs) {
                let method = method.spec().to_string();
                let here = shard.is_none_or(|shard| shard.holds(rows.len()));
                rows.push(RowRecord { scene: i, method, slug, here, chosen: false });
            }
        }
        Self {
            version: facts.version.into(),
            revision: facts.revision.into(),
            profile: facts.profile.into(),
            adapter: facts.adapter.clone(),
            driver: facts.driver.clone(),
            threads: facts.threads,
            methods: methods.into(),
            effort,
            shard: shard.map(|s| s.to_string()),
            scenes,
            rows,
            ..Self::default()
        }
    }

    /// Names of the scenes on which shadow methods are compared, in order.
    pub fn scene_names(&self) -> Vec<String> {
        self.scenes.iter().map(|s| s.name.clone()).collect()
    }

    /// Prefix of the names of all result files of one scene; empty if the comparison has only one scene.
    pub fn prefix(&self, scene: usize) -> String {
        names::prefix(&self.scenes[scene].name, self.scenes.len() > 1)
    }

    /// File name of the page that draws a scene in a browser.
    pub fn page_name(&self, scene: usize) -> String {
        names::page(&self.prefix(scene))
    }

    /// Prefix of the names of all result files of one scene on one graphics adapter.
    pub fn prefix_of(&self, scene: &str, adapter: &str) -> String {
        let prefix = names::prefix(scene, self.scenes.len() > 1);
        if self.adapters.len() > 1 { names::adapter_prefix(&prefix, adapter) } else { prefix }
    }

    /// Metadata for the picture files of a named scene, as keys and texts; see [`Self::picture_texts`].
    pub fn texts_of(&self, scene: &str) -> Vec<(String, String)> {
        let place = self.scenes.iter().position(|s| s.name == scene);
        place.map_or_else(Vec::new, |i| self.picture_texts(i))
    }

    /// Returns, for each scene and shadow method, whether this shard (part of a comparison) measures it.
    pub fn methods_here(&self) -> Vec<Vec<bool>> {
        let of = |i| self.rows.iter().filter(|r| r.scene == i).map(|r| r.here).collect();
        (0..self.scenes.len()).map(of).collect()
    }

    /// Number of rows of the comparison table that this shard (part of a comparison) measures.
    pub fn count_here(&self) -> usize {
        self.rows.iter().filter(|r| r.here).count()
    }

    /// Metadata for the picture files of one scene, as keys and texts: program, adapter, scene file and SHA-256 of
    /// the input.
    pub fn picture_texts(&self, scene: usize) -> Vec<(String, String)> {
        let record = &self.scenes[scene];
        let program = format!("umbravox {}, revision {}", self.version, self.revision);
        let texts = [
            ("Software", program),
            ("Title", record.name.clone()),
            ("umbravox:adapter", format!("{}; {}", self.adapter, self.driver)),
            ("umbravox:scene", record.settings.clone()),
            ("umbravox:volume-sha256", record.volume_sha256.clone().unwrap_or_default()),
            ("umbravox:tf-sha256", record.tf_sha256.clone()),
        ];
        let filled = texts.into_iter().filter(|(_, text)| !text.is_empty());
        filled.map(|(key, text)| (key.to_owned(), text)).collect()
    }

    /// Names of all files that the comparison may write into its result folder, without repetition.
    pub fn file_names(&self) -> Vec<String> {
        let mut files: Vec<String> = ["csv", "json", "md", "tex"].map(|e| format!("compare.{e}")).into();
        files.extend([RUN, JOURNAL, "columns.md", "pictures.md", "report.html"].map(String::from));
        if !self.budgets.is_empty() {
            files.extend(["budgets.csv", "trials.csv"].map(String::from));
        }
        if self.ablate {
            files.extend(["csv", "json", "md"].map(|e| format!("ablation.{e}")));
        }
        for (i, scene) in self.scenes.iter().enumerate() {
            files.extend([&scene.file, &scene.tf_file].into_iter().filter(|name| !name.is_empty()).cloned());
            let stems = self.plot_parts(i).into_iter().flat_map(|part| names::plots(&part));
            files.extend(stems.flat_map(|stem| names::PLOT_ENDINGS.map(|e| format!("{stem}.{e}"))));
            files.extend(self.pages.then(|| self.page_name(i)));
            for prefix in self.prefixes(i) {
                files.extend(names::grids(&prefix));
                files.extend(["png", "exr"].map(|e| format!("{}.{e}", names::reference(&prefix))));
            }
        }
        for row in self.rows.iter().filter(|row| row.here) {
            files.extend(["png", "exr"].map(|e| format!("{}.{e}", names::picture(&row.slug))));
            files.extend([names::difference(&row.slug), names::nodes(&row.slug)]);
        }
        files.into_iter().unique().collect()
    }

    /// Text that tells the plots of one scene apart in their file names, one for each graphics adapter.
    fn plot_parts(&self, scene: usize) -> Vec<String> {
        self.prefixes(scene).iter().map(|prefix| prefix.trim_end_matches('_').to_owned()).collect()
    }

    /// Prefixes of the names of one scene's result files, one prefix for each graphics adapter.
    fn prefixes(&self, scene: usize) -> Vec<String> {
        let prefix = self.prefix(scene);
        match self.adapters.len() {
            0 | 1 => vec![prefix],
            _ => self.adapters.iter().map(|a| names::adapter_prefix(&prefix, a)).collect(),
        }
    }

    /// Describes the first difference between two comparisons in their scenes or numbers of points, rays and depths;
    /// `None` if they agree. The numbers of timing repeats may differ.
    pub fn sweep_differs(&self, other: &Self) -> Option<String> {
        let effort = |run: &Self| Effort { repeats: 0, short_repeats: 0, ..run.effort };
        if effort(self) != effort(other) {
            return Some("its errors are of other numbers of points, rays, depths or steps".into());
        }
        scenes_differ(&self.scenes, &other.scenes)
    }

    /// Command line that started the comparison, as one text quoted for a shell.
    pub fn command_line(&self) -> String {
        self.command.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" ")
    }

    /// Returns the command line that measures the whole table again from the scene files in the folder.
    pub(super) fn command_again(&self, folder: &Path) -> String {
        let mut words = vec!["umbravox".to_owned(), "compare".into()];
        let each_light = self.scenes.iter().any(|s| s.light.is_some());
        for scene in self.scenes.iter().filter(|s| !s.file.is_empty() && s.light.is_none()) {
            words.extend(["--scene".into(), folder.join(&scene.file).to_string_lossy().into_owned()]);
        }
        words.extend(["--methods".into(), self.methods.clone()]);
        let Effort { repeats, short_repeats, points, rays, depths, check, flicker } = self.effort;
        // Without the flag, methods with short times have more repeats.
        let repeats = (short_repeats == 0).then_some(("--repeats", repeats));
        let numbers = [("--points", points), ("--rays", rays), ("--depths", depths)];
        for (flag, n) in repeats.into_iter().chain(numbers) {
            words.extend([flag.into(), n.to_string()]);
        }
        if check != Checked::default() {
            words.extend(["--check".into(), check.name().into()]);
        }
        if flicker > 0 {
            words.extend(["--flicker".into(), flicker.to_string()]);
        }
        words.extend(self.budgets.iter().flat_map(|budget| ["--budget".into(), budget.clone()]));
        words.extend(self.ablate.then(|| "--ablate".into()));
        words.extend(each_light.then(|| "--each-light".into()));
        let page = ["--page", "--embed-volume"].map(String::from);
        words.extend(self.pages.then_some(page).into_iter().flatten());
        words.extend(["-o".into(), "again".into()]);
        words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" ")
    }
}

/// Describes the first difference between the scenes of two comparisons; `None` if they agree.
fn scenes_differ(these: &[SceneRecord], those: &[SceneRecord]) -> Option<String> {
    let names = |scenes: &[SceneRecord]| scenes.iter().map(|s| s.name.clone()).collect::<Vec<_>>();
    if names(these) != names(those) {
        return Some(format!("its scenes are {}, not {}", names(those).join(", "), names(these).join(", ")));
    }
    these.iter().zip(those).find_map(|(this, that)| {
        let name = &this.name;
        if this.volume_sha256 != that.volume_sha256 {
            return Some(format!("the volume of its scene {name} has another SHA-256"));
        }
        if this.tf_sha256 != that.tf_sha256 {
            return Some(format!("the transfer function of its scene {name} has another SHA-256"));
        }
        // Checksums are already compared; compare the settings line by line.
        let lines = |s: &SceneRecord| s.settings.lines().map(str::to_owned).collect::<Vec<_>>();
        let (this, that) = (lines(this), lines(that));
        let other =
            that.iter().find(|line| !this.contains(line)).or(this.iter().find(|l| !that.contains(l)))?;
        Some(format!("its scene {name} differs: {other}"))
    })
}

/// Quotes a word of a command line for a shell, if necessary.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}
