//! Choices that make shaders fast on one type of graphics adapter, in one place, and limits on shader loops that
//! software adapters require. `shaders/field/tuning.wgsl` is the counterpart in the shaders.
//!
//! Pictures and shadow maps depend on `coarse_filter` and `card_arithmetic` alone. `UMBRAVOX_TUNING` replaces some of them, to measure each
//! on its own.

use crate::error::{Error, Result};

/// Largest number of regular samples along a light ray. A sample takes up to 8 loop iterations; llvmpipe ends the
/// loops of a shader invocation after 65,536 iterations in all, without an error. Like the next two limits, this one
/// applies on every adapter, so that pictures do not depend on the adapter.
pub const MAX_LIGHT_SAMPLES: u32 = 8192;
/// Largest number of regular samples along a shadow ray. One dispatch casts up to eight of them for a pixel, and a sample
/// takes about 3 loop iterations.
pub const MAX_RAY_SAMPLES: u32 = 2048;
/// Largest number of equal depth steps, summed over all light rays through one texel of a deep shadow map. A step
/// takes about 6 loop iterations.
pub const MAX_LATTICE_STEPS: u32 = 4096;
/// Largest number of equal depth steps, summed over all light rays through one texel of a deep shadow map, if each
/// step is marched cell by cell. This takes about 12 further loop iterations per step.
pub const MAX_LATTICE_MARCHES: u32 = 3000;

/// Name of the environment variable that replaces choices of [`Tuning`].
const VARIABLE: &str = "UMBRAVOX_TUNING";
/// Side of a square block of tiles whose tiles follow a Z-order curve ([`WorkOrder::Blocks`]).
pub const BLOCK_SIDE: u32 = 8;

/// Order in which the workgroups of a pass process tiles of a picture or of a shadow map.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum WorkOrder {
    /// Spreads neighbouring tiles over up to 16 contiguous parts of the order. Software adapters give each thread one
    /// such part, and neighbouring tiles cost alike.
    Spread,
    /// Follows a Z-order curve inside square blocks of tiles, block after block. Workgroups that run at the same time
    /// then read neighbouring voxels, which a graphics card keeps in its caches.
    Blocks,
}

/// Choices that make shaders fast on one type of graphics adapter. Only `coarse_filter` and `card_arithmetic` change results.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub struct Tuning {
    /// Number of steps of an eye ray after which lanes of a subgroup that have hit extinction no longer wait for the
    /// other lanes. Waiting lanes query the shadow map together. On llvmpipe, 4 is the best of 2, 4 and no limit; on an
    /// H100, frames of `dsm` take 0.5 to 0.6 times as many clock cycles with 4 as with 1 (`benches/NOTES.md`).
    pub eye_steps_together: u32,
    /// Number of steps of a light ray, marched cell by cell, after which lanes that have hit extinction no longer wait. In
    /// a lock-step model of 32 lanes, they are busy for 42 % of all steps with 4, and for 73 % with 1; on an H100 the
    /// difference is within the noise.
    pub light_steps_together: u32,
    /// Whether the march of light rays loads the values of a cell before it knows whether the cell's brick is empty. A
    /// subgroup then waits for one texture read in each step instead of two; software adapters do not overlap reads.
    pub early_loads: bool,
    /// Side of a workgroup in passes over shadow-map tiles, in texels. With 8, a subgroup of 32 lanes is a block of 8
    /// x 4 texels; with 16, it is 16 x 2, whose rays diverge more.
    pub workgroup_side: u32,
    /// Order in which workgroups process tiles of a picture or of a shadow map.
    pub order: WorkOrder,
    /// Whether a pass on the device projects bricks into the picture, instead of the host: for large volumes the host
    /// takes milliseconds, and software adapters run on the host anyway.
    pub device_tiles: bool,
    /// Whether the build of a shadow map in a window is submitted with the picture that needs it. This needs device
    /// timestamps: the host's clock cannot tell the build from the picture.
    pub joint_submission: bool,
    /// Whether shaders read the table of transfer-function intervals as a storage buffer. Graphics cards read a
    /// uniform once for each different index in a subgroup; software adapters read storage buffers lane by lane.
    pub storage_tables: bool,
    /// Whether shaders read the uniforms of bind groups 1 and 2 as storage buffers. llvmpipe compiles uniform values
    /// into its code, which takes hundreds of milliseconds after each change (see [`Kernels::new`](super::Kernels)).
    pub storage_uniforms: bool,
    /// Whether a workgroup adds up its counters in workgroup memory, so that one thread adds them to those of the pass.
    /// llvmpipe runs workgroups with barriers more slowly.
    pub workgroup_sums: bool,
    /// Whether wgpu adds a limit of 2^64 iterations to each shader loop. All loops have limits of their own
    /// ([`DeviceCounters`](super::DeviceCounters)).
    pub bounded_loops: bool,
    /// Whether texture sides avoid powers of two: llvmpipe recompiles a shader, for half a second, when a side becomes
    /// a power of two or ceases to be one. Sides of shadow maps change while the camera moves.
    pub odd_textures: bool,
    /// Whether the texture filter has weights of 8 bits, as graphics cards do. Shaders then interpolate in float32 where
    /// an eye ray meets an opaque surface.
    pub coarse_filter: bool,
    /// Whether samples and quotients have the errors of graphics cards, for tests on software adapters: filter weights
    /// of 8 bits, and divisions that are not rounded correctly.
    pub card_arithmetic: bool,
}

