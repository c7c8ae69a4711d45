//! `rays`: a shadow ray per lookup.

use super::dsm::POSITION_TOLERANCE;
use super::method::{Bound, Entry, Lookup, Method, ShadowMap};
use super::none::without_map;
use super::settings::Value;
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::{BuildContext, field_shader};

/// `rays`: a shadow ray per lookup, through the same cell-by-cell march that builds the maps; the yardstick of pictures.
///
/// As with every method here up to four parts of an eye ray share their lookups (`shaders/render/raycast.wgsl`).
#[derive(Debug, Clone, Copy)]
pub struct ShadowRays;

pub(super) static ENTRY: Entry = Entry {
    name: "rays",
    summary: "a shadow ray per sample, marched cell by cell: slow and close to exact",
    keys: &[],
    make: |_| Some(Box::new(ShadowRays)),
    compared: "rays",
    curve: "",
    stability: "rays",
    style: Style { color: [204, 121, 167], marker: Marker::Star },
    tuned: "",
};

/// Optical depth that float32 positions, two-point Gauss quadrature and sums of hundreds of pieces may be off by.
const MARCH_TOLERANCE: f64 = 1e-3;

impl Method for ShadowRays {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        Vec::new()
    }

    fn lookup(&self) -> Option<Lookup> {
        Some(Lookup::new(field_shader("").with_depth_march().modules(&["shadow/rays/lookup.wgsl"])))
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let depth_mm = POSITION_TOLERANCE * context.volume.min_spacing_mm();
        let bound = Some(Bound { transmittance: MARCH_TOLERANCE, depth_mm });
        Ok(ShadowMap { bound, ..without_map(self, context) })
    }
}
