//! Built-in volumes (phantoms): analytic ones with known line integrals, and a CT-like chest (see [`thorax`]).
//!
//! The analytic volumes fill the cube `[-32, 32]^3` mm with `n^3` voxels (`n` is the SIZE in `phantom:NAME:SIZE`).
//! The spacing is `h = 64 / n` mm, and the centre of voxel `i` is at `x = (i - (n - 1) / 2) h`. Affines are rounded
//! to `f32`, so a NIfTI file stores them exactly. Optical depths are for an extinction of `c s` at the value `s`:
//!
//! | name | value at a voxel centre | exact results |
//! |---|---|---|
//! | `slab` | 1000 on planes `k0 <= k < k1` across z, `k0 = n / 4` (rounded down), `k1 = n - k0`; else 0 | the optical depth along z is `1000 c (k1 - k0) h`; values reach 500 at the planes `k0 - 1/2` and `k1 - 1/2` |
//! | `step` | 1000 from plane `i = n / 2` (rounded down) across x on; else 0 | values reach 500 at `i - 1/2`, which is `x = 0` for even `n` |
//! | `comb` | 1000 on every fourth plane across z, `k % 4 = 2`; else 0 | with `m` such planes, the optical depth along z is `1000 c m h`; above 500 every layer is `h` thick |
//! | `sphere` | `1000 (1 - r^2 / 32^2)`, `r` the distance from the centre in mm | the surface `s = v` is the sphere of radius `32 sqrt(1 - v / 1000)`; interpolation adds at most `3 h^2 / 4` to `r^2` and within each cell the field is exactly linear |
//! | `shell` | `1000 max(0, 1 - |r - 20| / 8)` | above 500 it is the hollow ball `16 < r < 24` |
//! | `cloud`, `smoke` | `1000 min(1, sum of metaballs)`, see [`media`] | |
//! | `foam`, `struts` | 1000 on the walls or edges of a random Voronoi diagram, falling to 0 within their thickness | |
//! | `sheets` | 1000 on thin curved sheets with gaps, falling to 0 within their thickness | |
//!
//! `sphere` and `shell` are `f32`, the others `i16`; the chest is `i16` in HU.

mod foam;
mod formula;
mod grid;
mod media;
mod thorax;

use crate::error::{Error, Result};
use crate::files::loading::Loading;
use crate::files::memory_budget::check_grid;
use crate::volume::{Provenance, Scaling, ValueMeaning, Volume, VoxelSource as _, VoxelStorage};
use foam::Foam;
use formula::{Formula, Shape};
use glam::{DAffine3, DMat3, DVec3};
use media::Metaballs;
use std::fmt;

/// Built-in volume (phantom), computed instead of read from a file.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Phantom {
    /// Phantom of a CT-like chest in Hounsfield units.
    #[default]
    Thorax,
    /// Phantom with a slab of constant value, perpendicular to z.
    Slab,
    /// Phantom whose value decreases with the squared distance from the centre, so that isosurfaces are spheres.
    Sphere,
    /// Phantom with a hollow ball.
    Shell,
    /// Phantom with a half space: a constant value from the middle of the x axis towards +x, and 0 elsewhere.
    Step,
    /// Phantom with thin layers perpendicular to z, and gaps between them.
    Comb,
    /// Phantom of a cumulus cloud, made of metaballs.
    Cloud,
    /// Phantom of rising smoke, made of metaballs.
    Smoke,
    /// Phantom of a closed-cell foam: thin walls between cells.
    Foam,
    /// Phantom of an open-cell foam: struts along the edges of cells.
    Struts,
    /// Phantom with thin curved sheets, and gaps in them.
    Sheets,
}

impl Phantom {
    /// All built-in volumes (phantoms), the default first.
    pub const ALL: [Self; 11] = [
        Self::Thorax,
        Self::Slab,
        Self::Sphere,
        Self::Shell,
        Self::Step,
        Self::Comb,
        Self::Cloud,
        Self::Smoke,
        Self::Foam,
        Self::Struts,
        Self::Sheets,
    ];

    /// Largest number of voxels along the longest side of a phantom.
    pub const MAX_SIZE: usize = 4096;