impl Tuning {
    /// Choices for software adapters, which run on the processor (llvmpipe, SwiftShader).
    pub const SOFTWARE: Self = Self {
        eye_steps_together: 4,
        light_steps_together: 4,
        early_loads: false,
        workgroup_side: 16,
        order: WorkOrder::Spread,
        device_tiles: false,
        joint_submission: false,
        storage_tables: false,
        storage_uniforms: false,
        workgroup_sums: false,
        bounded_loops: true,
        odd_textures: true,
        coarse_filter: false,
        card_arithmetic: false,
    };
    /// Choices for graphics cards.
    pub const CARD: Self = Self {
        eye_steps_together: 4,
        light_steps_together: 1,
        early_loads: true,
        workgroup_side: 8,
        order: WorkOrder::Blocks,
        device_tiles: true,
        joint_submission: true,
        storage_tables: true,
        storage_uniforms: false,
        workgroup_sums: true,
        bounded_loops: false,
        odd_textures: false,
        coarse_filter: true,
        card_arithmetic: false,
    };

    /// Returns the choices for a graphics adapter. The environment variable `UMBRAVOX_TUNING` replaces some of them.
    ///
    /// # Errors
    /// The variable has an unknown name or value.
    pub(super) fn of(info: &wgpu::AdapterInfo) -> Result<Self> {
        let own = if info.device_type == wgpu::DeviceType::Cpu { Self::SOFTWARE } else { Self::CARD };
        own.with_environment()
    }

    /// Replaces choices by those of the environment variable `UMBRAVOX_TUNING`.
    ///
    /// # Errors
    /// The variable has an unknown name or value.
    pub fn with_environment(self) -> Result<Self> {
        std::env::var(VARIABLE).map_or(Ok(self), |text| self.with(&text))
    }

    /// Replaces choices by those of a text such as `card,light_steps=2,tables=uniform`, from left to right. `card` and
    /// `software` replace all choices.
    ///
    /// # Errors
    /// The text has an unknown name or value.
    pub fn with(mut self, text: &str) -> Result<Self> {
        for item in text.split(',').map(str::trim).filter(|item| !item.is_empty()) {
            match item {
                "software" => self = Self::SOFTWARE,
                "card" => self = Self::CARD,
                "eye_steps=1" => self.eye_steps_together = 1,
                "eye_steps=2" => self.eye_steps_together = 2,
                "eye_steps=4" => self.eye_steps_together = 4,
                "eye_steps=8" => self.eye_steps_together = 8,
                "light_steps=1" => self.light_steps_together = 1,
                "light_steps=2" => self.light_steps_together = 2,
                "light_steps=4" => self.light_steps_together = 4,
                "light_steps=8" => self.light_steps_together = 8,
                "loads=late" => self.early_loads = false,
                "loads=early" => self.early_loads = true,
                "workgroup=8" => self.workgroup_side = 8,
                "workgroup=16" => self.workgroup_side = 16,
                "order=spread" => self.order = WorkOrder::Spread,
                "order=blocks" => self.order = WorkOrder::Blocks,
                "tiles=host" => self.device_tiles = false,
                "tiles=device" => self.device_tiles = true,
                "builds=alone" => self.joint_submission = false,
                "builds=joint" => self.joint_submission = true,
                "tables=uniform" => self.storage_tables = false,
                "tables=storage" => self.storage_tables = true,
                "sums=pass" => self.workgroup_sums = false,
                "sums=workgroup" => self.workgroup_sums = true,
                "loops=bounded" => self.bounded_loops = true,
                "loops=own" => self.bounded_loops = false,
                "filter=fine" => self.coarse_filter = false,
                "filter=coarse" => self.coarse_filter = true,
                "arithmetic=own" => self.card_arithmetic = false,
                "arithmetic=card" => self.card_arithmetic = true,
                _ => {
                    let why = format!("`{item}` is not a choice");
                    return Err(Error::input("cannot tune shaders", VARIABLE, why).hint(
                        "card, software, eye_steps=1|2|4|8, light_steps=1|2|4|8, loads=late|early, workgroup=8|16, order=spread|blocks, tiles=host|device, \
                         builds=alone|joint, tables=uniform|storage, sums=pass|workgroup, \
                         loops=bounded|own, filter=fine|coarse, arithmetic=own|card",
                    ));
                }
            }
        }
        Ok(self)
    }

