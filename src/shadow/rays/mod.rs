//! `rays`: a shadow ray for each lookup.

use super::keys::{LOOKUP_KEY, Lookups, settings};
use super::method::{Entry, Lookup, Method, ShadowMap};
use super::none::without_map;
use super::settings::Value;
use super::style::{Marker, Style};
use super::tolerances::march_bound;
use crate::error::Result;
use crate::field::{BuildContext, field_shader};

settings! {
    /// Settings of `rays`, which marches a shadow ray for each lookup as maps are built; the reference for pictures.
    ///
    /// Up to four segments of an eye ray share their lookups (`shaders/render/raycast.wgsl`), as with every method here;
    /// `lookup=each` is the shadow ray for each sample of the literature.
    pub struct ShadowRays {
        /// Lookups of light by eye samples.
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
