//! What a volume's values are seen through: its transfer function, or with labels all functions of it side by side.

use super::LoadedVolume;
use super::constants::HIDDEN_SHIFT;
use crate::error::{Error, Result};
use crate::gpu::{Gpu, uniform_buffer};
use crate::transfer::{Class, SideBySide, TexelMapping, TransferFunction, TransferTables, extinct_range};
use crate::volume::MAX_LABELS;

/// One function for all labels, over texel values that the device shifts by label.
pub(super) struct SeenFunction {
    /// What tables are made of.
    pub function: TransferFunction,
    /// Texel values that occur in it.
    pub texel_range: [f64; 2],
    /// What is added to a texel value for each label that occurs; nothing where no label is seen otherwise than others.
    pub shifts: Vec<f32>,
    /// A texel value without extinction.
    pub hidden_texel: f32,
    /// Texel values, before they are shifted, up to the first and from the second of which no label has extinction.
    pub extinct: Option<[f32; 2]>,
}

impl SeenFunction {
    /// The function of a volume.
    ///
    /// # Errors
    /// Functions of labels that do not go together.
    pub fn of(loaded: &LoadedVolume, tf: &TransferFunction) -> Result<Self> {
        let on_device = &loaded.on_device;
        let plain = |tf: &TransferFunction| Self {
            function: TransferFunction { rules: Vec::new(), ..tf.clone() },
            texel_range: on_device.texel_range,
            shifts: Vec::new(),
            hidden_texel: 0.0,
            extinct: None,
        };
        let Some(labels) = loaded.volume.labels() else { return Ok(plain(tf)) };
        let classes: Vec<Class> = labels.ids().iter().map(|id| tf.class_of(*id)).collect();
        if classes.iter().all(|class| *class == Class::Function(0)) {
            return Ok(plain(tf));
        }
        let refuse = |why: String| Error::input("cannot use functions of labels", "--label-tf", why);
        let SideBySide { function, shifts, hidden } =
            tf.side_by_side(loaded.volume.value_range()).map_err(refuse)?;
        let mapping = on_device.mapping;
        let shift = |class: &Class| match *class {
            Class::Hidden => HIDDEN_SHIFT,
            Class::Function(i) => (shifts[i] / mapping.scale) as f32,
        };
        let hidden_texel = mapping.texel_from_value(hidden);
        let ends = tf.functions().into_iter().map(|tf| extinct_range(tf, mapping));
        let extinct = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
        Ok(Self {
            function,
            texel_range: [on_device.texel_range[0], hidden_texel],
            shifts: classes.iter().map(shift).collect(),
            hidden_texel: hidden_texel as f32,
            extinct: extinct.map(|(first, last)| [first, last]),
        })
    }

    /// Its tables.
    pub fn tables(&self, mapping: TexelMapping) -> TransferTables {
        TransferTables::build(&self.function, mapping, self.texel_range)
    }

    /// What shaders read labels from, where some are seen otherwise than others.
    pub fn labels(&self, gpu: &Gpu, loaded: &LoadedVolume) -> Option<(wgpu::TextureView, wgpu::Buffer)> {
        let ranks = loaded.on_device.labels.as_ref().filter(|_| !self.shifts.is_empty())?;
        let mut shifts = [0.0; MAX_LABELS];
        shifts[..self.shifts.len()].copy_from_slice(&self.shifts);
        Some((ranks.clone(), uniform_buffer(gpu, "label shifts", &shifts)))
    }
}
