//! Shadow method `half`: a fixed share of the light reaches points behind the first surface. It is the example of
//! `docs/adding-a-method.md`, compiled with the feature `half`.

use super::keys::settings;
use super::lookup::Lookup;
use super::method::{Entry, Method, ShadowMap};
use super::none::without_map;
use super::settings::{Key, Value};
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::{BuildContext, March, field_shader};
use crate::gpu::{Group, uniform_buffer};

settings! {
    /// Settings of the example shadow method `half`, which lets a fixed share of the light pass the first surface.
    pub struct Half {
        /// Share of the light that reaches points behind the first surface, from 0 to 1.
        share: f64 = Key::number([0.0, 1.0], "0.5", "share of the light behind the first surface")
            .in_label()
            .search(&["0", "0.25", "0.5", "0.75", "1"]),
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "half",
    summary: "light behind the first surface is a fixed share: an example",
    keys: Half::KEYS,
    make: |values| Some(Box::new(Half::from_values(values)?)),
    compared: "half:share=0.25,0.5",
    curve: "half",
    stability: "half",
    published: None,
    style: Style { color: [86, 180, 233], marker: Marker::Down },
};

impl Method for Half {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn lookup(&self) -> Option<Lookup> {
        Some(Lookup::new(field_shader("").with_depth_march().modules(&["shadow/half/lookup.wgsl"])))
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let map = without_map(self, context, March::Cells);
        let light = context.light_uniform(&map.light_space);
        let params = uniform_buffer(context.gpu(), "half", &[self.share as f32, 0.0, 0.0, 0.0]);
        let slots = [(0, context.kernels.uniform(&light)), (1, context.kernels.uniform(&params))];
        Ok(ShadowMap { group: Group::new(context.gpu(), "half", &slots), ..map })
    }
}
