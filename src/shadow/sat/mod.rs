//! Shadow method `sat`: summed-area table of extinction.
//!
//! Schlegel, Makhinya and Pajarola 2011, *Extinction-based Shading and Illumination in GPU Volume Ray-Casting*. Optical
//! depth is a sum of extinction, and a summed-area table gives the sum of any cuboid by eight reads. A query
//! approximates the cone from a point to the light by cuboids of growing size: the optical depth of a stretch is the
//! mean extinction of its cuboid times its length. The table depends on volume and transfer function alone. It is
//! built once, and not once for a light ([`SharedBuffers`](crate::field::SharedBuffers)).
//!
//! The abstract and descriptions in later work were read, not the paper; everything below is our own choice:
//! * Sums are integers modulo 2^32. Differences are exact while a cuboid sums up to less than 2^32, whatever the sums
//!   of the table. Floats would cancel.
//! * A cell stores its extinction in whole steps ([`Quantization`]). Each cell is off by less than one step, and so the
//!   optical depth of a query by less than one step times the length of its ray in the table. Thresholds of rounding
//!   differ from cell to cell, so that errors of many cells cancel.
//! * Stretches end at faces of cells across the axis of the grid that is closest to the ray. Cuboids hold whole cells
//!   along this axis, and so a ray along an axis is integrated exactly up to the resolution of the table.
//! * The first cuboid is the layer of the point's cell. The factor from one thickness to the next is such that `boxes`
//!   cuboids cross the table.
//! * A cuboid contains the cone, as a beam with a square cross section of the same area, and is at least one cell wide.
//! * Across the ray, cuboids may end inside cells (`filter=bilinear`, 32 reads) or hold whole cells (`filter=nearest`,
//!   8 reads).
//! * With `angle=light`, one map answers for a whole light with a size. The cone widens to the angle of a sun, or to the
//!   radius of a disc at its distance. Lights wider than 120 degrees are sampled.
//! * The last voxels before a point are marched, as before queries of shadow maps (`near`).
//! * A cuboid has at most 2^20 cells of the table; a larger one is cut on its sides.

use super::keys::{LOOKUP_KEY, Lookups, NEAR_KEY, settings};
use super::lookup::Lookup;
use super::method::{BuildReport, Curve, Entry, Method, ShadowMap};
use super::none::test_space;
use super::settings::{Key, Value, choices};
use super::style::{Marker, Style};
use crate::error::Result;
use crate::field::{
    BuildContext, DeviceTransfer, LINE_THREADS, March, TileList, field_shader, line_of_workgroups,
};
use crate::gpu::{ShaderVariant, Slot, Span, StorageBuffer, uniform_buffer};
use crate::scene::Extent;
use bytemuck::{Pod, Zeroable};

choices! {
    /// Sides of the cuboids of a summed-area table, across the light ray.
    pub enum TableFilter {
        /// Moves the sides of cuboids to the nearest faces of cells.
        Nearest = "nearest",
        /// Interpolates between the faces of cells: cells that a cuboid covers in part count in part.
        Bilinear = "bilinear",
    }
}

settings! {
    /// Settings of a summed-area table of extinction.
    pub struct SummedAreaTable {
        /// Width of the cells of the table along each axis, in voxels.
        scale: f64 = Key::number([0.5, 8.0], "2", "width of the table's cells, in voxels").in_label().search(&["8", "6", "4", "3", "2", "1.5", "1"]),
        /// Number of cuboids that approximate the cone from a point to the light.
        boxes: u32 = Key::whole([2, 1024], "16", "cuboids between a point and the light").in_label().search(&["4", "8", "16", "32", "64"]),
        /// Opening angle of the cone from a point to the light, degrees; 0 for a beam one cell wide. `None`: the cone that
        /// contains the light.
        angle: Option<f64> = Key::number_or([0.0, MOST_ANGLE_DEG], "light", "light", "opening angle of the cone to the light, degrees; 0: a beam one cell wide; light: the size of the light"),
        /// Sides of the cuboids across the light ray: at the faces of cells, or anywhere.
        filter: TableFilter = Key::choice(TableFilter::NAMES, "bilinear", "sides of cuboids across the light: nearest faces of cells (8 reads), or between them (32 reads)").search_all(),
        /// Length of the march from a point towards the light before a query of the table, in smallest voxel spacings; 0
        /// for none.
        near: f64 = NEAR_KEY,
        /// Whether neighbouring samples of a camera ray share one transmittance query, or each makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "sat",
    summary: "summed-area table of extinction (Schlegel et al. 2011): cuboids along a cone, one build for all lights",
    keys: SummedAreaTable::KEYS,
    make: |values| Some(Box::new(SummedAreaTable::from_values(values)?)),
    compared: "sat:boxes=16,64",
    curve: "sat",
    stability: "sat:boxes=8,64,near=0",
    published: None,
    style: Style { color: [221, 204, 119], marker: Marker::Square },
};

/// Largest opening angle of a cone, degrees. Wider lights are sampled.
const MOST_ANGLE_DEG: f64 = 120.0;
/// Largest number of cells of a cuboid: a larger one is cut on its sides.
const MOST_CELLS: u64 = 1 << 20;
/// Largest number of steps of a cell. Float32 has three more bits.
const MOST_STEPS: u64 = 1 << 21;

/// Steps of the extinction that the cells of a summed-area table store.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Quantization {
    /// Largest number of steps of a cell.
    most_steps: u64,
    /// Largest number of cells of a cuboid.
    most_cells: u64,
    /// Extinction of one step, 1/mm.
    extinction: f64,
}

