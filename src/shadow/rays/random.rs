//! Random estimates of the transmittance of shadow rays: control extinctions and majorants of the bricks, and the shader
//! code of the estimators.

use super::{Estimator, ShadowRays};
use crate::error::Result;
use crate::field::{BuildContext, DeviceTransfer, March, field_shader};
use crate::gpu::tuning::MAX_RAY_SAMPLES;
use crate::gpu::{Constant, ShaderVariant, Slot, StorageBuffer};
use crate::shadow::lookup::{Lookup, RANDOM_RAYS};
use crate::shadow::method::{BuildReport, Method as _, ShadowMap};
use crate::shadow::none::without_map;
use crate::volume::Bricks;
use rayon::prelude::*;

/// Factor by which majorants exceed the largest extinction of a brick, because the device rounds values to float32.
const ROUNDING: f64 = 1.0 + 1e-6;

impl ShadowRays {
    /// Returns the shader code of a transmittance query by the estimator.
    pub(super) fn random_lookup(&self) -> Lookup {
        let estimate = match self.estimator {
            Estimator::Ratio | Estimator::Residual => "shadow/rays/tracking.wgsl",
            _ => "shadow/rays/ray_marching.wgsl",
        };
        let shader: ShaderVariant = field_shader("")
            .modules(&[RANDOM_RAYS, estimate])
            .constants(&[Constant::float("MAX_RAY_SAMPLES", MAX_RAY_SAMPLES as f32)]);
        let shader = shader.defs((self.estimator == Estimator::Jackknife).then_some("JACKKNIFE"));
        Lookup::new(shader).with_linear_light().with_lookup_mode(self.lookup)
    }

    /// Builds the shadow data of the estimator: the control extinction and the majorant of each brick.
    ///
    /// # Errors
    /// The graphics adapter cannot bind a buffer of that size.
    pub(super) fn build_random(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let map = without_map(self, context, March::Cells);
        let bricks = context.volume.bricks();
        let extinctions = match self.estimator {
            // The shader does not read them; an array has one element at least.
            Estimator::Jackknife => vec![[0; 2]],
            _ => brick_extinctions(bricks, context.transfer, self.estimator == Estimator::Residual),
        };
        let [x, y, _] = bricks.counts.map(|n| n as u32);
        // Struct `RandomRays` in `shaders/shadow/rays/random_rays.wgsl`.
        let head = [[self.seed, self.samples], [x, y]];
        let words: Vec<[u32; 2]> = head.into_iter().chain(extinctions).collect();
        let bytes = size_of_val(words.as_slice()) as u64;
        let words = StorageBuffer::from_slice(context.gpu(), "random rays", &words)?;
        let light = context.light_uniform(&map.light_space);
        let slots = [(0, context.kernels.uniform(&light)), (1, Slot::read(words.as_entire_binding()))];
        let group = context.kernels.group("random rays", &slots);
        let report = BuildReport { bytes, bytes_used: bytes, ..BuildReport::default() };
        Ok(ShadowMap { group, lookup: self.lookup(), report, ..map })
    }
}

/// Returns for each brick (block of voxel cells) its control extinction and the largest extinction above it, 1/mm, as the
/// bits of float32. Control extinctions are the least extinction of the brick, or 0 without `has_control`.
fn brick_extinctions(bricks: &Bricks, transfer: &DeviceTransfer, has_control: bool) -> Vec<[u32; 2]> {
    let (tf, rounding) = (transfer.function(), transfer.value_rounding());
    let shifts = &transfer.label_shifts;
    let range = |brick: usize| {
        let of = |shift: f64| {
            let [min, max] = bricks.range(brick);
            let [min, max] = [min - rounding, max + rounding].map(|v| v + shift);
            tf.extinction_bounds(min, max)
        };
        let Some(labels) = bricks.labels.as_ref().filter(|_| !shifts.is_empty()) else { return of(0.0) };
        let present = shifts.iter().enumerate().filter(|(rank, _)| labels.sets[brick].has(*rank));
        let ranges = present.map(|(_, shift)| shift.map_or([0.0; 2], of));
        ranges.reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]).unwrap_or_default()
    };
    let distances = transfer.active.distance.par_iter().enumerate();
    distances
        .map(|(brick, distance)| {
            let [least, largest] = if *distance == 0 { range(brick) } else { [0.0; 2] };
            // A gradient opacity may lower the extinction to 0 anywhere.
            let control = if has_control && !transfer.has_gradient_opacity { least } else { 0.0 };
            [control, ROUNDING * largest - control].map(|extinction| (extinction as f32).to_bits())
        })
        .collect()
}
