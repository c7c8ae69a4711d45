//! `rays`: a shadow ray per lookup.

use super::method::{Entry, Lookup, Method, ShadowMap};
use super::none::without_map;
use super::settings::Value;
use super::style::{Marker, Style};
use super::tolerances::march_bound;
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
    sets_budgets: false,
};

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
        let map = without_map(self, context);
        Ok(ShadowMap { bound: Some(march_bound(context, &map.light_space)), ..map })
    }
}
