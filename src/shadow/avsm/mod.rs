//! `avsm`: adaptive volumetric shadow maps.
//!
//! Salvi, Vidimče, Lauritzen and Lefohn 2010, *Adaptive Volumetric Shadow Maps*. A texel keeps `N` nodes of its ray's
//! transmittance, whatever the ray meets; where there would be more, the inner node goes whose loss changes the area under
//! the curve least, and its neighbours stay. Memory is bounded and the error is not: the counterpart of `dsm`.
//!
//! It is the march's own polyline (cell by cell within 0.0023 of the curve, with 32 bits) as long as the nodes suffice.
//!
//! Deviations from the paper, and why:
//! * Pieces arrive in the order of the march, and are appended; the paper inserts what rasterisation brings in any order.
//! * Pieces are as short as `dsm` wants them, since chords are straight; the paper's segments are as they are drawn.
//! * The transmittances of four texels are averaged (`filter=bilinear`), as in the paper; `dsm` also lays their surfaces
//!   over each other. With `filter=nearest` their difference is the compression's.
//! * A ray is over where 2^-11 of the light is left, as in every map here.

use super::method::Entry;
use super::settings::{
    DrawnFrom, FILTER_KEY, FIT_KEY, FROM_KEY, Filter, Fit, Key, LOOKUP_KEY, Lookups, MAP_KEY, MARCH_KEY,
    MarchBy, STEP_KEY, Value, settings,
};
use super::style::{Marker, Style};
use super::tolerances::longest_depth;
use super::vectors::{Numbers, Recipe, TEXELS_FILTER, VectorMap};
use crate::gpu::Constant;

settings! {
    /// Settings of an adaptive volumetric shadow map.
    pub struct AdaptiveShadowMap {
        /// Nodes a texel, `N` of the paper.
        nodes: u32 = Key::choice(&["4", "6", "8", "12", "16", "24", "32"], "8", "of a texel's transmittance").telling(),
        /// Bits of a node's depth and transmittance, each: 16 or 32.
        bits: u32 = Key::choice(&["16", "32"], "32", "of a node's depth and transmittance, floats"),
        /// What casts shadows.
        from: DrawnFrom = FROM_KEY,
        /// How light rays are marched.
        march: MarchBy = MARCH_KEY,
        /// Distance of their samples, in smallest voxel spacings.
        step: f64 = STEP_KEY,
        /// Texels a side; `None`: by the scene.
        map: Option<u32> = MAP_KEY,
        /// What it is fitted across.
        fit: Fit = FIT_KEY,
        /// How texels around a point are used.
        filter: Filter = FILTER_KEY,
        /// How eye samples ask for light.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "avsm",
    summary: "adaptive volumetric shadow maps (Salvi et al. 2010): a fixed number of nodes a texel",
    keys: AdaptiveShadowMap::KEYS,
    make: |values| Some(Box::new(AdaptiveShadowMap::from_values(values)?)),
    compared: "avsm:nodes=8,16",
    curve: "avsm",
    stability: "avsm:map=64",
    style: Style { color: [68, 170, 153], marker: Marker::Spark },
    tuned: "avsm:nodes=4,6,8,12,16,24,32,bits=16,32,filter=nearest,bilinear,\
        map=64,96,128,192,256,384,512,768,1024",
};

impl VectorMap for AdaptiveShadowMap {
    fn line(&self) -> &'static Entry {
        &ENTRY
    }

    fn settings(&self) -> Vec<Value> {
        self.to_values()
    }

    fn recipe(&self) -> Recipe {
        Recipe {
            vectors: self.nodes / 2,
            numbers_are: Numbers::floats(self.bits),
            filter: self.filter,
            linear: false,
            shape: self.fit.shape(self.map, self.from.march(self.march, self.step)),
            constants: vec![Constant::unsigned("NODES", self.nodes)],
            defs: Vec::new(),
            turns: None,
            sink: "shadow/avsm/sink.wgsl",
            lookup: &["shadow/avsm/lookup.wgsl", TEXELS_FILTER],
            asked_by: self.lookup,
            numbers: [[longest_depth(), 0.0, 0.0, 0.0], [0.0; 4]],
        }
    }
}
