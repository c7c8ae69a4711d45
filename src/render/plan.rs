//! What a scene needs, and what is left out: every decision is a line of `--explain`.

use super::{COMMON, DeviceTransfer, LoadedVolume, shading_defs};
use crate::gpu::ShaderVariant;
use crate::scene::{Scene, Shading, Skip};
use crate::shadow::ShadowMap;

/// Something that a scene did not need.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Omission {
    pub what: String,
    pub why: String,
    /// Bytes or work saved, where known.
    pub saved: Option<String>,
}

impl std::fmt::Display for Omission {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "left out: {} ({})", self.what, self.why)?;
        self.saved.as_ref().map_or(Ok(()), |s| write!(f, ", {s}"))
    }
}

/// The decisions for one picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Plan {
    pub shadows: bool,
    pub skip_bricks: bool,
    pub shading: Shading,
    pub left_out: Vec<Omission>,
}

/// Whether any light can be kept from a sample: the one decision that is made before a shadow map is built.
pub fn needs_shadows(scene: &Scene, transfer: &DeviceTransfer) -> Result<(), &'static str> {
    if scene.ambient >= 1.0 {
        Err("ambient 1")
    } else if transfer.empty {
        Err("no value has extinction")
    } else {
        Ok(())
    }
}

impl Plan {
    pub fn of(scene: &Scene, loaded: &LoadedVolume, transfer: &DeviceTransfer, shadow: &ShadowMap) -> Self {
        let mut left_out = Vec::new();
        let mut omit = |what: String, why: &str, saved: Option<String>| {
            left_out.push(Omission { what, why: why.into(), saved });
        };
        let needed = needs_shadows(scene, transfer);
        let shadows = shadow.lookup.is_some() && needed.is_ok();
        match (&shadow.lookup, needed) {
            (_, Err(why)) => omit("shadow pass".into(), why, None),
            (None, Ok(())) => omit("shadow pass".into(), "method none", None),
            _ => {}
        }
        let report = &shadow.report;
        if shadows && report.tiles_left_out > 0 {
            let saved = Some(format!("{:.2} MB", report.bytes_left_out as f64 * 1e-6));
            let what = format!("{} of {} shadow tiles", report.tiles_left_out, report.tiles);
            omit(what, "no active brick under them", saved);
        }
        for (what, why) in report.passes_left_out.iter().filter(|_| shadows) {
            omit((*what).into(), why, None);
        }
        let bricks = loaded.bricks.len();
        let inactive = bricks - transfer.active.active;
        let skip_bricks = scene.skip == Skip::Bricks;
        if skip_bricks && inactive > 0 {
            let share = 100.0 * inactive as f64 / bricks as f64;
            let what = format!("{inactive} of {bricks} bricks");
            omit(what, "no extinction in them", Some(format!("{share:.1} % of the volume")));
        }
        if scene.shading == Shading::None {
            omit("gradients".into(), "shading none", Some("6 samples a lit sample".into()));
        }
        Self { shadows, skip_bricks, shading: scene.shading, left_out }
    }

    /// Whether the picture is made in several dispatches.
    pub(super) fn resumable(&self, shadow: &ShadowMap) -> bool {
        self.shadows && shadow.lookup.as_ref().is_some_and(|l| l.marches)
    }

    /// The ray caster that does just this.
    pub(super) fn raycast_variant(&self, transfer: &DeviceTransfer, shadow: &ShadowMap) -> ShaderVariant {
        let mut modules = COMMON.to_vec();
        let mut defs = shading_defs(self.shading).to_vec();
        if self.skip_bricks {
            defs.push("SKIP_BRICKS");
        }
        if let Some(lookup) = shadow.lookup.as_ref().filter(|_| self.shadows) {
            modules.extend(lookup.modules);
            defs.extend(&lookup.defs);
            defs.extend(transfer.march_defs());
            defs.push("SHADOWS");
            if lookup.marches {
                defs.push("RESUMABLE");
            }
        }
        ShaderVariant { entry: "raycast.wgsl", modules, defs }
    }
}