    /// Name of the phantom, as in `phantom:NAME`.
    pub fn name(self) -> &'static str {
        self.texts().0
    }

    /// Short description of the phantom for the user.
    pub fn description(self) -> &'static str {
        self.texts().1
    }

    fn texts(self) -> (&'static str, &'static str) {
        match self {
            Self::Thorax => ("thorax", "a CT-like chest in HU"),
            Self::Slab => ("slab", "a slab of constant value across z"),
            Self::Sphere => ("sphere", "a value that falls with the radius squared: spheres as isosurfaces"),
            Self::Shell => ("shell", "a hollow ball"),
            Self::Step => ("step", "a half space across x"),
            Self::Comb => ("comb", "thin alternating layers across z"),
            Self::Cloud => ("cloud", "a cumulus cloud of metaballs"),
            Self::Smoke => ("smoke", "rising smoke of metaballs"),
            Self::Foam => ("foam", "a closed-cell foam: thin walls between cells"),
            Self::Struts => ("struts", "an open-cell foam: struts along the edges of cells"),
            Self::Sheets => ("sheets", "thin curved sheets with gaps"),
        }
    }

    /// Default number of voxels along the longest side of the built-in volume (phantom).
    pub fn default_size(self) -> usize {
        match self {
            Self::Thorax => thorax::DEFAULT_SIZE,
            _ => 64,
        }
    }

    /// Parses the name and size of a phantom, `NAME[:SIZE]`. For an unknown name, the error lists all phantoms and
    /// the names in `others`.
    ///
    /// # Errors
    /// No phantom has this name, or the size is not in `1..=4096`.
    pub fn parse(text: &str, others: &[&str]) -> Result<(Self, usize)> {
        let (name, size) = text.split_once(':').map_or((text, None), |(name, size)| (name, Some(size)));
        let refuse = |why: String| Error::input("cannot build phantom", format!("phantom:{text}"), why);
        let phantom = Self::ALL.into_iter().find(|p| p.name() == name).ok_or_else(|| {
            let names = [&Self::ALL.map(Self::name), others].concat();
            refuse(format!("no phantom is named `{name}`")).hint(format!("there are {}", names.join(", ")))
        })?;
        let size = match size {
            None => phantom.default_size(),
            Some(size) => {
                size.parse().ok().filter(|n| (1..=Self::MAX_SIZE).contains(n)).ok_or_else(|| {
                    refuse(format!("size `{size}` is not a whole number in 1..={}", Self::MAX_SIZE))
                })?
            }
        };
        Ok((phantom, size))
    }

    /// Builds the phantom volume with `size` voxels along the longest side.
    ///
    /// # Errors
    /// `size` is not in `1..=4096`.
    pub fn build(self, size: usize) -> Result<Volume> {
        self.build_with(size, &Loading::default())
    }

    /// Builds the phantom volume, reporting progress to `loading`, which can cancel it.
    ///
    /// # Errors
    /// `size` is not in `1..=4096`, or `loading` was cancelled.
    pub fn build_with(self, size: usize, loading: &Loading) -> Result<Volume> {
        let source = format!("phantom:{}:{size}", self.name());
        if !(1..=Self::MAX_SIZE).contains(&size) {
            let why = format!("size {size} is not in 1..={}", Self::MAX_SIZE);
            return Err(Error::input("cannot build phantom", source, why));
        }
        let formula = Formula::new(self.shape(), size);
        let (dims, element) = (formula.dims(), formula.element());
        let affine = centred_affine(dims, formula.spacing_mm());
        let storage = match loading.out_of_core_limit(dims, element.memory_bytes()) {
            Some(host_bytes) => VoxelStorage::out_of_core(formula, host_bytes),
            None => {
                let refuse = |why: String| Error::input("cannot build phantom", &source, why);
                check_grid(dims, element.memory_bytes()).map_err(refuse)?;
                formula.voxels(&dims.map(|n| 0..n), loading).into()
            }
        };
        let mut provenance = Provenance::new(source, "phantom", element.name());
        provenance.values = ValueMeaning::Hounsfield("built in".into());
        Volume::from_storage(storage, Scaling::IDENTITY, affine, provenance, loading)
    }
}

impl Phantom {
    /// Returns the shape of the phantom, with what is the same for all of its voxels.
    fn shape(self) -> Shape {
        match self {
            Self::Thorax => Shape::Chest(thorax::solids()),
            Self::Slab => Shape::Slab,
            Self::Sphere => Shape::Sphere,
            Self::Shell => Shape::Shell,
            Self::Step => Shape::Step,
            Self::Comb => Shape::Comb,
            Self::Cloud => Shape::Balls(Metaballs::cloud()),
            Self::Smoke => Shape::Balls(Metaballs::smoke()),
            Self::Foam => Shape::Foam(Foam::closed()),
            Self::Struts => Shape::Foam(Foam::open()),
            Self::Sheets => Shape::Sheets,
        }
    }
}

impl fmt::Display for Phantom {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Affine of an axis-aligned voxel grid centred on the origin, rounded to `f32`.
fn centred_affine(dims: [usize; 3], spacing_mm: [f64; 3]) -> DAffine3 {
    let exact_in_f32 = |v: DVec3| v.as_vec3().as_dvec3();
    let spacing = exact_in_f32(DVec3::from_array(spacing_mm));
    let centre = DVec3::from_array(dims.map(|n| (n as f64 - 1.0) / 2.0));
    DAffine3::from_mat3_translation(DMat3::from_diagonal(spacing), exact_in_f32(-(spacing * centre)))
}
