//! Rules by which `dom` and `bom` shadow maps divide the depth range of a texel into layers. Some rules derive a
//! ratio of linear to logarithmic layers from the volume before the build.

use super::ratio::{self, Measure, REGION_TEXELS, all_splits, choose, choose_by_region, hybrid};
use super::{Built, LayeredMap, NO_DEPTH_PASS, Split};
use crate::error::Result;
use crate::field::{BuildContext, MapShape, TileMarch};
use crate::gpu::ShaderVariant;
use crate::shadow::method::PassLeftOut;
use crate::shadow::settings::{Key, When, choices};

choices! {
    /// Rule that divides the depth range of a texel into the layers of a deep or bounding opacity map.
    pub enum LayerSplit {
        /// Divides the depth range of a texel into layers of equal thickness.
        Linear = "linear",
        /// Makes the k-th layer of the shadow map k times as thick as the first.
        Growing = "growing",
        /// Places layers evenly in the logarithm of depth, so that the first layers are the thinnest.
        Log = "log",
        /// Blends linear and logarithmic layer spacing by the weight in the setting `ratio`.
        Hybrid = "hybrid",
        /// Blends linear and logarithmic layer spacing by one weight, chosen automatically for the whole shadow map.
        Auto = "auto",
        /// Blends linear and logarithmic layer spacing by a weight chosen automatically for each region of the shadow
        /// map.
        Texel = "texel",
    }
}

/// Returns the description of the setting `split` (rule that divides a texel's depth range into layers) with a shadow
/// method's default value.
pub const fn split_key(default: &'static str) -> Key {
    Key::choice(
        LayerSplit::NAMES,
        default,
        "division of the depth range into layers; auto and texel choose the ratio, for the map or by region",
    )
    .search_all()
}

pub const RATIO_KEY: Key =
    Key::number([0.0, 1.0], "0.5", "blend from linear (0) to logarithmic (1) division (split=hybrid)")
        .in_label()
        .search(&["0", "0.25", "0.5", "0.75", "1"])
        .when(When::Is("split", "hybrid"));

pub const LOG_SIZE_KEY: Key = Key::number(
    [2.0, 65536.0],
    "256",
    "logarithms are taken over the interval from 1 to this number (not for split=linear or growing)",
)
.when(When::UnlessAny(&[("split", "linear"), ("split", "growing")]));

pub const MEASURE_KEY: Key = Key::choice(
    Measure::NAMES,
    "correlation",
    "criterion of the ratio: smallest correlation or largest difference of neighbouring layers (split=auto)",
)
.when(When::Is("split", "auto"));

const NO_SEARCH: PassLeftOut =
    PassLeftOut { what: "search for the ratio", why: "a single layer is not split", optional: None };

/// Number of layers of a deep or bounding opacity map, and the rule that divides depth into them.
#[derive(Debug, Clone, Copy)]
pub struct Layering {
    pub layers: u32,
    pub split: LayerSplit,
    pub ratio: f64,
    pub log_size: f64,
    pub measure: Measure,
}

impl Layering {
    /// Returns the division of depth into layers; `None` if the ratio of linear to logarithmic layers must be
    /// searched first.
    fn plain(&self) -> Option<Split> {
        match self.split {
            LayerSplit::Linear => Some(Split::Power(1.0)),
            LayerSplit::Growing => Some(Split::Growing),
            LayerSplit::Log => Some(Split::Tables(vec![hybrid(1.0, self.log_size)])),
            LayerSplit::Hybrid => Some(Split::Tables(vec![hybrid(self.ratio, self.log_size)])),
            LayerSplit::Auto | LayerSplit::Texel => (self.layers == 1).then_some(Split::Power(1.0)),
        }
    }

    /// Whether the division into layers is known before the build.
    pub fn is_fixed(&self) -> bool {
        self.plain().is_some()
    }

    /// Whether each texel of the shadow map stores the index of its own division into layers.
    pub fn by_texel(&self) -> bool {
        self.split == LayerSplit::Texel && self.layers > 1
    }

    /// Returns a division of depth into layers that selects the same shaders as the division of the later build.
    pub fn any(&self) -> Split {
        self.plain().unwrap_or(Split::Tables(Vec::new()))
    }

    /// Returns every shader pass that a build of a layered shadow map may run.
    pub fn passes(&self, layered_map: &LayeredMap) -> Vec<ShaderVariant> {
        let mut passes = vec![layered_map.build_shader(), super::depth_pass_shader(layered_map.shape.march)];
        passes.extend(ratio::shaders(layered_map));
        passes
    }

    /// Builds a layered shadow map (`dom` or `bom`), and first chooses its division of depth into layers if the
    /// settings ask for it.
    ///
    /// # Errors
    /// A shadow map that is too large for the graphics adapter.
    pub fn build<'a>(
        &self,
        context: &BuildContext<'a>,
        layered_map: impl Fn(Split) -> LayeredMap,
    ) -> Result<Built<'a>> {
        let mut shape = layered_map(self.any()).shape;
        if self.split == LayerSplit::Texel {
            // The coarse map of regions must cover the same area as the final map.
            let least = REGION_TEXELS * MapShape::LEAST_WITH_BORDER;
            shape.fits_view &= shape.texels.is_none_or(|texels| texels >= least);
        }
        let tiles = TileMarch::fit(context, shape)?;
        let (mut choice, mut regions, mut search) = (None, None, None);
        let split = match (self.plain(), self.split) {
            (Some(split), _) => split,
            (None, LayerSplit::Texel) => {
                let (rows, costs) = choose_by_region(
                    context,
                    &layered_map(self.any()),
                    self.log_size,
                    tiles.light_space.map_size,
                )?;
                (regions, search) = (Some(rows), Some(costs));
                Split::Tables(all_splits(self.log_size))
            }
            (None, _) => {
                let (row, chosen, costs) =
                    choose(context, &layered_map(self.any()), self.log_size, self.measure)?;
                let (ratio, correlation) = (chosen.ratio, chosen.correlation);
                tracing::info!(
                    "split: ratio {ratio:.1}, correlation {correlation:.4} over {} layers",
                    self.layers
                );
                (choice, search) = (Some(chosen), Some(costs));
                Split::Tables(vec![all_splits(self.log_size).swap_remove(row as usize)])
            }
        };
        let mut built = layered_map(split).build(context, tiles, regions.as_ref())?;
        built.after(search);
        built.report.split_choice = choice;
        if matches!(self.split, LayerSplit::Auto | LayerSplit::Texel) && search.is_none() {
            built.report.passes_left_out = match built.report.passes_left_out {
                [] => &[NO_SEARCH],
                _ => &[NO_DEPTH_PASS, NO_SEARCH],
            };
        }
        Ok(built)
    }
}
