//! Settings (keys) that several shadow methods share, with the types of their values.

use super::filter::Filter;
use super::settings::{Key, When, choices};
use crate::field::{MapShape, March};

choices! {
    /// Way in which light rays are marched: cell by cell with exact integrals, or by samples at regular distances.
    pub enum MarchBy {
        /// Marches light rays cell by cell and integrates each cell exactly.
        Cells = "cells",
        /// Marches light rays by samples at regular distances.
        Samples = "samples",
    }
}

impl MarchBy {
    /// Returns how light rays are marched: cell by cell, or by regular samples at distance `step`, in units of the
    /// smallest voxel spacing.
    pub fn with_step(self, step: f64) -> March {
        match self {
            Self::Cells => March::Cells,
            Self::Samples => March::Samples { step },
        }
    }
}

choices! {
    /// Geometry from which a shadow map is built: the voxels of the volume, or the strands (line segments of hair or
    /// fibres) from which the volume was made.
    pub enum DrawnFrom {
        /// Builds the shadow map from the voxels of the volume.
        Voxels = "voxels",
        /// Builds the shadow map from the line segments of the strands that the volume was made from.
        Lines = "lines",
    }
}

impl DrawnFrom {
    /// Returns the way in which a light ray meets the shadow-casting geometry: cell by cell, by samples `step`
    /// smallest voxel spacings apart, or as drawn strands.
    pub fn march(self, march: MarchBy, step: f64) -> March {
        match self {
            Self::Voxels => march.with_step(step),
            Self::Lines => March::Lines,
        }
    }

    /// Returns the length of the march before a query of the shadow map, in smallest voxel spacings: `near`, or 0
    /// for strands, which are thinner than voxels.
    pub fn near(self, near: f64) -> f64 {
        if self == Self::Lines { 0.0 } else { near }
    }
}

/// Name of the setting that selects the geometry (voxels or strands) from which a shadow map is built.
pub(super) const FROM: &str = "from";
/// Condition under which some settings of a shadow method have an effect: voxels cast the shadows, not strands
/// (`from=lines`).
pub(super) const UNLESS_LINES: When = When::Unless(FROM, "lines");
/// Setting `from`: geometry (voxels or strands) from which a shadow map is built.
pub(super) const FROM_KEY: Key = Key::choice(
    DrawnFrom::NAMES,
    "voxels",
    "what casts shadows: the voxels, or the strands themselves, drawn into the map",
);

/// Name of the setting for the number of shadow map texels per side.
pub(super) const MAP: &str = "map";
/// Name of the setting for the distance of the nodes of a light volume.
pub(super) const SCALE: &str = "scale";
/// Setting `map`: number of shadow map texels per side.
pub(super) const MAP_KEY: Key = Key::whole_or(
    [1, 8192],
    "auto",
    "auto",
    "texels per side of the map; auto: about one voxel each, or finer in a close view",
)
.search(&["64", "96", "128", "192", "256", "384", "512", "768", "1024"]);

choices! {
    /// Region that the shadow map covers: the bricks (blocks of voxels) with extinction that the camera sees, or all
    /// bricks with extinction.
    pub enum Fit {
        /// Makes the shadow map cover the bricks (blocks of voxels) with extinction that the camera sees.
        View = "view",
        /// Makes the shadow map cover all bricks (blocks of voxels) with extinction.
        Volume = "volume",
    }
}

impl Fit {
    /// Returns the description of a shadow map: texels per side (`None`: chosen from the scene), covered region,
    /// filter of texels, way of marching light rays, and length of the march before a query (smallest voxel spacings).
    pub fn shape(self, texels: Option<u32>, filter: Filter, march: March, near: f64) -> MapShape {
        let reach = if filter.is_wide() { 2 } else { 1 };
        MapShape { texels, fits_view: self == Self::View, reach, border: reach, march, near }
    }
}

/// Setting `fit`: region that a shadow map covers, the visible part of the volume or all of it.
pub(super) const FIT_KEY: Key =
    Key::choice(Fit::NAMES, "view", "extent of the map: the visible part of the volume, or all of it");

choices! {
    /// Whether neighbouring samples of a camera ray share one transmittance query of the shadow map, or each makes
    /// its own.
    pub enum Lookups {
        /// Makes one transmittance query for up to four neighbouring samples of a camera ray.
        Shared = "shared",
        /// Makes one transmittance query for each sample of a camera ray.
        Each = "each",
    }
}

/// Name of the setting that selects a random estimator of shadow rays.
pub(super) const ESTIMATOR: &str = "estimator";
/// Name of the setting with the seed of random numbers.
pub(super) const SEED: &str = "seed";
/// Name of the setting that selects how light rays are marched: cell by cell or by regular samples.
pub(super) const MARCH: &str = "march";
/// Setting `march`: light rays are marched cell by cell or by regular samples.
pub(super) const MARCH_KEY: Key = Key::choice(
    MarchBy::NAMES,
    "cells",
    "march of light rays: cell by cell (exact), or by samples at regular steps",
)
.coarse("samples")
.when(UNLESS_LINES);
/// Setting `step`: distance between regular samples along light rays, in units of the smallest voxel spacing.
pub(super) const STEP_KEY: Key = Key::number(
    [0.01, 8.0],
    "0.5",
    "step along light rays, in units of the smallest voxel spacing (march=samples)",
)
.when(When::Is(MARCH, "samples"));

