//! What a file of voxels alone cannot say, in a JSON file beside it: `foot.raw.json` of `foot.raw`, `foot.npy.json` of
//! `foot.npy`. `convert` writes it and the readers of those formats take it.

use super::raw_layout::RawLayout;
use crate::error::{Error, Result};
use crate::files::input::read_text;
use crate::volume::{Scaling, Volume};
use glam::{DAffine3, DMat3, DVec3};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// The file's content.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sidecar {
    /// `DIMXxDIMYxDIMZ:TYPE[:be]`, as `--raw` takes it; x runs fastest.
    pub layout: String,
    /// `value = stored * slope + intercept`.
    pub slope: f64,
    /// See `slope`.
    pub intercept: f64,
    /// World mm (RAS+) from index coordinates, row by row.
    pub world_from_index: [[f64; 4]; 3],
}

impl Sidecar {
    /// What is to be said of a volume that is written with this layout.
    pub fn of(volume: &Volume, layout: &RawLayout) -> Self {
        let affine = volume.world_from_index();
        Self {
            layout: layout.to_string(),
            slope: volume.scaling().slope,
            intercept: volume.scaling().intercept,
            world_from_index: std::array::from_fn(|row| {
                let m = affine.matrix3;
                [m.x_axis[row], m.y_axis[row], m.z_axis[row], affine.translation[row]]
            }),
        }
    }

    /// The name of the file beside `path`.
    pub fn path_of(path: &Path) -> PathBuf {
        let mut name = path.as_os_str().to_owned();
        name.push(".json");
        name.into()
    }

    /// The one beside `path`; `None` where there is none.
    ///
    /// # Errors
    /// There is one that cannot be read.
    pub fn beside(path: &Path) -> Result<Option<Self>> {
        const WHAT: &str = "cannot read what is said of a volume";
        let path = Self::path_of(path);
        if !path.is_file() {
            return Ok(None);
        }
        let text = read_text(&path, WHAT)?;
        serde_json::from_str(&text).map(Some).map_err(|e| Error::input(WHAT, path.display(), e))
    }

    /// The layout of the voxels.
    ///
    /// # Errors
    /// As [`RawLayout::from_str`](std::str::FromStr).
    pub fn raw_layout(&self) -> Result<RawLayout> {
        self.layout.parse()
    }

    /// Values of stored ones.
    pub fn scaling(&self) -> Scaling {
        Scaling { slope: self.slope, intercept: self.intercept }
    }

    /// World mm from index coordinates.
    pub fn affine(&self) -> DAffine3 {
        let column = |c: usize| DVec3::from_array(self.world_from_index.map(|row| row[c]));
        DAffine3::from_mat3_translation(DMat3::from_cols(column(0), column(1), column(2)), column(3))
    }
}
