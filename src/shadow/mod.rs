//! Shadow methods: a folder each, and a line in [`registry`].
//!
//! A method states its settings ([`settings`]), builds what its lookup reads, offers that lookup, and says what it
//! promises. Everything else (light space, march, tiles, ray caster, queries, tables, plots, `--help`, the window)
//! takes it as it is. `docs/adding-a-method.md` adds one step by step.
//!
//! # What a method's shaders find and offer
//! * Group 0 is the field (`shaders/field/`), binding 0 of group 1 the light space (`umbravox::light`), which
//!   [`BuildContext`] and [`TileMarch`] bind. The rest of group 1 is the method's own: numbers, textures of any kind,
//!   samplers. A map of tiles has its table at binding 2.
//! * A build is one or more passes, most over tiles through [`TileMarch`]. A pass that marches light rays
//!   (`umbravox::march`) hands the pieces to the method's `umbravox::sink`, whose contract stands in
//!   `shaders/field/march.wgsl`.
//! * A lookup is a module `umbravox::method` with `fn transmittance(g: vec3<f32>) -> f32`, whose contract stands in
//!   `shaders/render/raycast.wgsl`.
//! * Constants that both sides know come from Rust, as `#{NAME}` ([`Constant`](crate::gpu::Constant)).

mod avsm;
mod bom;
mod clusters;
mod dom;
mod dsm;
mod fourier;
#[cfg(feature = "half")]
mod half;
mod layered;
mod lightvolume;
mod method;
mod moments;
mod none;
mod osm;
mod rays;
pub mod registry;
mod search_space;
pub mod settings;
pub mod spec;
mod style;
mod tolerances;
mod vectors;

pub use avsm::AdaptiveShadowMap;
pub use bom::BoundingOpacityMap;
pub use clusters::DensityClusters;
pub use dom::{Beyond, DeepOpacityMap};
pub use dsm::{DeepShadowMap, NodeMap, Precompress, node_depths, node_map};
pub use fourier::{Damping, FourierOpacityMap, SeriesRange};
pub use layered::{Average, LayerSplit, Measure};
pub use lightvolume::{LightBuild, LightVolume};
pub use method::{
    Bound, BuildReport, Curve, Entry, Lookup, Method, PassLeftOut, ShadowMap, SplitChoice, Taps,
};
pub use moments::{Basis, MomentMap};
pub use none::NoShadows;
pub use osm::{OpacityShadowMap, Slicing};
pub use rays::ShadowRays;
pub use registry::{COMPARED, CURVES, METHODS, STABILITY, entry, parse, parse_distinct, parse_list};
pub use search_space::{Axis, SearchSpace};
pub use settings::{Filter, Key, Kind, Lookups, Value, When};
pub use style::{Marker, Style};

pub use crate::field::{BuildContext, LightSpace, Projection, TILE, TileMarch};