/// Setting `lookup`: whether neighbouring samples of a camera ray share one transmittance query of the shadow map.
pub(super) const LOOKUP_KEY: Key = Key::choice(
    Lookups::NAMES,
    "shared",
    "queries for transmittance along eye rays: one for up to four samples, or one for each",
);

/// Setting `filter`: filter of shadow map texels. The search keeps to the two that do not blur; the frozen benchmark
/// relies on it.
pub(super) const FILTER_KEY: Key = Key::choice(
    Filter::NAMES,
    "bilinear",
    "texels read for a point: the nearest, four with bilinear weights, or 4 x 4 (gauss: Gaussian weights; pcf: \
     percentage-closer filtering)",
)
.search(&["nearest", "bilinear"]);

choices! {
    /// Whether the four texels around a point are aligned at their first depths before they are averaged.
    pub enum Align {
        /// Aligns the texels around a point at the depths where their matter begins, if these are close enough to be
        /// one surface.
        On = "on",
        /// Averages the texels around a point at the depth of the point.
        Off = "off",
    }
}

/// Setting `align`: whether the four texels around a point are aligned at their first depths.
pub(super) const ALIGN_KEY: Key = Key::choice(
    Align::NAMES,
    "off",
    "texels around a point are aligned at the depths where their matter begins (filter=bilinear)",
)
.when(When::UnlessAny(&[("filter", "nearest"), ("filter", "gauss"), ("filter", "pcf")]));

/// Name of the setting for the length of the march towards the light before a query of the shadow map.
pub(super) const NEAR: &str = "near";
/// Setting `near`: length of the march from a point towards the light before a query of the shadow map.
pub(super) const NEAR_KEY: Key = Key::number(
    [0.0, 32.0],
    "4",
    "voxels (smallest spacings) marched towards the light before the map is queried; 0: none",
)
.search(&["0", "2", "4", "8"])
.when(UNLESS_LINES);

/// Declares the settings of a shadow method: a public struct, and one [`Key`] for each field, with the field's name.
/// `..MapSettings` inserts the settings that all shadow maps share, and adds the function `shape`.
macro_rules! settings {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[$doc:meta])* $field:ident: $ty:ty = $key:expr,)*
        ..MapSettings,
        $($more:tt)*
    }) => {
        $crate::shadow::keys::settings! {
            $(#[$meta])* $vis struct $name {
                $($(#[$doc])* $field: $ty = $key,)*
                /// Geometry that casts the shadows: the voxels of the volume, or the strands (line segments of hair
                /// or fibres) from which the volume was made.
                from: $crate::shadow::keys::DrawnFrom = $crate::shadow::keys::FROM_KEY,
                /// Way in which light rays are marched: cell by cell with exact integrals, or by samples at regular
                /// distances.
                march: $crate::shadow::keys::MarchBy = $crate::shadow::keys::MARCH_KEY,
                /// Distance between regular samples along a light ray, in units of the smallest voxel spacing.
                step: f64 = $crate::shadow::keys::STEP_KEY,
                /// Number of shadow map texels per side; `None` if chosen from the scene.
                map: Option<u32> = $crate::shadow::keys::MAP_KEY,
                /// Region that the shadow map covers: the bricks (blocks of voxels) with extinction that the camera
                /// sees, or all bricks with extinction.
                fit: $crate::shadow::keys::Fit = $crate::shadow::keys::FIT_KEY,
                /// Filter of the shadow map texels around a point.
                filter: $crate::shadow::Filter = $crate::shadow::keys::FILTER_KEY,
                /// Length of the march from a point towards the light before a query of the shadow map, in smallest
                /// voxel spacings; 0 for none.
                near: f64 = $crate::shadow::keys::NEAR_KEY,
                $($more)*
            }
        }

        impl $name {
            /// Texels per side and covered region of the shadow map, and the way in which its light rays are marched.
            pub(super) fn shape(&self) -> $crate::field::MapShape {
                let march = self.from.march(self.march, self.step);
                self.fit.shape(self.map, self.filter, march, self.from.near(self.near))
            }
        }
    };
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $($(#[$doc:meta])* $field:ident: $ty:ty = $key:expr,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        $vis struct $name { $($(#[$doc])* pub $field: $ty,)* }

        impl $name {
            /// Descriptions of all settings of the shadow method, in the order of the struct's fields.
            pub const KEYS: &'static [$crate::shadow::Key] =
                &[$($crate::shadow::Key { name: stringify!($field), ..$key }),*];

            /// Creates the settings of a shadow method from one value for each of [`Self::KEYS`].
            fn from_values(values: &[$crate::shadow::Value]) -> Option<Self> {
                let mut values = values.iter().copied();
                Some(Self { $($field: $crate::shadow::settings::Field::from_value(values.next()?)?,)* })
            }

            /// Returns the values of the shadow method's settings, in the order of [`Self::KEYS`].
            fn to_values(self) -> Vec<$crate::shadow::Value> {
                let mut values = Vec::new();
                $($crate::shadow::settings::Field::push_to(self.$field, &mut values, Self::KEYS);)*
                values
            }
        }

        impl Default for $name {
            fn default() -> Self {
                let values: Vec<_> = Self::KEYS.iter().filter_map(|k| k.parse(k.default)).collect();
                Self::from_values(&values).expect("defaults are values of their keys: a test reads them all")
            }
        }
    };
}

pub(super) use settings;
