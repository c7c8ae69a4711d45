//! Keys that several shadow methods share, with their values.

use super::settings::{Key, When, choices};
use crate::field::{MapShape, March};

choices! {
    /// March of light rays.
    pub enum MarchBy {
        /// Cell by cell, exactly.
        Cells = "cells",
        /// Regular samples.
        Samples = "samples",
    }
}

impl MarchBy {
    /// March with samples at a distance in smallest voxel spacings.
    pub fn with_step(self, step: f64) -> March {
        match self {
            Self::Cells => March::Cells,
            Self::Samples => March::Samples { step },
        }
    }
}

choices! {
    /// Occluder that a map is drawn from.
    pub enum DrawnFrom {
        /// The volume.
        Voxels = "voxels",
        /// The segments of the strands that the volume was made from.
        Lines = "lines",
    }
}

impl DrawnFrom {
    /// March through this occluder, with the distance of samples in smallest voxel spacings.
    pub fn march(self, march: MarchBy, step: f64) -> March {
        match self {
            Self::Voxels => march.with_step(step),
            Self::Lines => March::Lines,
        }
    }
}

/// Name of the key for the occluder.
const FROM: &str = "from";
/// Condition of keys of marches through the volume.
pub(super) const UNLESS_LINES: When = When::Unless(FROM, "lines");
/// Key for the occluder of a map.
pub(super) const FROM_KEY: Key = Key::choice(
    DrawnFrom::NAMES,
    "voxels",
    "what casts shadows: the volume, or the strands that it was made from, drawn into the map",
);

/// Name of the key for the map's size.
pub(super) const MAP: &str = "map";
/// Key for the size of a map.
pub(super) const MAP_KEY: Key = Key::whole_or(
    [1, 8192],
    "auto",
    "auto",
    "texels a side; auto: about a voxel each, finer where zoomed in",
)
.search(&["64", "96", "128", "192", "256", "384", "512", "768", "1024"]);

choices! {
    /// Region that a map covers.
    pub enum Fit {
        /// Active bricks that the camera sees.
        View = "view",
        /// All active bricks.
        Volume = "volume",
    }
}

impl Fit {
    /// Shape of a map with so many texels a side (`None`: by the scene).
    pub fn shape(self, texels: Option<u32>, march: March) -> MapShape {
        MapShape { texels, fits_view: self == Self::View, reach: 1, march }
    }
}

/// Key for the region that a map covers.
pub(super) const FIT_KEY: Key = Key::choice(
    Fit::NAMES,
    "view",
    "texels across what the picture shows, or across all that has extinction",
);

choices! {
    /// Interpolation between the texels of a map.
    pub enum Filter {
        /// The nearest texel.
        Nearest = "nearest",
        /// The four texels around a point.
        Bilinear = "bilinear",
    }
}

choices! {
    /// Lookups of light by the samples of an eye ray.
    pub enum Lookups {
        /// One lookup for up to four neighbouring samples.
        Shared = "shared",
        /// One lookup for each sample.
        Each = "each",
    }
}

/// Name of the key for the march of light rays.
pub(super) const MARCH: &str = "march";
/// Key for the march of light rays.
pub(super) const MARCH_KEY: Key =
    Key::choice(MarchBy::NAMES, "cells", "light rays cell by cell, exactly, or by regular samples")
        .coarse("samples")
        .when(UNLESS_LINES);
/// Key for the distance of regular samples.
pub(super) const STEP_KEY: Key = Key::number(
    [0.01, 8.0],
    "0.5",
    "distance of samples along light rays, in smallest spacings (march=samples)",
)
.when(When::Is(MARCH, "samples"));

/// Setting `lookup`: shadow map lookups per sample of an eye ray.
pub(super) const LOOKUP_KEY: Key = Key::choice(
    Lookups::NAMES,
    "shared",
    "lookups of light by eye samples: shared by up to four, or one for each",
);

/// Key for the interpolation between texels.
pub(super) const FILTER_KEY: Key =
    Key::choice(Filter::NAMES, "bilinear", "texels used for a point").search_all();

/// Declares the settings of a method: a public struct, and its keys, which are named like the fields. `..MapSettings` stands
/// for the settings that all maps share, and adds `shape`.
macro_rules! settings {
    ($(#[$meta:meta])* $vis:vis struct $name:ident {
        $($(#[$doc:meta])* $field:ident: $ty:ty = $key:expr,)*
        ..MapSettings,
        $($more:tt)*
    }) => {
        $crate::shadow::keys::settings! {
            $(#[$meta])* $vis struct $name {
                $($(#[$doc])* $field: $ty = $key,)*
                /// Occluder.
                from: $crate::shadow::keys::DrawnFrom = $crate::shadow::keys::FROM_KEY,
                /// March of light rays.
                march: $crate::shadow::keys::MarchBy = $crate::shadow::keys::MARCH_KEY,
                /// Distance of regular samples, in smallest voxel spacings.
                step: f64 = $crate::shadow::keys::STEP_KEY,
                /// Texels a side; `None`: by the scene.
                map: Option<u32> = $crate::shadow::keys::MAP_KEY,
                /// Region that the map covers.
                fit: $crate::shadow::keys::Fit = $crate::shadow::keys::FIT_KEY,
                /// Interpolation between texels.
                filter: $crate::shadow::Filter = $crate::shadow::keys::FILTER_KEY,
                $($more)*
            }
        }

        impl $name {
            /// Shape of the map, with the march of its light rays.
            pub(super) fn shape(&self) -> $crate::field::MapShape {
                self.fit.shape(self.map, self.from.march(self.march, self.step))
            }
        }
    };
    ($(#[$meta:meta])* $vis:vis struct $name:ident { $($(#[$doc:meta])* $field:ident: $ty:ty = $key:expr,)* }) => {
        $(#[$meta])*
        #[derive(Debug, Clone, Copy, PartialEq)]
        $vis struct $name { $($(#[$doc])* pub $field: $ty,)* }

        impl $name {
            /// Keys, in the order of the fields.
            pub const KEYS: &'static [$crate::shadow::Key] =
                &[$($crate::shadow::Key { name: stringify!($field), ..$key }),*];

            /// Settings from values of [`Self::KEYS`].
            fn from_values(values: &[$crate::shadow::Value]) -> Option<Self> {
                let mut values = values.iter().copied();
                Some(Self { $($field: $crate::shadow::settings::Field::from_value(values.next()?)?,)* })
            }

            /// Values of [`Self::KEYS`].
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
