//! Shadow methods, each in one folder and one line of the [`registry`].
//!
//! A method declares its settings ([`settings`]), builds a shadow map (or other shadow data structure), provides the
//! shader that queries it for transmittance, and states an error bound. The march of light rays, the ray caster,
//! tables, plots, `--help` and the window work with any method. `docs/adding-a-method.md` adds a method step by step.
//!
//! # Interface of a method's shaders
//! * Bind group 0 is the field, i.e. volume and transfer function (`shaders/field/`). Binding 0 of group 1 is the
//!   light space (`umbravox::light`), which [`BuildContext`] and [`TileMarch`] bind. The rest of group 1 belongs to
//!   the method. A shadow map of tiles has the table of its tiles at binding 2.
//! * A build is one or more passes, most of them over tiles through [`TileMarch`]. A pass that marches light rays
//!   (`umbravox::march`) passes the matter along each ray to the method's module `umbravox::sink`;
//!   `shaders/field/march.wgsl` states the contract.
//! * A query for transmittance is a module `umbravox::method` with `fn transmittance(g: vec3<f32>) -> f32`;
//!   `shaders/render/raycast.wgsl` states the contract. `shadow/near.wgsl` may march the last voxels before it.
//! * Constants that Rust and shaders share come from Rust, as `#{NAME}` ([`Constant`](crate::gpu::Constant)).

mod avsm;
mod beer;
mod bom;
mod bound;
mod clusters;
mod dom;
mod dsm;
mod filter;
mod fourier;
#[cfg(feature = "half")]
mod half;
mod halfangle;
mod keys;
mod layered;
mod lightvolume;
mod lookup;
mod method;
mod moments;
mod none;
mod occlusion;
mod osm;
mod published;
mod rays;
pub mod registry;
mod sat;
mod search_space;
mod sections;
pub mod settings;
mod sources;
mod style;
mod tolerances;
mod vectors;
mod wavelet;

pub use avsm::AdaptiveShadowMap;
pub use beer::{BeerMean, BeerShadowMap};
pub use bom::BoundingOpacityMap;
pub use bound::Bound;
pub use clusters::DensityClusters;
pub use dom::{Beyond, DeepOpacityMap};
pub use dsm::{DeepShadowMap, MapShare, NodeMap, Precompress, merged_map, node_depths, node_map};
pub use filter::{Filter, Taps};
pub use fourier::{Damping, FourierOpacityMap, SeriesRange};
pub use halfangle::{BetweenSlices, HalfAngle};
pub use keys::Lookups;
pub use layered::{Average, LayerSplit, Measure};
pub use lightvolume::{LightBuild, LightVolume};
pub use lookup::Lookup;
pub use method::{
    BuildReport, Curve, Enclosure, Entry, Method, MethodSpec, PassLeftOut, ShadowMap, SplitChoice,
};
pub use moments::{Basis, MomentMap};
pub use none::NoShadows;
pub use occlusion::{ambient_occlusion, occlusion_lookup};
pub use osm::{Between, OpacityShadowMap, Slicing};
pub use published::Published;
pub use rays::ShadowRays;
pub use registry::{COMPARED, CURVES, METHODS, STABILITY, entry, parse, parse_distinct, parse_list};
pub use sat::{SummedAreaTable, TableFilter};
pub use search_space::{Axis, SearchSpace};
pub(crate) use sections::{SECTION_BINDING, Section, SectionPass, Sections, TOWARDS_EYE};
pub use settings::{Key, Kind, Value, When};
pub use sources::{mapped_lights, split_samples};
pub use style::{Marker, Style};
pub use tolerances::MARCH_ERROR;
pub use wavelet::WaveletMap;

pub use crate::field::{BuildContext, LightSpace, Projection, TILE, TileMarch};
