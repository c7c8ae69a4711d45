//! What OME-NGFF says of an image: its axes, and the arrays that hold it in several sizes.
//!
//! Source: "Next-generation file formats (NGFF)", 0.4 (beside Zarr 2) and 0.5 (within Zarr 3); files of 0.1 to 0.3 lack voxel
//! sizes.

use super::metadata::json;
use crate::formats::units::mm_of;
use serde_json::Value;
use std::path::Path;

/// Sizes of one image; more than this are none.
const LEVELS_MOST: usize = 64;
/// Names of axes and paths of arrays are said to people; longer ones are none.
const NAME_MOST_BYTES: usize = 200;

/// An axis of an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    /// `x`, `y` and `z` are those of space.
    pub(super) name: String,
    pub(super) unit: Option<String>,
}

/// One of the arrays of an image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Level {
    /// Below the image's folder.
    pub(super) path: String,
    /// From an index along each axis to a length in the axis's unit: a factor, and what is added.
    pub(super) scale: Vec<f64>,
    pub(super) translation: Vec<f64>,
    /// Whether a factor was given.
    pub(super) is_scaled: bool,
}

/// An image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Image {
    /// Empty where the file is too old to say them.
    pub(super) axes: Vec<Axis>,
    pub(super) levels: Vec<Level>,
}

/// What a folder is said to hold.
pub(super) enum Group {
    Image(Image),
    /// Images in folders of it, numbered from 0, as `bioformats2raw` writes them.
    Images,
    /// A plate or well of a microscope: images in folders of folders.
    Plate,
    /// Anything else.
    Another,
}

impl Group {
    /// Of a folder's metadata.
    ///
    /// # Errors
    /// They cannot be read, or do not hold together.
    pub(super) fn of(folder: &Path) -> Result<Self, String> {
        let attributes = match json(&folder.join("zarr.json"))? {
            Some(all) => {
                let attributes = all.get("attributes").cloned().unwrap_or_default();
                attributes.get("ome").cloned().unwrap_or(attributes)
            }
            None => json(&folder.join(".zattrs"))?.unwrap_or_default(),
        };
        if let Some(image) = attributes.get("multiscales").and_then(|all| all.get(0)) {
            return Image::of(image).map(Self::Image);
        }
        let has = |key: &str| attributes.get(key).is_some();
        Ok(match (has("bioformats2raw.layout"), has("plate") || has("well")) {
            (_, true) => Self::Plate,
            (true, _) => Self::Images,
            _ => Self::Another,
        })
    }
}

impl Image {
    fn of(image: &Value) -> Result<Self, String> {
        let axes = image.get("axes").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        let axes: Option<Vec<Axis>> = axes.iter().map(Axis::of).collect();
        let axes = axes.ok_or("an axis of its image has no name")?;
        let datasets = image.get("datasets").and_then(Value::as_array).filter(|all| !all.is_empty());
        let datasets = datasets.ok_or("its image has no arrays (datasets)")?;
        if datasets.len() > LEVELS_MOST {
            return Err(format!("its image is said to have {} levels", datasets.len()));
        }
        let levels = datasets.iter().map(|dataset| {
            let path = dataset.get("path").and_then(Value::as_str).filter(|p| p.len() <= NAME_MOST_BYTES);
            let path = path.ok_or("a level of its image has no path")?;
            let (scale, translation) = (Vec::new(), Vec::new());
            let mut level = Level { path: path.into(), scale, translation, is_scaled: false };
            level.transform(dataset.get("coordinateTransformations"))?;
            // Those of the image come after those of its levels.
            level.transform(image.get("coordinateTransformations"))?;
            Ok(level)
        });
        Ok(Self { axes, levels: levels.collect::<Result<_, String>>()? })
    }
}

impl Axis {
    /// An axis, which in version 0.3 is its name alone.
    fn of(value: &Value) -> Option<Self> {
        let text = |key: &str| value.get(key).and_then(Value::as_str).map(String::from);
        let name = value.as_str().map(String::from).or_else(|| text("name"));
        let name = name.filter(|name| name.len() <= NAME_MOST_BYTES)?;
        Some(Self { name: name.to_lowercase(), unit: text("unit") })
    }

    /// Millimetres of its unit; `None` where it has none that is known.
    pub(super) fn mm(&self) -> Option<f64> {
        mm_of(self.unit.as_deref()?)
    }
}

impl Level {
    /// Applies transformations after those that it has.
    fn transform(&mut self, list: Option<&Value>) -> Result<(), String> {
        for transformation in list.and_then(Value::as_array).into_iter().flatten() {
            let kind = transformation.get("type").and_then(Value::as_str).unwrap_or("?");
            let numbers = || -> Result<Vec<f64>, String> {
                let list = transformation.get(kind).and_then(Value::as_array);
                let numbers: Option<Vec<f64>> = list.and_then(|all| all.iter().map(Value::as_f64).collect());
                numbers.ok_or_else(|| format!("a `{kind}` of its image is no list of numbers"))
            };
            match kind {
                "identity" => {}
                "scale" => {
                    let factors = numbers()?;
                    self.is_scaled = true;
                    self.fill_up(factors.len());
                    let each = self.scale.iter_mut().zip(&mut self.translation).zip(factors);
                    each.for_each(|((scale, translation), factor)| {
                        *scale *= factor;
                        *translation *= factor;
                    });
                }
                "translation" => {
                    let offsets = numbers()?;
                    self.fill_up(offsets.len());
                    self.translation.iter_mut().zip(offsets).for_each(|(all, offset)| *all += offset);
                }
                other => {
                    let short: String = other.chars().take(40).collect();
                    return Err(format!("its image is placed by `{short}`; scale and translation are read"));
                }
            }
        }
        Ok(())
    }

    /// Makes room for so many axes.
    fn fill_up(&mut self, axes: usize) {
        let axes = axes.max(self.scale.len());
        self.scale.resize(axes, 1.0);
        self.translation.resize(axes, 0.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn transformations_follow_each_other() {
        let image = Image::of(&json!({
            "axes": ["z", {"name": "Y", "unit": "micrometer"}, {"name": "x"}],
            "datasets": [{"path": "0", "coordinateTransformations": [
                {"type": "scale", "scale": [1, 2, 3]}, {"type": "translation", "translation": [10, 20, 30]}]}],
            "coordinateTransformations": [{"type": "scale", "scale": [2, 2, 2]}, {"type": "identity"}],
        }))
        .unwrap();
        assert_eq!(image.levels[0].scale, [2.0, 4.0, 6.0]);
        assert_eq!(image.levels[0].translation, [20.0, 40.0, 60.0]);
        assert_eq!(
            (image.axes[1].name.as_str(), image.axes[1].mm(), image.axes[2].mm()),
            ("y", Some(1e-3), None)
        );
        for bad in [
            json!({"datasets": []}),
            json!({"datasets": [{"paths": "0"}]}),
            json!({"axes": [{"type": "space"}], "datasets": [{"path": "0"}]}),
            json!({"datasets": [{"path": "0", "coordinateTransformations": [{"type": "affine"}]}]}),
            json!({"datasets": [{"path": "0", "coordinateTransformations": [{"type": "scale", "scale": ["1"]}]}]}),
        ] {
            assert!(Image::of(&bad).is_err(), "{bad}");
        }
    }
}
