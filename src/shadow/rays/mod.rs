//! Shadow method `rays`: marches a shadow ray for each transmittance query.

use super::keys::{LOOKUP_KEY, Lookups, MarchBy, STEP_KEY, settings};
use super::lookup::Lookup;
use super::method::{Entry, Method, ShadowMap};
use super::none::without_map;
use super::settings::{Key, Value};
use super::style::{Marker, Style};
use super::tolerances::march_bound;
use crate::error::Result;
use crate::field::{BuildContext, field_shader};

settings! {
    /// Settings of the shadow method `rays`, whose pictures are the reference for other methods. Each transmittance
    /// query marches a shadow ray with the code that builds shadow maps.
    ///
    /// Up to four segments of a camera ray share their queries (`shaders/render/raycast.wgsl`), as with every shadow
    /// method; `lookup=each` casts one shadow ray for each sample, as in the literature. Only rays that are marched cell by
    /// cell have an error bound and serve as a reference.
    pub struct ShadowRays {
        /// Way in which shadow rays are marched: cell by cell with exact integrals, or by samples at regular distances, as
        /// renderers usually do.
        march: MarchBy = Key::choice(
            MarchBy::NAMES,
            "cells",
            "march of shadow rays: cell by cell (exact), or by samples at regular steps",
        )
        .search_all(),
        /// Distance between regular samples along a shadow ray, in units of the smallest voxel spacing. The first sample
        /// lies at the point.
        step: f64 = STEP_KEY.search(&["8", "4", "2", "1", "0.5"]),
        /// Whether neighbouring samples of a camera ray share one shadow ray, or each casts its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "rays",
    summary: "shadow rays: slow, and close to exact if marched cell by cell",
    keys: ShadowRays::KEYS,
    make: |values| Some(Box::new(ShadowRays::from_values(values)?)),
    compared: "rays",
    curve: "",
    stability: "rays",
    published: None,
    style: Style { color: [204, 121, 167], marker: Marker::Star },
};

impl Method for ShadowRays {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn lookup(&self) -> Option<Lookup> {
        let shader = field_shader("").with_shadow_rays(self.march.with_step(self.step));
        Some(Lookup::new(shader.modules(&["shadow/rays/lookup.wgsl"])).with_lookup_mode(self.lookup))
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let map = without_map(self, context, self.march.with_step(self.step));
        let bound = (self.march == MarchBy::Cells).then(|| march_bound(context, &map.light_space));
        Ok(ShadowMap { bound, ..map })
    }
}
