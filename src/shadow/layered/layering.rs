//! How the layers of `dom` and `bom` share the extent of a texel, and a build that may have to choose it first.

use super::ratio::{self, Measure, REGION_TEXELS, all_splits, choose, choose_by_region, hybrid};
use super::{Built, NO_DEPTH_PASS, Recipe, Split};
use crate::error::Result;
use crate::field::{BuildContext, MapShape, TileMarch};
use crate::gpu::ShaderVariant;
use crate::shadow::method::PassLeftOut;
use crate::shadow::settings::{Key, When, choices};

choices! {
    /// How layers share a texel's extent.
    pub enum LayerSplit {
        /// Evenly.
        Linear = "linear",
        /// The k-th layer is k times as thick as the first.
        Growing = "growing",
        /// By the logarithm of the depth.
        Log = "log",
        /// Between linear and logarithmic.
        Hybrid = "hybrid",
        /// By the hybrid ratio that suits the whole map.
        Auto = "auto",
        /// By the hybrid ratio that suits each region.
        Texel = "texel",
    }
}

/// The key of the split; the methods differ in its default.
pub const fn split_key(default: &'static str) -> Key {
    Key::choice(
        LayerSplit::NAMES,
        default,
        "how layers share the extent; auto and texel choose the ratio, for all or by region",
    )
    .search_all()
}

pub const RATIO_KEY: Key = Key::number([0.0, 1.0], "0.5", "from linear to log (split=hybrid)")
    .in_label()
    .search(&["0", "0.25", "0.5", "0.75", "1"])
    .when(When::Is("split", "hybrid"));

pub const LOG_SIZE_KEY: Key = Key::number(
    [2.0, 65536.0],
    "256",
    "logarithms go over the interval from 1 to this (all splits but linear and growing)",
)
.when(When::Unless("split", "linear"));

pub const MEASURE_KEY: Key = Key::choice(
    Measure::NAMES,
    "correlation",
    "least correlation or greatest difference between neighbouring layers (split=auto)",
)
.when(When::Is("split", "auto"));

const NO_SEARCH: PassLeftOut =
    PassLeftOut { what: "search for the ratio", why: "a single layer is not split", optional: None };

/// How many layers share an extent, and how.
#[derive(Debug, Clone, Copy)]
pub struct Layering {
    pub layers: u32,
    pub split: LayerSplit,
    pub ratio: f64,
    pub log_size: f64,
    pub measure: Measure,
}

impl Layering {
    /// The split where nothing has to be chosen.
    fn plain(&self) -> Option<Split> {
        match self.split {
            LayerSplit::Linear => Some(Split::Power(1.0)),
            LayerSplit::Growing => Some(Split::Growing),
            LayerSplit::Log => Some(Split::Tables(vec![hybrid(1.0, self.log_size)])),
            LayerSplit::Hybrid => Some(Split::Tables(vec![hybrid(self.ratio, self.log_size)])),
            LayerSplit::Auto | LayerSplit::Texel => (self.layers == 1).then_some(Split::Power(1.0)),
        }
    }

    /// Whether texels state the row of their own split.
    pub fn by_texel(&self) -> bool {
        self.split == LayerSplit::Texel && self.layers > 1
    }

    /// The split as far as shaders go.
    pub fn any(&self) -> Split {
        self.plain().unwrap_or(Split::Tables(Vec::new()))
    }

    /// Every pass that a build with such a recipe may run.
    pub fn passes(&self, recipe: &Recipe) -> Vec<ShaderVariant> {
        let mut passes = vec![recipe.build_shader(), super::depth_pass_shader(recipe.shape.march)];
        passes.extend(ratio::shaders(recipe));
        passes
    }

    /// Builds a map, whose split may have to be chosen first.
    ///
    /// # Errors
    /// A map that the adapter cannot hold.
    pub fn build<'a>(
        &self,
        context: &BuildContext<'a>,
        recipe: impl Fn(Split) -> Recipe,
    ) -> Result<Built<'a>> {
        let mut shape = recipe(self.any()).shape;
        if self.split == LayerSplit::Texel {
            // The map of its regions has to be able to cover the same.
            let least = REGION_TEXELS * MapShape::LEAST_WITH_BORDER;
            shape.fits_view &= shape.texels.is_none_or(|texels| texels >= least);
        }
        let tiles = TileMarch::fit(context, shape)?;
        let (mut choice, mut regions, mut search) = (None, None, None);
        let split = match (self.plain(), self.split) {
            (Some(split), _) => split,
            (None, LayerSplit::Texel) => {
                let (rows, took) = choose_by_region(
                    context,
                    &recipe(self.any()),
                    self.log_size,
                    tiles.light_space.map_size,
                )?;
                (regions, search) = (Some(rows), Some(took));
                Split::Tables(all_splits(self.log_size))
            }
            (None, _) => {
                let (row, chosen, took) = choose(context, &recipe(self.any()), self.log_size, self.measure)?;
                let (ratio, correlation) = (chosen.ratio, chosen.correlation);
                tracing::info!(
                    "split: ratio {ratio:.1}, correlation {correlation:.4} over {} layers",
                    self.layers
                );
                (choice, search) = (Some(chosen), Some(took));
                Split::Tables(vec![all_splits(self.log_size).swap_remove(row as usize)])
            }
        };
        let mut built = recipe(split).build(context, tiles, regions.as_ref())?;
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
