//! Parses the OME-NGFF metadata of an image: its axes, and the arrays of its resolution levels.
//!
//! Source: "Next-generation file formats (NGFF)", 0.4 (beside Zarr 2) and 0.5 (within Zarr 3); files of 0.1 to 0.3
//! lack voxel sizes.

use super::metadata::json;
use crate::formats::common::mm_of;
use serde::Deserialize;
use serde_json::Value;
use std::path::Path;

/// Axis of an OME-Zarr image.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Axis {
    /// Name of the image axis; spatial axes are `x`, `y` and `z`.
    pub(super) name: String,
    pub(super) unit: Option<String>,
}

/// OME-NGFF coordinate transformation from array indices to lengths.
#[derive(Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
enum Transformation {
    Identity,
    Scale { scale: Vec<f64> },
    Translation { translation: Vec<f64> },
}

/// Resolution level of an OME-Zarr image.
#[derive(Debug, Clone, Default, PartialEq)]
pub(super) struct Level {
    /// Path of the Zarr array of the level, relative to the folder of the image.
    pub(super) path: String,
    /// Scale and translation that map an array index to a length along each axis of an OME-Zarr image, in the unit of
    /// the axis.
    pub(super) scale: Vec<f64>,
    pub(super) translation: Vec<f64>,
    /// Whether the OME-NGFF metadata give a scale, and thus a voxel size.
    pub(super) is_scaled: bool,
}

/// OME-Zarr image with several resolution levels.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Image {
    /// Axes of the OME-Zarr image; empty in files of old NGFF versions.
    pub(super) axes: Vec<Axis>,
    pub(super) levels: Vec<Level>,
}

/// Type of a Zarr folder according to its OME-NGFF metadata: image, series of images, microscope plate, or other.
pub(super) enum Group {
    Image(Image),
    /// Zarr folder with images in numbered subfolders, as `bioformats2raw` writes it.
    Images,
    /// Zarr folder of a microscope plate or well, with images in nested folders.
    Plate,
    Other,
}

impl Group {
    /// Reads the OME-NGFF metadata of a Zarr folder.
    ///
    /// # Errors
    /// The metadata cannot be read or are inconsistent.
    pub(super) fn open(folder: &Path) -> Result<Self, String> {
        let attributes = match json(&folder.join("zarr.json"))? {
            Some(all) => {
                let attributes = all.get("attributes").cloned().unwrap_or_default();
                attributes.get("ome").cloned().unwrap_or(attributes)
            }
            None => json(&folder.join(".zattrs"))?.unwrap_or_default(),
        };
        if let Some(image) = attributes.get("multiscales").and_then(|all| all.get(0)) {
            return Image::new(image).map(Self::Image);
        }
        let has = |key: &str| attributes.get(key).is_some();
        Ok(match (has("bioformats2raw.layout"), has("plate") || has("well")) {
            (_, true) => Self::Plate,
            (true, _) => Self::Images,
            _ => Self::Other,
        })
    }
}

impl Image {
    fn new(image: &Value) -> Result<Self, String> {
        let axes = image.get("axes").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
        let axes: Option<Vec<Axis>> = axes.iter().map(Axis::new).collect();
        let axes = axes.ok_or("an axis of its image has no name")?;
        let datasets = image.get("datasets").and_then(Value::as_array).filter(|all| !all.is_empty());
        let datasets = datasets.ok_or("its image has no arrays (datasets)")?;
        let levels = datasets.iter().map(|dataset| {
            let path = dataset.get("path").and_then(Value::as_str);
            let path = path.ok_or("a level of its image has no path")?;
            let mut level = Level { path: path.into(), ..Level::default() };
            level.transform(dataset.get("coordinateTransformations"))?;
            // Transformations of the image follow those of its levels.
            level.transform(image.get("coordinateTransformations"))?;
            Ok(level)
        });
        Ok(Self { axes, levels: levels.collect::<Result<_, String>>()? })
    }
}

impl Axis {
    /// Parses an axis of OME-NGFF metadata; in version 0.3 it is only a name.
    fn new(value: &Value) -> Option<Self> {
        let text = |key: &str| value.get(key).and_then(Value::as_str).map(String::from);
        let name = value.as_str().map(String::from).or_else(|| text("name"));
        Some(Self { name: name?.to_lowercase(), unit: text("unit") })
    }

    /// Returns the length unit of the OME-Zarr image axis in mm; `None` if it is unknown.
    pub(super) fn mm(&self) -> Option<f64> {
        mm_of(self.unit.as_deref()?)
    }
}

impl Level {
    /// Appends OME-NGFF coordinate transformations to the scale and translation of a resolution level.
    fn transform(&mut self, list: Option<&Value>) -> Result<(), String> {
        for value in list.and_then(Value::as_array).into_iter().flatten() {
            let transformation = Transformation::deserialize(value);
            match transformation
                .map_err(|e| format!("its image is placed by no scale and translation: {e}"))?
            {
                Transformation::Identity => {}
                Transformation::Scale { scale: factors } => {
                    self.is_scaled = true;
                    self.extend(factors.len());
                    let each = self.scale.iter_mut().zip(&mut self.translation).zip(factors);
                    each.for_each(|((scale, translation), factor)| {
                        *scale *= factor;
                        *translation *= factor;
                    });
                }
                Transformation::Translation { translation: offsets } => {
                    self.extend(offsets.len());
                    self.translation.iter_mut().zip(offsets).for_each(|(all, offset)| *all += offset);
                }
            }
        }
        Ok(())
    }

    /// Extends scale and translation of a resolution level to at least `axes` axes, with the identity on new axes.
    fn extend(&mut self, axes: usize) {
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
    fn transformations_are_concatenated() {
        let image = Image::new(&json!({
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
            assert!(Image::new(&bad).is_err(), "{bad}");
        }
    }
}
