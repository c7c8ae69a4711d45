//! Shadow method `dsm`: tiled deep shadow maps.
//!
//! Hadwiger, Kratz, Sigg, Bühler 2006, *GPU-Accelerated Deep Shadow Maps for Direct Volume Rendering*; compression
//! after Lokovic and Veach 2000. Symbols: `epsilon` is the paper's error bound on transmittance.
//!
//! Deviations from the paper, and why:
//! * One compute pass compresses all light rays. The paper's passes of eight nodes each become rows of seven curve nodes
//!   and a link. Every texel of a tile that may meet extinction has a first row. Further rows come from a pool that all
//!   tiles share, so that one texel with many nodes does not enlarge its whole tile. If the pool is too small, it grows,
//!   and the tiles that lack rows are built again.
//! * A second pass copies the nodes of texels that have any to memory without gaps, and frees the rows: a head of four
//!   words for each texel, and consecutive quads (four words) for those with more nodes. A directory of blocks of 8 x 4
//!   texels leads to the heads.
//! * Light rays are marched cell by cell instead of at regular steps. Inside a cell the value along a ray is a cubic,
//!   and the pre-compressed transfer-function table gives the values at which extinction bends, so that no peak is
//!   missed. `march=samples` takes the paper's regular steps, with the integrals of extinction between them.
//! * The slope of a stored line segment is at most zero, so that stored transmittance never rises with depth. This
//!   stays within the error bound.
//! * `filter=bilinear` averages the transmittances of four texels, with `align=on` aligned at their first depths. With
//!   `near`, the last voxels before a point are marched, and the result is clamped to the range of the four texels.
//!   Neither changes rays through texel centres, and so neither changes the error bound.
//! * A curve node has 4 bytes: 16-bit depth within the map's range, 15 bits of transmittance or optical depth,
//!   and a flag.
//! * Optical depth is linear between two nodes, not transmittance: nodes of a homogeneous medium are then farther apart.
//!   `segments=transmittance` takes the straight lines of the paper.
//! * `compress=optimal` stores the fewest nodes (Imai and Iri 1986, *An optimal algorithm for approximating a
//!   piecewise linear function*; 1988, *Polygonal approximations of a curve*) among the curves that begin with
//!   extinction, stay within `epsilon` of the marched polyline, and are level behind their last node. The number of
//!   nodes is the minimum if the algorithm's convex hulls have up to 10 corners. For larger hulls the allowed error
//!   is reduced, so that the bound holds. `docs/bound.md` has the proof; `tests/gpu/tunnel.rs` measures how far from
//!   the minimum the number is.
//! * `precompress=off` takes point samples of extinction at regular steps, as the paper's Figure 3 (left).

mod build;
mod compact;
mod count;
mod enclosure;
mod layout;
mod share;

pub use count::{NodeMap, node_depths, node_map};
pub use share::{MapShare, merged_map};

use layout::{DEPTH_STEPS, NAME, Side, UPRIGHT_STEPS, map_shader, rows_shader};

use super::bound::Bound;
use super::filter::{Filter, Taps};
use super::keys::{
    ALIGN_KEY, Align, DrawnFrom, FILTER_KEY, FIT_KEY, FROM_KEY, Fit, LOOKUP_KEY, Lookups, MAP_KEY, MARCH_KEY,
    MarchBy, NEAR_KEY, UNLESS_LINES, settings,
};
use super::lookup::{Lookup, steepest_mm};
use super::method::{BuildReport, Curve, Entry, Method, ShadowMap};
use super::published::Published;
use super::settings::{Key, Value, When, choices};
use super::style::{Marker, Style};
use super::tolerances::{CHORD_TOLERANCE, GREEDY, MARCH_ERROR, march_bound};
use crate::error::Result;
use crate::field::{BuildContext, DEPTH_SINK, LightSpace, MapShape, March, NodePools, Rounding};
use crate::gpu::tuning::{MAX_LATTICE_MARCHES, MAX_LATTICE_STEPS};
use crate::gpu::{Constant, ShaderVariant};

