//! Transfer function of a volume on the graphics device. For a volume with segmentation labels, it holds the transfer
//! functions of all labels side by side on one value axis.

use super::LoadedVolume;
use super::constants::HIDDEN_SHIFT;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, uniform_buffer};
use crate::transfer::{
    LabelClass, SideBySide, TexelMapping, TransferFunction, TransferTables, extinction_range,
};
use crate::volume::MAX_LABELS;

/// Transfer functions of all segmentation labels, merged into one function over one value axis. Shaders add an offset
/// to each texel value that depends on the label of the voxel.
pub(super) struct MergedFunction {
    /// Transfer function that holds the functions of all segmentation labels side by side on one value axis.
    pub function: TransferFunction,
    /// Lookup tables of the merged transfer function. Their first and last value with extinction are texel values
    /// before the offset of the label is added.
    pub tables: TransferTables,
    /// Largest absolute texel value on the value axis of the merged transfer function.
    pub largest_texel: f64,
    /// Offset that shaders add to texel values, for each segmentation label that occurs in the volume; empty if all
    /// labels use one transfer function.
    pub shifts: Vec<f32>,
    /// Texel value without extinction in the merged transfer function, for voxels whose segmentation label is hidden.
    pub hidden_texel: f32,
}

impl MergedFunction {
    /// Merges the transfer functions of all segmentation labels of a volume into one function over one value axis.
    ///
    /// # Errors
    /// The transfer functions of the labels cannot be used together.
    pub fn of(loaded: &LoadedVolume, tf: &TransferFunction) -> Result<Self> {
        let (mapping, texel_range) = (loaded.on_device.mapping, loaded.on_device.texel_range);
        let ids = loaded.volume.labels().map_or(&[][..], |labels| labels.ids());
        let classes: Vec<LabelClass> = ids.iter().map(|id| tf.class_of(*id)).collect();
        let largest = |[a, b]: [f64; 2]| a.abs().max(b.abs());
        if classes.iter().all(|class| *class == LabelClass::Function(0)) {
            let function = TransferFunction { rules: Vec::new(), ..tf.clone() };
            let tables = TransferTables::build(&function, mapping, texel_range);
            let largest_texel = largest(texel_range);
            return Ok(Self { function, tables, largest_texel, shifts: Vec::new(), hidden_texel: 0.0 });
        }
        let refuse = |why: String| Error::input("cannot use functions of labels", "--label-tf", why);
        let SideBySide { function, shifts, hidden } =
            tf.side_by_side(loaded.volume.value_range()).map_err(refuse)?;
        let shift = |class: &LabelClass| match *class {
            LabelClass::Hidden => HIDDEN_SHIFT,
            LabelClass::Function(i) => (shifts[i] / mapping.scale) as f32,
        };
        let hidden_texel = mapping.texel_from_value(hidden);
        let texel_range = [texel_range[0], hidden_texel];
        let mut tables = TransferTables::build(&function, mapping, texel_range);
        let ends = tf.functions().map(|tf| extinction_range(tf, mapping));
        if let Some(ends) = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))) {
            (tables.first_value, tables.last_value) = ends;
        }
        let (largest_texel, hidden_texel) = (largest(texel_range), hidden_texel as f32);
        let shifts = classes.iter().map(shift).collect();
        Ok(Self { function, tables, largest_texel, shifts, hidden_texel })
    }

    /// Returns the offset of the values of each segmentation label that occurs, by its index, to its part of the merged
    /// function; `None` for hidden labels. The list is empty if all labels use one transfer function.
    pub fn value_shifts(&self, mapping: TexelMapping) -> Vec<Option<f64>> {
        let shift = |shift: &f32| (*shift < HIDDEN_SHIFT).then(|| f64::from(*shift) * mapping.scale);
        self.shifts.iter().map(shift).collect()
    }

    /// Returns the texture of segmentation labels (`ranks`), and the offset added to the values of each label. `None` if all
    /// labels use one transfer function.
    pub fn labels(
        &self,
        gpu: &Gpu,
        ranks: Option<&wgpu::TextureView>,
    ) -> Option<(wgpu::TextureView, wgpu::Buffer)> {
        let ranks = ranks.filter(|_| !self.shifts.is_empty())?;
        let mut shifts = [0.0; MAX_LABELS];
        shifts[..self.shifts.len()].copy_from_slice(&self.shifts);
        Some((ranks.clone(), uniform_buffer(gpu, "label shifts", &shifts)))
    }
}