impl Quantization {
    /// Returns the finest steps for which no cuboid sums up to 2^32, in a table of `cells` cells with extinctions of up
    /// to `largest` (1/mm).
    fn new(cells: u64, largest: f64) -> Self {
        let most_cells = cells.clamp(1, MOST_CELLS);
        let most_steps = (u64::from(u32::MAX) / most_cells).min(MOST_STEPS);
        // The largest extinction may be rounded up.
        let extinction = if largest > 0.0 { largest / (most_steps - 1) as f64 } else { 1.0 };
        Self { most_steps, most_cells, extinction }
    }
}

/// Uniform buffer of a summed-area table and its queries; mirrors struct `SummedAreaTable` in
/// `shaders/shadow/sat/table.wgsl`.
#[repr(C)]
#[derive(Debug, Clone, Copy, Pod, Zeroable)]
struct TableParams {
    first: [f32; 3],
    scale: f32,
    counts: [u32; 3],
    extinction_step: f32,
    most_steps: f32,
    samples: u32,
    boxes: u32,
    growth: f32,
    half_tangent: f32,
    light_radius_mm: f32,
    most_cells: f32,
    padding: u32,
}

/// Returns the factor from the thickness of a cuboid to that of the next one, with which `boxes` of them, the first one
/// cell thick, cross `cells` cells.
fn growth(boxes: u32, cells: u32) -> f64 {
    let reach = |factor: f64| (0..boxes).map(|i| factor.powi(i as i32)).sum::<f64>();
    let [mut low, mut high] = [1.0, f64::from(cells.max(1))];
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if reach(middle) < f64::from(cells) {
            low = middle;
        } else {
            high = middle;
        }
    }
    if boxes < cells { high } else { 1.0 }
}

/// Returns the largest extinction of a volume under its transfer function, 1/mm; a gradient opacity only lowers it.
fn largest_extinction(context: &BuildContext<'_>) -> f64 {
    let DeviceTransfer { has_labels, .. } = context.transfer;
    let [min, max] = match has_labels {
        // The functions of labels lie side by side.
        true => [f64::NEG_INFINITY, f64::INFINITY],
        false => context.volume.value_range(),
    };
    let rounding = context.transfer.value_rounding();
    context.transfer.function().max_extinction(min - rounding, max + rounding)
}

impl SummedAreaTable {
    fn shader(entry: &'static str) -> ShaderVariant {
        field_shader(entry).modules(&["shadow/sat/table.wgsl"])
    }

    fn fill_shader() -> ShaderVariant {
        Self::shader("shadow/sat/fill.wgsl")
    }

    fn scan_shader() -> ShaderVariant {
        Self::shader("shadow/sat/scan.wgsl")
    }

    fn params(&self, context: &BuildContext<'_>) -> TableParams {
        let index_box = context.transfer.active.index_box(context.volume.dims()).unwrap_or_default();
        // Grid space numbers the voxels from 1.
        let [low, high] = index_box.map(|index| index + 1.0);
        let counts = ((high - low) / self.scale).ceil().as_uvec3().to_array().map(|n| n.max(1));
        let cells = counts.iter().map(|n| u64::from(*n)).product();
        let steps = Quantization::new(cells, largest_extinction(context));
        let [angle_deg, radius_mm] = match (self.angle, context.extent) {
            (Some(angle_deg), _) => [angle_deg, 0.0],
            (None, Extent::Cone { angle_deg }) => [*angle_deg, 0.0],
            (None, Extent::Disc { radius_mm, .. }) => [0.0, *radius_mm],
            (None, Extent::None | Extent::Map(_)) => [0.0; 2],
        };
        TableParams {
            first: low.as_vec3().to_array(),
            scale: self.scale as f32,
            counts,
            extinction_step: steps.extinction as f32,
            most_steps: steps.most_steps as f32,
            samples: (2.0 * self.scale).ceil() as u32,
            boxes: self.boxes,
            growth: growth(self.boxes, counts.into_iter().max().unwrap_or(1)) as f32,
            half_tangent: (0.5 * angle_deg).to_radians().tan() as f32,
            light_radius_mm: radius_mm as f32,
            most_cells: steps.most_cells as f32,
            padding: 0,
        }
    }

