//! `run.json`: how a folder's table was made, and which files of the folder are its own.
//!
//! It is written before anything is measured and again at the end. By it a folder can be run again, shards are known to
//! be of one sweep, and two runs never mix in a folder.

use super::names::{self, RUN};
use crate::measure::compare::slugs;
use crate::measure::facts::Facts;
use crate::measure::job::Effort;
use crate::measure::journal::JOURNAL;
use crate::measure::table::Row;
use crate::shadow::{Method, MethodSpec};
use itertools::Itertools as _;
use serde::{Deserialize, Serialize};
use std::fmt;
use std::path::Path;
use std::str::FromStr;

/// Shards of a sweep are no more than its rows can be.
const MAX_SHARDS: u32 = 10_000;

/// A scene, and what it was read from.
#[derive(Debug, Clone, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct SceneRecord {
    /// Scene name in the table.
    pub name: String,
    /// The scene file in the folder; empty where there is none.
    pub file: String,
    /// Scene file with every setting, defaults included.
    pub settings: String,
    /// SHA-256 of the volume's file, or of both of a pair; `None` for one that is built in.
    pub volume_sha256: Option<String>,
    /// The preset, or the file, that the transfer function is from.
    pub tf: String,
    /// The transfer function's file in the folder; empty for a preset.
    pub tf_file: String,
    /// SHA-256 of the transfer function's text, in the volume's units.
    pub tf_sha256: String,
    /// Width and height of the picture, pixels.
    pub size: [u32; 2],
    /// Number of the only light of this scene, from 1, if the scene is a copy of the scene before it with one light
    /// (`--each-light`).
    #[serde(default)]
    pub light: Option<u32>,
}

/// A row of the whole table, whichever shard it is in.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct RowRecord {
    /// Index of the scene, from 0.
    pub scene: usize,
    /// `METHOD:key=value,...`.
    pub method: String,
    /// Part of its files' names.
    pub slug: String,
    /// Whether the row is measured in this folder.
    pub here: bool,
    /// Whether a search within a budget added it to the requested ones.
    #[serde(default)]
    pub chosen: bool,
}

impl RowRecord {
    /// Whether a measured row has these settings; the scene may have chosen the size of its map.
    pub fn is_of(&self, row: &Row) -> bool {
        self.method.parse::<MethodSpec>().is_ok_and(|spec| {
            (spec.entry().name, spec.label()) == (&*row.method, row.params.clone())
                && spec.map_size().is_none_or(|side| row.map == Some(side))
        })
    }
}

/// One part of a sweep: row `k`, from 0, is in it where `k` modulo `of` is `index - 1`.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shard {
    /// Number of the shard, from 1.
    pub index: u32,
    /// Number of shards.
    pub of: u32,
}

impl Shard {
    /// Whether the `k`-th row of the sweep is in it.
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

/// Description of a table's measurement.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Run {
    /// Version of the program.
    pub version: String,
    /// Commit that the program was built from.
    pub revision: String,
    /// `release` or `debug`.
    pub profile: String,
    /// The command line as it was given.
    pub command: Vec<String>,
    /// A command line that makes the table again from what is in the folder; run beside it.
    pub again: String,
    /// Graphics adapter.
    pub adapter: String,
    /// Every adapter of a merged table.
    pub adapters: Vec<String>,
    /// Driver of the adapter.
    pub driver: String,
    /// Threads of the host's parallel work.
    pub threads: u32,
    /// The methods as they were given.
    pub methods: String,
    /// Amounts of measurement.
    pub effort: Effort,
    /// Budgets within which each method's settings were tuned, in the syntax of `--budget`.
    #[serde(default)]
    pub budgets: Vec<String>,
    /// Whether omissions were measured as well.
    pub ablate: bool,
    /// `I/N` where the folder holds a part of the sweep.
    pub shard: Option<String>,
    /// The folders that a merged table is of.
    pub merged: Vec<String>,
    /// Whether every file is there.
    pub finished: bool,
    /// The scenes.
    pub scenes: Vec<SceneRecord>,
    /// Rows of the whole sweep, in order.
    pub rows: Vec<RowRecord>,
    /// Names and values that a reader has to know, as the report says them.
    pub conditions: Vec<(String, String)>,
    /// Notes on the measurement.
    pub notes: Vec<String>,
    /// Every file that the run may have written here.
    pub files: Vec<String>,
}

impl Run {
    /// Record of a sweep over scenes on a device; `methods` is the text as given, `parsed` its methods, one a row.
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

    /// Names of the scenes.
    pub fn scene_names(&self) -> Vec<String> {
        self.scenes.iter().map(|s| s.name.clone()).collect()
    }

