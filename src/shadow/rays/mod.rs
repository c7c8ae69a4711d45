//! Shadow method `rays`: marches a shadow ray for each transmittance query.

use super::keys::{LOOKUP_KEY, Lookups, settings};
use super::lookup::Lookup;
use super::method::{Entry, Method, ShadowMap};
use super::none::without_map;
use super::settings::Value;
use super::style::{Marker, Style};
use super::tolerances::march_bound;
use crate::error::Result;
use crate::field::{BuildContext, field_shader};

settings! {
    /// Settings of the shadow method `rays`, whose pictures are the reference for other methods. Each transmittance
    /// query marches a shadow ray with the code that builds shadow maps.
    ///
    /// Up to four segments of a camera ray share their queries (`shaders/render/raycast.wgsl`), as with every shadow
    /// method; `lookup=each` casts one shadow ray for each sample, as in the literature.
    pub struct ShadowRays {
        /// Whether neighbouring samples of a camera ray share one shadow ray, or each casts its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "rays",
    summary: "shadow rays, marched cell by cell: slow and close to exact",
    keys: ShadowRays::KEYS,
    make: |values| Some(Box::new(ShadowRays::from_values(values)?)),
    compared: "rays",
    curve: "",
    stability: "rays",
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
        let shader = field_shader("").with_depth_march().modules(&["shadow/rays/lookup.wgsl"]);
        Some(Lookup::new(shader).with_lookup_mode(self.lookup))
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let map = without_map(self, context);
        Ok(ShadowMap { bound: Some(march_bound(context, &map.light_space)), ..map })
    }
}
