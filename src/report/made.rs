//! Finished measurement of a comparison with its pictures, from which tables, plots and reports are written.

use super::run::{RowRecord, Run};
use crate::measure::ablate::Ablation;
use crate::measure::comparison::Comparison;
use crate::measure::table::Row;
use ndarray::Array3;

/// Reference picture of a scene, drawn with one shadow ray per sample; needed if no row of the comparison table has
/// this method. The difference images of the shadow methods are relative to it.
#[derive(Debug, Clone)]
pub struct ReferencePicture {
    /// Name of the scene that the reference picture shows.
    pub scene: String,
    /// Name of the graphics adapter whose pictures are compared with this reference picture.
    pub adapter: String,
    /// Pixels of the reference picture: `height x width x 4`, linear RGBA.
    pub pixels: Array3<f32>,
}

/// Measured comparison of shadow methods before its result files are written. On disk are only the journal (file that
/// records finished measurements) and the pictures of its rows.
#[derive(Default)]
pub struct Made {
    /// Comparison of shadow methods on all scenes: table rows, pictures, notes and failures.
    pub comparison: Comparison,
    /// Description of how the comparison was measured, as `run.json` stores it.
    pub run: Run,
    /// Reference pictures (one shadow ray per sample) of the scenes for which the comparison table has no row of this
    /// method.
    pub references: Vec<ReferencePicture>,
    /// Rows of the ablation table (cost of each optimization), if an ablation was requested.
    pub ablations: Option<Vec<Ablation>>,
}

impl Made {
    /// Replaces the planned rows in the run description (`run.json`) by the measured rows of the comparison table, if
    /// they differ.
    pub fn record_rows(&mut self) {
        let scene = |row: &Row| self.run.scenes.iter().position(|s| s.name == row.scene);
        let found: Vec<RowRecord> = self
            .comparison
            .compared
            .iter()
            .filter_map(|c| {
                let (method, slug) = (c.method.clone(), c.slug.clone());
                let scene = scene(&c.row)?;
                let foreseen = |r: &&RowRecord| !r.chosen && (r.scene, &r.method) == (scene, &method);
                let chosen = !self.run.rows.iter().any(|r| foreseen(&r));
                Some(RowRecord { scene, method, slug, here: true, chosen })
            })
            .collect();
        let here = self.run.rows.iter().filter(|r| r.here);
        if !here.map(|r| (r.scene, &r.method)).eq(found.iter().map(|r| (r.scene, &r.method))) {
            self.run.rows.retain(|r| !r.here);
            self.run.rows.extend(found);
            let more = self.run.file_names().into_iter().filter(|name| !self.run.files.contains(name));
            let more: Vec<String> = more.collect();
            self.run.files.extend(more);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::comparison::Compared;
    use crate::report::run::SceneRecord;

    #[test]
    fn rows_that_were_not_foreseen_are_recorded_with_their_files() {
        let record = |method: &str, here| RowRecord {
            scene: 0,
            method: method.into(),
            slug: method.into(),
            here,
            chosen: false,
        };
        let compared = |method: &str| Compared {
            // The scene has chosen the size of the map.
            row: Row { scene: "a".into(), method: method.into(), map: Some(64), ..Row::default() },
            method: method.into(),
            slug: format!("{method}-tuned"),
            picture: None,
            difference: None,
            nodes: None,
            left_out: Vec::new(),
        };
        let scene = SceneRecord { name: "a".into(), ..SceneRecord::default() };
        let rows = vec![record("none", true), record("rays", false), record("dsm", true)];
        let mut made = Made { run: Run { scenes: vec![scene], rows, ..Run::default() }, ..Made::default() };
        made.comparison.compared = vec![compared("none"), compared("dsm")];
        let before = made.run.clone();
        made.record_rows();
        assert_eq!(made.run, before, "as foreseen");
        made.comparison.compared.push(compared("osm"));
        made.record_rows();
        let methods: Vec<_> = made.run.rows.iter().map(|r| (r.method.as_str(), r.here, r.chosen)).collect();
        assert_eq!(
            methods,
            [("rays", false, false), ("none", true, false), ("dsm", true, false), ("osm", true, true),]
        );
        assert!(made.run.files.contains(&"picture_osm-tuned.exr".to_owned()));
    }
}