/// Bound on the error in transmittance from rounding optical depth at the ends of a line segment to 15 bits of 8
/// (`segments=optical_depth`), and of its exponential.
const DEPTH_STORAGE: f64 = 1.25e-4;
/// Transmittance at which the march of a light ray ends (`exp(-OPAQUE_DEPTH)` of the shaders).
const RAY_END: f64 = 1.0 / 2048.0;
/// Bound on the error from rounding the transmittances at both ends of a line segment of a deep shadow map to 15
/// bits.
const STORAGE: f64 = 1.0 / 32767.0;

/// Number of words in the state of a curve that waits for pages: optical depth, longest piece, compression, and row.
const SINK_WORDS: u32 = 4 + 1 + 7 + 7;

/// Smallest `least_weight` of a shadow map: bilinear weight of a texel from which on its transmittance counts for the
/// range of a query with `near`.
const SMALLEST_LEAST_WEIGHT: f64 = 1.0 / 512.0;
/// Largest `least_weight` of a shadow map with an error bound.
const MOST_LEAST_WEIGHT: f64 = 1.0 / 32.0;

/// Returns the largest weight of neighbouring texels that a query with `near` takes for rounding, on a light ray
/// through a texel centre.
fn least_weight(rounding: &Rounding) -> f64 {
    (2.0 * rounding.texels).max(SMALLEST_LEAST_WEIGHT)
}

choices! {
    /// Algorithm that compresses the transmittance curve of a light ray to a piecewise linear curve of few nodes.
    pub enum Compress {
        /// Greedy compression of a transmittance curve (Lokovic and Veach 2000): each line segment starts at the end
        /// of the last one, and is as long as the error bound allows.
        Greedy = "greedy",
        /// Compression of a transmittance curve to the fewest nodes within the error bound (Imai and Iri 1986); nodes
        /// need not lie on the curve.
        Optimal = "optimal",
    }
}

choices! {
    /// Quantity that is linear in depth between two nodes of a stored transmittance curve.
    pub enum Segments {
        /// Segments of a transmittance curve on which transmittance is linear in depth (Lokovic and Veach 2000).
        Transmittance = "transmittance",
        /// Segments of a transmittance curve on which optical depth is linear in depth, as in a homogeneous medium.
        OpticalDepth = "optical_depth",
    }
}

choices! {
    /// Whether a deep shadow map also stores bounds on the exact transmittance at every point.
    pub enum Enclose {
        /// Stores only the transmittance curves of light rays.
        Off = "off",
        /// Stores a lower and an upper bound on the exact transmittance at every point as well.
        On = "on",
    }
}

choices! {
    /// Way in which a march of light rays evaluates extinction: with the pre-compressed transfer-function table of
    /// Hadwiger et al. 2006, or without it.
    pub enum Precompress {
        /// Integrates extinction along light rays with the pre-compressed transfer-function table.
        Table = "table",
        /// Takes point samples of extinction along light rays at regular steps, without the pre-compressed table.
        Off = "off",
    }
}