    /// Computes the summed-area table: the steps of each cell, and three sums along lines, one for each axis.
    fn sums(
        context: &BuildContext<'_>,
        params: &wgpu::Buffer,
        [x, y, z]: [u32; 3],
    ) -> Result<(wgpu::Buffer, Span)> {
        let (gpu, kernels) = (context.gpu(), context.kernels);
        let bytes = 4 * u64::from(x) * u64::from(y) * u64::from(z);
        let sums = StorageBuffer::zeroed(gpu, "summed-area table", bytes)
            .map_err(|e| e.hint("a larger scale has fewer cells"))?;
        let group = kernels.group("summed-area table", &[(1, kernels.uniform(params))]);
        let layers: Vec<u32> = (0..z).collect();
        let entries = StorageBuffer::from_slice(gpu, "layers of a summed-area table", &layers)?;
        let list = TileList { entries: &entries, count: z, workgroups: (x * y).div_ceil(LINE_THREADS) };
        let stage = [(1, Slot::read_write(sums.as_entire_binding()))];
        let (filled, _) =
            context.run_over(list, "extinction of cells", &Self::fill_shader(), &group, &stage, None)?;
        // The shader turns the axes in cyclic order.
        let steps = [(0_u32, y * z), (1, z * x), (2, x * y)].map(|(axis, lines)| {
            let axis = uniform_buffer(gpu, "axis of sums", &axis);
            let stage =
                [(0, Slot::read(axis.as_entire_binding())), (1, Slot::read_write(sums.as_entire_binding()))];
            (kernels.group("axis of sums", &stage), line_of_workgroups(lines as usize))
        });
        let summed = context.run_steps("sums of extinction", &Self::scan_shader(), &group, &steps)?;
        Ok((sums, filled.plus(summed)))
    }
}

impl Method for SummedAreaTable {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn lookup(&self) -> Option<Lookup> {
        let shader = Self::shader("").modules(&["shadow/sat/lookup.wgsl"]);
        let shader = shader.defs((self.filter == TableFilter::Bilinear).then_some("BILINEAR"));
        Some(Lookup::new(shader).with_near(self.near).with_lookup_mode(self.lookup))
    }

    fn covers(&self, size: &Extent) -> bool {
        let has_cone = match size {
            Extent::Cone { angle_deg } => *angle_deg <= MOST_ANGLE_DEG,
            Extent::Map(_) => false,
            Extent::None | Extent::Disc { .. } => true,
        };
        self.angle.is_none() && has_cone
    }

    fn curve(&self) -> Curve {
        Curve::Stays
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        vec![Self::fill_shader(), Self::scan_shader()]
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        // Sums read the cells of the first pass.
        let context = &context.at_once();
        let params = self.params(context);
        let uniform = uniform_buffer(context.gpu(), "summed-area table", &params);
        let key = (ENTRY.name, self.scale.to_bits());
        let make = || Self::sums(context, &uniform, params.counts);
        let (sums, device) = context.transfer.shared().get_or_make(key, make)?;
        let mut light_space = test_space(context, March::Cells);
        light_space.near_mm = self.near * context.volume.min_spacing_mm();
        let light = context.light_uniform(&light_space);
        let kernels = context.kernels;
        let slots = [
            (0, kernels.uniform(&light)),
            (1, kernels.uniform(&uniform)),
            (2, Slot::read(sums.as_entire_binding())),
        ];
        let bytes = sums.size();
        Ok(ShadowMap {
            method: ENTRY.name,
            group: kernels.group("summed-area table", &slots),
            lookup: self.lookup(),
            light_space,
            report: BuildReport { device, bytes, bytes_used: bytes, is_shared: true, ..Default::default() },
            bound: None,
            enclosure: None,
            sections: None,
            _pool: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gpu::assert_layout;

    #[test]
    fn uniforms_have_one_layout() {
        assert_layout!(&SummedAreaTable::fill_shader(), "SummedAreaTable", TableParams: first, scale, counts,
            extinction_step, most_steps, samples, boxes, growth, half_tangent,
            light_radius_mm, most_cells);
    }

    #[test]
    fn cuboids_cross_the_table() {
        for (boxes, cells) in [(2, 1), (2, 50), (8, 100), (16, 128), (16, 512), (64, 64), (64, 20)] {
            let factor = growth(boxes, cells);
            let reach: f64 = (0..boxes).map(|i| factor.powi(i as i32)).sum();
            assert!(reach > f64::from(cells) - 1e-6, "{boxes}, {cells}: {factor}");
            assert!(boxes < cells || factor == 1.0, "{boxes}, {cells}: {factor}");
        }
    }

    #[test]
    fn no_cuboid_sums_up_to_more_than_32_bits() {
        for cells in [1, 1000, MOST_CELLS, 1 << 27] {
            let steps = Quantization::new(cells, 3.0);
            assert!(steps.most_steps * cells.min(MOST_CELLS) < 1 << 32, "{steps:?}");
            // The largest extinction has 4094 steps at least.
            assert!(steps.extinction <= 3.0 / 4094.0, "{steps:?}");
        }
        assert_eq!(Quantization::new(8, 0.0).extinction, 1.0);
    }
}