    /// Returns the names that these choices define for `#ifdef` in WGSL.
    pub(super) fn defs(&self) -> impl Iterator<Item = &'static str> {
        let defs = [
            (self.order == WorkOrder::Spread, "SPREAD_WORKGROUPS"),
            (self.early_loads, "EARLY_LOADS"),
            (self.workgroup_sums, "WORKGROUP_SUMS"),
            (self.coarse_filter, "COARSE_WEIGHTS"),
            (self.card_arithmetic, "CARD_ARITHMETIC"),
        ];
        defs.into_iter().filter_map(|(on, name)| on.then_some(name))
    }

    /// Returns the constants of these choices, to which WGSL code refers as `#{NAME}`.
    pub(super) fn constants(&self) -> [(&'static str, u32); 3] {
        [
            ("EYE_STEPS_TOGETHER", self.eye_steps_together),
            ("LIGHT_STEPS_TOGETHER", self.light_steps_together),
            ("WORKGROUP_SIDE", self.workgroup_side),
        ]
    }
}

impl WorkOrder {
    /// Returns the positions of a grid of tiles, in the order in which their workgroups are listed. `Spread` lists
    /// rows; `spread_rows` and `workgroup_item` in the shaders spread them.
    pub fn positions(self, [across, down]: [u32; 2]) -> impl Iterator<Item = [u32; 2]> {
        let side = if self == Self::Blocks { BLOCK_SIDE } else { 1 };
        let [columns, rows] = [across, down].map(|n| n.div_ceil(side));
        let blocks = (0..rows).flat_map(move |y| (0..columns).map(move |x| [x * side, y * side]));
        let inside = move |[x, y]: [u32; 2]| {
            (0..side * side).map(move |i| {
                let bit = |k: u32| (i >> k) & 1;
                let [u, v] = [0, 1].map(|k| bit(k) | bit(k + 2) << 1 | bit(k + 4) << 2);
                [x + u, y + v]
            })
        };
        blocks.flat_map(inside).filter(move |[x, y]| *x < across && *y < down)
    }

    /// Reorders rows of workgroups with [`Self::Spread`], so that each of up to 16 threads gets rows from all parts of
    /// the picture, like `workgroup_item` in the shaders.
    pub fn spread_rows(self, rows: &mut [u32]) {
        if self == Self::Spread {
            rows.sort_by_key(|y| (*y as u8 & 15).reverse_bits());
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_replace_choices_from_left_to_right() {
        let changed = Tuning::CARD.with("software, light_steps=2,tables=storage").unwrap();
        assert_eq!(changed, Tuning { light_steps_together: 2, storage_tables: true, ..Tuning::SOFTWARE });
        assert_eq!(Tuning::SOFTWARE.with("").unwrap(), Tuning::SOFTWARE);
        for bad in ["eye_steps=3", "fast", "order", "tables=uniform;card"] {
            let error = Tuning::CARD.with(bad).unwrap_err();
            assert!(error.exit_status() == 2 && error.to_string().contains("UMBRAVOX_TUNING"), "{error}");
        }
    }

    #[test]
    fn an_order_lists_every_tile_once() {
        for size in [[1, 1], [8, 8], [9, 3], [33, 17]] {
            for order in [WorkOrder::Spread, WorkOrder::Blocks] {
                let mut all: Vec<_> = order.positions(size).collect();
                all.sort_unstable();
                all.dedup();
                assert_eq!(all.len() as u32, size[0] * size[1]);
                assert!(all.iter().all(|[x, y]| *x < size[0] && *y < size[1]));
            }
        }
        let first: Vec<_> = WorkOrder::Blocks.positions([16, 16]).take(8).collect();
        assert_eq!(first, [[0, 0], [1, 0], [0, 1], [1, 1], [2, 0], [3, 0], [2, 1], [3, 1]]);
    }
}
