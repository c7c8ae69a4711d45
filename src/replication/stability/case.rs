//! One case: everything but the method.

use super::fields::both;
use crate::scene::Light;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use std::sync::Arc;

/// Which methods a case with settings concerns.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Concerns {
    /// Every method; those that know a setting's key take it.
    All,
    /// Methods that know every key of the settings.
    ThoseWithKeys,
}

/// One case: everything but the method.
pub struct Case {
    /// Name of the case, in the form that `--case` takes.
    pub name: String,
    /// Description of the stiff or extreme property that the case tests.
    pub about: &'static str,
    /// The voxels.
    pub volume: Arc<Volume>,
    /// Transfer function from voxel values to colour and extinction.
    pub tf: TransferFunction,
    /// Each with its name.
    pub lights: Vec<(&'static str, Light)>,
    /// Put over those of the methods.
    pub settings: Vec<(&'static str, String)>,
    /// Which methods the settings concern.
    pub concerns: Concerns,
    /// Eye-ray step, in units of the smallest voxel spacing.
    pub step: f64,
}

pub(super) fn case(
    name: impl Into<String>,
    about: &'static str,
    volume: Arc<Volume>,
    tf: TransferFunction,
) -> Case {
    let lights = both(&volume);
    let (settings, concerns) = (Vec::new(), Concerns::All);
    Case { name: name.into(), about, volume, tf, lights, settings, concerns, step: 0.5 }
}

impl Case {
    pub(super) fn lit(self, lights: &[(&'static str, Light)]) -> Self {
        Self { lights: lights.to_vec(), ..self }
    }

    pub(super) fn set(self, settings: &[(&'static str, &str)], concerns: Concerns) -> Self {
        let settings = settings.iter().map(|&(key, value)| (key, value.to_owned())).collect();
        Self { settings, concerns, ..self }
    }
}