settings! {
    /// Settings of a deep shadow map.
    pub struct DeepShadowMap {
        /// Largest error in transmittance that the compression of a deep shadow map may make (`epsilon` of Hadwiger
        /// et al. 2006).
        epsilon: f64 = Key::number([0.0, 1.0], "0.02", "error bound of compression, in transmittance")
            .in_label()
            .coarse("0.05")
            .search(&["0.2", "0.1", "0.06", "0.04", "0.02", "0.01", "0.005", "0.002"]),
        /// Algorithm that compresses the transmittance curve of a light ray to a piecewise linear curve of few nodes.
        compress: Compress = Key::choice(
            Compress::NAMES,
            "greedy",
            "compression: greedy segments (Lokovic and Veach), or the fewest nodes within epsilon (Imai and Iri)",
        ),
        /// Quantity that is linear in depth between two nodes of a stored curve: transmittance or optical depth.
        segments: Segments = Key::choice(
            Segments::NAMES,
            "optical_depth",
            "quantity that is linear between nodes: transmittance (the papers), or optical depth",
        )
        .search_all()
        .when(When::Is("compress", "greedy")),
        /// Geometry that casts the shadows: the voxels of the volume, or the strands (line segments of hair or
        /// fibres) from which the volume was made.
        from: DrawnFrom = FROM_KEY,
        /// Number of sub-texel light rays whose mean transmittance a shadow map texel stores: 1, 5 or 9.
        prefilter: u32 = Key::choice(&["1", "5", "9"], "1", "number of light rays averaged in a texel")
            .coarse("1")
            .when(UNLESS_LINES),
        /// Evaluation of extinction along light rays: with the pre-compressed transfer-function table, or by regular
        /// point samples.
        precompress: Precompress = Key::choice(
            Precompress::NAMES,
            "table",
            "pre-compressed transfer-function table, or point samples at regular steps",
        )
        .when(UNLESS_LINES),
        /// Way in which light rays are marched: cell by cell with exact integrals, or by samples at regular
        /// distances.
        march: MarchBy = MARCH_KEY.when(When::UnlessAny(&[("precompress", "off"), ("from", "lines")])),
        /// Number of shadow map texels per side; `None` if chosen from the scene.
        map: Option<u32> = MAP_KEY,
        /// Region that the shadow map covers: the bricks (blocks of voxels) with extinction that the camera sees, or
        /// all bricks with extinction.
        fit: Fit = FIT_KEY,
        /// Filter of the shadow map texels around a point.
        filter: Filter = FILTER_KEY,
        /// Whether the four texels around a point are aligned at their first depths.
        align: Align = ALIGN_KEY,
        /// Length of the march from a point towards the light before a query of the shadow map, in smallest voxel
        /// spacings; 0 for none.
        near: f64 = NEAR_KEY.when(When::UnlessAny(&[("from", "lines"), ("filter", "nearest")])),
        /// Distance between regular samples along a light ray, in units of the smallest voxel spacing. It applies to
        /// `march=samples` and `precompress=off`; pre-filtered maps with the pre-compressed table take half of it.
        step: f64 = Key::number(
            [0.01, 8.0],
            "0.5",
            "step along light rays, in units of the smallest voxel spacing (march=samples, precompress=off, prefilter)",
        ),
        /// Offset (bias) added to the depth of a point, as seen from the light, before its transmittance is queried;
        /// in units of the smallest voxel spacing.
        offset: f64 = Key::number([-8.0, 8.0], "0", "bias added to the depth of a point, in units of the smallest voxel spacing"),
        /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each
        /// makes its own.
        lookup: Lookups = LOOKUP_KEY,
        /// Whether a lower and an upper bound on the exact transmittance at every point are stored as well.
        enclose: Enclose = Key::choice(
            Enclose::NAMES,
            "off",
            "also stores a lower and an upper bound on the exact transmittance at every point",
        )
        .coarse("off")
        .when(UNLESS_LINES),
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: NAME,
    summary: "tiled deep shadow maps (Hadwiger et al. 2006), error-bounded",
    keys: DeepShadowMap::KEYS,
    make: |values| Some(Box::new(DeepShadowMap::from_values(values)?)),
    compared: "dsm:epsilon=0.06,0.02,0.005",
    curve: "dsm:epsilon=0.06,0.02",
    stability: "dsm:map=64,enclose=on",
    published: Some(Published {
        paper: "Hadwiger et al. 2006",
        settings: "dsm:segments=transmittance,march=samples,filter=nearest,near=0,lookup=each",
    }),
    style: Style { color: [0, 114, 178], marker: Marker::Circle },
};

impl DeepShadowMap {
    fn march(&self) -> March {
        self.from.march(self.march, self.step)
    }

    /// Returns texels per side and covered region of the map, and the way in which its light rays are marched.
    fn map_shape(&self) -> MapShape {
        self.fit.shape(self.map, self.filter, self.march(), self.near())
    }

    /// Returns the length of the march before a query of the shadow map, in smallest voxel spacings. With up to four
    /// texels its result is clamped to their range, so a single texel leaves nothing to march for.
    fn near(&self) -> f64 {
        if self.filter == Filter::Nearest { 0.0 } else { self.from.near(self.near) }
    }

    /// Whether a query aligns the texels around a point at their first depths.
    fn is_aligned(&self) -> bool {
        self.align == Align::On && self.filter == Filter::Bilinear
    }

    /// Returns the number of sub-texel light rays for each shadow map texel; maps drawn from strands use one.
    fn taps_a_texel(&self) -> u32 {
        if self.from == DrawnFrom::Lines { 1 } else { self.prefilter }
    }

    /// Returns the largest distance of a sub-texel light ray from the texel's centre on either axis, in texels.
    fn farthest_tap(&self) -> f64 {
        match self.taps_a_texel() {
            5 => 0.25,
            9 => 1.0 / 3.0,
            _ => 0.0,
        }
    }

    /// Whether the compression receives the whole transmittance curve of a single light ray, instead of samples at
    /// regular depths.
    fn whole_curve(&self) -> bool {
        self.from == DrawnFrom::Lines || self.precompress == Precompress::Table && self.taps_a_texel() == 1
    }

    /// Returns the distance (mm) between regular samples along a light ray of a deep shadow map. Texels that store
    /// the mean of several exact curves use half a step, so that the samples err by at most half a step in depth. The
    /// distance grows if a ray would need too many steps ([`tuning`](crate::gpu::tuning)), as for very anisotropic
    /// voxels.
    fn lattice_mm(&self, context: &BuildContext<'_>, light_space: &LightSpace) -> f64 {
        let (share, most) = match self.precompress {
            Precompress::Table => (0.5, MAX_LATTICE_MARCHES),
            Precompress::Off => (1.0, MAX_LATTICE_STEPS),
        };
        let shortest = light_space.depth_range_mm() / f64::from(most / self.taps_a_texel());
        (share * self.step * context.volume.min_spacing_mm()).max(shortest)
    }

    /// Returns the error bound of a deep shadow map, or `None` unless its light rays are marched cell by cell with
    /// the pre-compressed table, from the point of a query on. There is none for a filter of 4 x 4 texels, which blurs
    /// also at texel centres. `docs/bound.md` derives its terms.
    pub(super) fn bound(&self, context: &BuildContext<'_>, light_space: &LightSpace) -> Option<Bound> {
        if self.precompress == Precompress::Off || self.march() != March::Cells || self.filter.is_wide() {
            return None;
        }
        let spacing = context.volume.min_spacing_mm();
        let (chord, lattice_mm) = if self.whole_curve() {
            (CHORD_TOLERANCE, 0.0)
        } else {
            (0.0, self.lattice_mm(context, light_space))
        };
        let march = march_bound(context, light_space);
        // Rounded texel coordinates of a point on a texel's ray give its neighbours a weight.
        let rounding = light_space.rounding(context.volume, context.transfer.clips);
        let (texels_a_side, neighbours) = match self.filter {
            Filter::Nearest => (1, 0.0),
            _ => (2, rounding.texels),
        };
        // Rounding would take most of the range between texels for the light ray of one of them.
        if self.near() > 0.0 && least_weight(&rounding) > MOST_LEAST_WEIGHT {
            return None;
        }
        let storage = if self.has_depth_segments() { DEPTH_STORAGE } else { STORAGE };
        let align_mm = if self.is_aligned() { steepest_mm(light_space) } else { 0.0 };
        let steps = match self.compress {
            Compress::Greedy => 0.5,
            Compress::Optimal => 0.5 + 2.0 * UPRIGHT_STEPS,
        };
        let steps_mm = steps * light_space.depth_range_mm() / f64::from(DEPTH_STEPS);
        Some(Bound {
            transmittance: march.transmittance + self.epsilon + chord + RAY_END + storage + 2.0 * neighbours,
            depth_mm: march.depth_mm
                + steps_mm
                + lattice_mm
                + self.offset.abs() * spacing
                + 2.0 * neighbours * align_mm,
            from_light_mm: rounding.from_light_mm,
            texels_a_side,
            align_mm,
            reach_mm: (1.0 + self.farthest_tap()) * light_space.texel_reach_mm() + march.reach_mm,
            ..march
        })
    }

    /// Whether optical depth is linear between nodes; the fewest nodes are those of straight lines of transmittance.
    fn has_depth_segments(&self) -> bool {
        self.segments == Segments::OpticalDepth && self.compress == Compress::Greedy
    }

    /// Returns the preprocessor definition of the quantity that is linear between nodes.
    fn segment_def(&self) -> Option<&'static str> {
        self.has_depth_segments().then_some("OPTICAL_DEPTH")
    }

    /// Returns a shader that stores curves in rows, without the march of light rays.
    fn curve_shader(&self) -> ShaderVariant {
        let compress = match self.compress {
            Compress::Greedy => GREEDY,
            Compress::Optimal => "shadow/dsm/tunnel.wgsl",
        };
        let modules = ["field/tiles.wgsl", "shadow/dsm/rows.wgsl", compress];
        rows_shader("shadow/dsm/build.wgsl").modules(&modules).defs(self.segment_def())
    }

    /// Returns the shader that builds the enclosing curves of one side.
    fn prism_shader(&self, side: Side) -> ShaderVariant {
        let modules =
            ["field/sums.wgsl", "shadow/dsm/sink.wgsl", "shadow/dsm/ranges.wgsl", "shadow/dsm/prism.wgsl"];
        self.curve_shader().modules(&modules).defs(["WHOLE_CURVE", "MARCHES", "PRISM", side.def()])
    }

    /// Returns the shader code of queries for a bound on the transmittance.
    fn bounding_lookup(&self, side: Side) -> Lookup {
        let shader = map_shader("").with_depth_march().with_filter(Filter::Nearest, 1, Align::Off);
        let shader =
            shader.modules(&["shadow/dsm/lookup.wgsl"]).defs(self.segment_def()).defs(["BOUNDS", side.def()]);
        Lookup::enclosing(shader.constants(&[Constant::float("MARCH_ERROR", MARCH_ERROR as f32)]))
    }

    fn build_shader(&self) -> ShaderVariant {
        let shader = self.curve_shader();
        match (self.precompress, self.whole_curve()) {
            (_, true) => {
                let shader =
                    shader.defs(["WHOLE_CURVE", "MARCHES"]).with_march(self.march(), "shadow/dsm/sink.wgsl");
                let waits = self.march() == March::Cells && self.compress == Compress::Greedy;
                if waits { shader.with_ray_states(SINK_WORDS) } else { shader }
            }
            (Precompress::Off, false) => shader,
            (_, false) => shader.defs(["MARCHES"]).with_march(self.march(), DEPTH_SINK),
        }
    }
}