    /// File name prefix of a scene; empty unless there are several scenes.
    pub fn prefix(&self, scene: usize) -> String {
        names::prefix(&self.scenes[scene].name, self.scenes.len() > 1)
    }

    /// File name prefix of a scene's rows on an adapter.
    pub fn prefix_of(&self, scene: &str, adapter: &str) -> String {
        let prefix = names::prefix(scene, self.scenes.len() > 1);
        if self.adapters.len() > 1 { names::adapter_prefix(&prefix, adapter) } else { prefix }
    }

    /// Text chunks of pictures ([`Self::picture_texts`]) for the scene of a name.
    pub fn texts_of(&self, scene: &str) -> Vec<(String, String)> {
        let place = self.scenes.iter().position(|s| s.name == scene);
        place.map_or_else(Vec::new, |i| self.picture_texts(i))
    }

    /// Whether each method of the sweep is measured in this shard, scene by scene.
    pub fn methods_here(&self) -> Vec<Vec<bool>> {
        let of = |i| self.rows.iter().filter(|r| r.scene == i).map(|r| r.here).collect();
        (0..self.scenes.len()).map(of).collect()
    }

    /// Number of rows measured in this shard.
    pub fn count_here(&self) -> usize {
        self.rows.iter().filter(|r| r.here).count()
    }

    /// Keys and texts that a scene's pictures carry.
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

    /// Every file that the run may write, without repetition.
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

    /// Name parts of a scene's plots, one for each adapter: the scene and the adapter, each only if several exist.
    fn plot_parts(&self, scene: usize) -> Vec<String> {
        self.prefixes(scene).iter().map(|prefix| prefix.trim_end_matches('_').to_owned()).collect()
    }

    /// File name prefixes of a scene, one for each adapter.
    fn prefixes(&self, scene: usize) -> Vec<String> {
        let prefix = self.prefix(scene);
        match self.adapters.len() {
            0 | 1 => vec![prefix],
            _ => self.adapters.iter().map(|a| names::adapter_prefix(&prefix, a)).collect(),
        }
    }

    /// First difference from the sweep of another run, in words; repeats may differ.
    pub fn sweep_differs(&self, other: &Self) -> Option<String> {
        let effort = |run: &Self| Effort { repeats: 0, ..run.effort };
        if effort(self) != effort(other) {
            return Some("its errors are of other numbers of points, rays or depths".into());
        }
        scenes_differ(&self.scenes, &other.scenes)
    }

    /// The command line as a shell takes it.
    pub fn command_line(&self) -> String {
        self.command.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" ")
    }

    /// A command line that makes the table again, whole, from the scene files in the folder.
    pub(super) fn command_again(&self, folder: &Path) -> String {
        let mut words = vec!["umbravox".to_owned(), "compare".into()];
        let each_light = self.scenes.iter().any(|s| s.light.is_some());
        for scene in self.scenes.iter().filter(|s| !s.file.is_empty() && s.light.is_none()) {
            words.extend(["--scene".into(), folder.join(&scene.file).to_string_lossy().into_owned()]);
        }
        words.extend(["--methods".into(), self.methods.clone()]);
        let Effort { repeats, points, rays, depths, check_all } = self.effort;
        for (flag, n) in
            [("--repeats", repeats), ("--points", points), ("--rays", rays), ("--depths", depths)]
        {
            words.extend([flag.into(), n.to_string()]);
        }
        words.extend(check_all.then(|| ["--check".into(), "all".into()]).into_iter().flatten());
        words.extend(self.budgets.iter().flat_map(|budget| ["--budget".into(), budget.clone()]));
        words.extend(self.ablate.then(|| "--ablate".into()));
        words.extend(each_light.then(|| "--each-light".into()));
        words.extend(["-o".into(), "again".into()]);
        words.iter().map(|w| quoted(w)).collect::<Vec<_>>().join(" ")
    }
}

/// First difference between lists of scenes, in words.
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
        // The sums have been compared; a sum that one has not says nothing.
        let lines = |s: &SceneRecord| s.settings.lines().map(str::to_owned).collect::<Vec<_>>();
        let (this, that) = (lines(this), lines(that));
        let other =
            that.iter().find(|line| !this.contains(line)).or(this.iter().find(|l| !that.contains(l)))?;
        Some(format!("its scene {name} differs: {other}"))
    })
}

/// A word as a shell takes it.
fn quoted(word: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_./:=,+@%".contains(c);
    if !word.is_empty() && word.chars().all(plain) {
        return word.to_owned();
    }
    format!("'{}'", word.replace('\'', "'\\''"))
}