impl Method for DeepShadowMap {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn taps(&self) -> Taps {
        self.filter.taps(Taps::Within(self.taps_a_texel()))
    }

    fn lookup(&self) -> Option<Lookup> {
        let shader =
            map_shader("").with_filter(self.filter, 1, self.align).modules(&["shadow/dsm/lookup.wgsl"]);
        let shader = shader.defs(self.segment_def());
        let knows_range = self.near() > 0.0 && !self.filter.is_wide();
        let shader = shader.defs(knows_range.then_some("KNOWN_RANGE"));
        Some(Lookup::new(shader).with_near(self.near()).with_lookup_mode(self.lookup))
    }

    fn curve(&self) -> Curve {
        // On the light rays of texels, `near` changes nothing within the range of four texels.
        if self.filter.is_wide() { Curve::of_map(&self.spec()) } else { Curve::Falls }
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        let finish = [layout::allocate_shader(), layout::compact_shader()];
        let counts = [count::shader(), count::steps_shader()];
        let curves = self.enclosing_curves();
        let enclosing =
            |side| [curves.prism_shader(side), curves.bounding_lookup(side).within("render/query.wgsl")];
        let sides = Side::BOTH.into_iter().filter(|_| self.enclose == Enclose::On).flat_map(enclosing);
        [self.build_shader()].into_iter().chain(finish).chain(counts).chain(sides).collect()
    }

    fn builds_on_device(&self) -> bool {
        self.enclose == Enclose::Off && self.march() == March::Cells && self.whole_curve()
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        self.build_map(context)
    }

    fn complete(&self, report: &mut BuildReport, words: &[u32], pools: &NodePools) -> Result<bool> {
        self.complete_report(report, words, pools)
    }
}
