//! Volume: a scalar field on a regular voxel grid, with an affine to world coordinates (RAS+, mm).
//!
//! Voxel centres are at integer index coordinates `(i, j, k)`. Between them the field is trilinear, clamped at the
//! edge. Its domain is `[-0.5, n - 0.5]^3` in index space; outside the extinction is zero.

mod access;
mod bricks;
mod byte_count;
mod crop;
mod directions;
mod downsample;
pub(crate) mod element;
mod histogram;
mod joint_histogram;
mod labels;
pub(crate) mod read;
mod segmentation;
mod source;
mod statistics;
mod storage;
mod voxels;

pub use bricks::{BRICK_CELLS, BrickLabels, Bricks, RankSet};
pub use byte_count::ByteCount;
pub use crop::Crop;
pub use directions::DirectionMoments;
pub use downsample::Downsample;
pub use element::{ByteOrder, Element};
pub use histogram::Histogram;
pub use joint_histogram::JointHistogram;
pub use labels::{Labels, MAX_LABELS, Segment};
pub(crate) use source::{CHUNK_CELLS, ChunkCache, chunk_cache};
pub use source::{IndexBox, OutOfCoreVoxels, ReadUsage, VoxelSource};
pub use storage::{VoxelBlock, VoxelStorage};
pub use voxels::{Scaling, Voxel, Voxels};

use crate::error::{Error, Result};
use crate::files::loading::Loading;
use glam::{DAffine3, DVec3};
use statistics::Statistics;
use std::sync::{Arc, OnceLock};

/// Kind of file metadata that gave the affine of a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum AffineSource {
    /// The affine is the `sform` of a NIfTI file.
    Sform,
    /// The affine is the `qform` of a NIfTI file.
    Qform,
    /// The affine comes from axis directions and an origin in the volume file.
    Axes,
    /// The affine comes from voxel sizes only, without orientation.
    Spacing,
}

/// Meaning of the voxel values according to the volume file, e.g. Hounsfield units. It includes the evidence, e.g.
/// `DICOM modality CT`.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub enum ValueMeaning {
    /// The volume file does not tell the meaning of its values.
    #[default]
    Unknown,
    /// The voxel values are Hounsfield units; the text gives the evidence.
    Hounsfield(String),
    /// The voxel values are another quantity, e.g. MR intensities or a statistic; the text gives the evidence.
    Other(String),
}

/// Origin and metadata of a volume, as the command `info` prints them: file, format, voxel type, frame and warnings.
#[derive(Debug, Clone, PartialEq, serde::Serialize)]
pub struct Provenance {
    /// Path of the volume file, or `phantom:NAME:SIZE` for a built-in volume.
    pub source: String,
    /// Name of the file format: `nifti1`, `nifti2`, `raw`, `phantom`, ...
    pub format: String,
    /// Voxel type in the volume file, e.g. `uint8`, `int16 big-endian`.
    pub stored_type: String,
    /// Kind of file metadata that gave the affine of the volume.
    pub affine_source: AffineSource,
    /// Number of frames in the volume file.
    pub frames: usize,
    /// Index of the frame that was read from the volume file, from 0.
    pub frame: usize,
    /// Meaning of the voxel values, e.g. Hounsfield units, according to the volume file.
    #[serde(skip)]
    pub values: ValueMeaning,
    /// Number of voxels that were NaN or infinite and were set to the smallest finite value.
    pub non_finite: usize,
    /// Segments of a segmentation file, with their names.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub segments: Vec<Segment>,
    /// Warnings from reading the volume, one line each.
    pub warnings: Vec<String>,
}

impl Provenance {
    /// Creates the metadata of a volume with one frame, an affine from voxel sizes, and no warnings.
    pub fn new(source: impl Into<String>, format: &str, stored_type: impl Into<String>) -> Self {
        Self {
            source: source.into(),
            format: format.into(),
            stored_type: stored_type.into(),
            affine_source: AffineSource::Spacing,
            frames: 1,
            frame: 0,
            values: ValueMeaning::Unknown,
            non_finite: 0,
            segments: Vec::new(),
            warnings: Vec::new(),
        }
    }
}

/// Volume: stored voxel values, their linear mapping to physical values, and the affine to world coordinates (RAS+,
/// mm).
#[derive(Debug, Clone)]
pub struct Volume {
    storage: VoxelStorage,
    scaling: Scaling,
    world_from_index: DAffine3,
    index_from_world: DAffine3,
    stored_range: [f64; 2],
    labels: Option<Arc<Labels>>,
    bricks: OnceLock<Bricks>,
    /// Origin and metadata of the volume.
    pub provenance: Provenance,
}

impl Volume {
    /// Creates a volume; `world_from_index` maps voxel indices to world mm (RAS+).
    ///
    /// # Errors
    /// A dimension is 0, the affine is singular or not finite, the slope is 0, physical values overflow, or no value
    /// is finite.
    pub fn new(
        voxels: Voxels,
        scaling: Scaling,
        world_from_index: DAffine3,
        provenance: Provenance,
    ) -> Result<Self> {
        Self::new_with(voxels, scaling, world_from_index, provenance, &Loading::default())
    }

    /// Creates a volume, reporting progress to `loading`, which can cancel it.
    ///
    /// # Errors
    /// See [`Self::new`]; or `loading` was cancelled.
    pub fn new_with(
        voxels: Voxels,
        scaling: Scaling,
        world_from_index: DAffine3,
        provenance: Provenance,
        loading: &Loading,
    ) -> Result<Self> {
        Self::from_storage(voxels.into(), scaling, world_from_index, provenance, loading)
    }

    /// Creates a volume whose voxels are in host memory or are read in parts. Voxels that are read in parts are read once
    /// here, for their range and that of each brick.
    ///
    /// # Errors
    /// See [`Self::new`]; or the voxels cannot be read, or `loading` was cancelled.
    pub fn from_storage(
        mut storage: VoxelStorage,
        scaling: Scaling,
        world_from_index: DAffine3,
        mut provenance: Provenance,
        loading: &Loading,
    ) -> Result<Self> {
        loading.go_on(&provenance.source)?;
        let refuse = |why: &str| Error::input("cannot use volume", &provenance.source, why);
        if storage.dims().contains(&0) {
            return Err(refuse("a dimension is 0"));
        }
        if storage.is_scattered() {
            return Err(refuse("its voxels are not contiguous with x fastest"));
        }
        if !(scaling.slope.is_finite() && scaling.intercept.is_finite()) || scaling.slope == 0.0 {
            return Err(refuse("the value scaling is not finite or its slope is 0"));
        }
        let index_from_world = world_from_index.inverse();
        if !(world_from_index.is_finite() && index_from_world.is_finite())
            || world_from_index.matrix3.determinant() == 0.0
        {
            return Err(refuse("the affine is singular or not finite"));
        }
        let axes = world_from_index.matrix3;
        if ![axes.x_axis, axes.y_axis, axes.z_axis].iter().all(|axis| axis.length().is_finite()) {
            return Err(refuse("its voxel sizes overflow"));
        }
        let statistics = Statistics::of(&storage, scaling, world_from_index, loading)?;
        loading.go_on(&provenance.source)?;
        let Some(stored_range) = statistics.range() else {
            return Err(refuse("no voxel has a finite value"));
        };
        if !stored_range.iter().all(|&s| scaling.apply(s).is_finite()) {
            return Err(refuse("its values overflow once scaled"));
        }
        let mut bricks = statistics.bricks;
        if statistics.non_finite > 0 {
            storage.replace_non_finite(stored_range[usize::from(scaling.slope < 0.0)]);
            if bricks.is_some() {
                bricks = Statistics::of(&storage, scaling, world_from_index, loading)?.bricks;
                loading.go_on(&provenance.source)?;
            }
            provenance.non_finite += statistics.non_finite;
            provenance.warnings.push(format!(
                "{} voxels were not finite and became the smallest finite value",
                statistics.non_finite
            ));
        }
        Ok(Self {
            storage,
            scaling,
            world_from_index,
            index_from_world,
            stored_range,
            labels: None,
            bricks: bricks.map_or_else(OnceLock::new, OnceLock::from),
            provenance,
        })
    }

    /// Returns the number of voxels `[nx, ny, nz]` along the index axes `i, j, k`.
    pub fn dims(&self) -> [usize; 3] {
        self.storage.dims()
    }

    /// Returns the linear mapping from stored voxel values to physical values.
    pub fn scaling(&self) -> Scaling {
        self.scaling
    }

    /// Returns the affine from voxel indices to world coordinates (RAS+, mm).
    pub fn world_from_index(&self) -> DAffine3 {
        self.world_from_index
    }

    /// Returns the affine from world coordinates (RAS+, mm) to voxel indices.
    pub fn index_from_world(&self) -> DAffine3 {
        self.index_from_world
    }

    /// Returns the distance between neighbouring voxel centres along each index axis, mm.
    pub fn spacing_mm(&self) -> [f64; 3] {
        let m = self.world_from_index.matrix3;
        [m.x_axis.length(), m.y_axis.length(), m.z_axis.length()]
    }

    /// Returns the smallest of the three voxel spacings, mm. It is the unit of `--step`.
    pub fn min_spacing_mm(&self) -> f64 {
        self.spacing_mm().into_iter().fold(f64::INFINITY, f64::min)
    }

    /// Returns the smallest and largest stored voxel value, before the mapping to physical values.
    pub fn stored_range(&self) -> [f64; 2] {
        self.stored_range
    }

    /// Returns the smallest and largest physical value of the volume.
    pub fn value_range(&self) -> [f64; 2] {
        let [a, b] = self.stored_range.map(|s| self.scaling.apply(s));
        [a.min(b), a.max(b)]
    }

    /// Returns the physical value of one voxel.
    pub fn value(&self, i: usize, j: usize, k: usize) -> f64 {
        self.scaling.apply(match &self.storage {
            VoxelStorage::Resident(voxels) => voxels.stored([i, j, k]),
            VoxelStorage::OutOfCore(parts) => parts.stored([i, j, k]),
        })
    }

    /// Returns the physical value at a position in index coordinates: trilinear between voxel centres, clamped at the
    /// edge.
    pub fn value_at(&self, index: DVec3) -> f64 {
        let corners = trilinear(index, self.dims());
        corners.into_iter().fold(0.0, |sum, ([i, j, k], weight)| sum + weight * self.value(i, j, k))
    }

    /// Returns the eight corners of the volume's domain `[-0.5, n - 0.5]^3` in world mm.
    pub fn corners_mm(&self) -> [DVec3; 8] {
        let n = self.dims().map(|n| n as f64 - 0.5);
        std::array::from_fn(|c| {
            let pick = |axis: usize| if c >> axis & 1 == 0 { -0.5 } else { n[axis] };
            self.world_from_index.transform_point3(DVec3::new(pick(0), pick(1), pick(2)))
        })
    }

    /// Returns the centre of the volume's domain in world mm.
    pub fn center_mm(&self) -> DVec3 {
        self.corners_mm().iter().sum::<DVec3>() / 8.0
    }

    /// Returns the centre of the sphere through the farthest corners of the volume's domain, and its radius; world mm.
    pub fn bounding_sphere_mm(&self) -> (DVec3, f64) {
        let center = self.center_mm();
        (center, self.corners_mm().iter().map(|c| c.distance(center)).fold(0.0, f64::max))
    }

    /// Returns the value range of each brick (block of grid cells), for empty-space skipping. It is computed once per
    /// volume.
    pub fn bricks(&self) -> &Bricks {
        self.bricks.get_or_init(|| {
            let dims = self.dims();
            let mut bricks = Bricks::new(self.element(), dims, self.scaling, self.world_from_index);
            // Those of a volume that is read in parts are known, so that this reads voxels in host memory.
            for (slices, block) in self.slabs(1, BRICK_CELLS).flatten() {
                bricks.add(&block, slices.clone(), slices.end == dims[2]);
            }
            bricks.with_labels(self.labels.as_deref(), dims)
        })
    }

    /// Returns the segmentation label of every voxel, if the volume has a segmentation.
    pub fn labels(&self) -> Option<&Arc<Labels>> {
        self.labels.as_ref()
    }

    /// Adds segmentation labels to the volume.
    ///
    /// # Errors
    /// The number of labels differs from the number of voxels.
    pub fn labelled(self, labels: Arc<Labels>) -> Result<Self> {
        let dims = self.dims();
        let voxels = dims.iter().product::<usize>();
        if labels.ranks().len() != voxels {
            let why = format!("{} labels for {voxels} voxels", labels.ranks().len());
            return Err(Error::input("cannot use labels", &self.provenance.source, why));
        }
        let bricks = self.bricks.into_inner().map(|bricks| bricks.with_labels(Some(&labels), dims));
        let bricks = bricks.map_or_else(OnceLock::new, OnceLock::from);
        Ok(Self { labels: Some(labels), bricks, ..self })
    }

    /// Returns the size of all stored voxels, bytes.
    pub fn bytes(&self) -> u64 {
        let voxels: u64 = self.dims().iter().map(|n| *n as u64).product();
        voxels * self.element().memory_bytes()
    }
}

/// Returns the eight voxels around a position in index coordinates with their trilinear weights, clamped at the edge.
fn trilinear(position: DVec3, dims: [usize; 3]) -> [([usize; 3], f64); 8] {
    let axes: [[(usize, f64); 2]; 3] = std::array::from_fn(|axis| {
        let last = dims[axis] - 1;
        let p = position[axis].clamp(0.0, last as f64);
        let low = (p as usize).min(last);
        [(low, 1.0 - (p - low as f64)), ((low + 1).min(last), p - low as f64)]
    });
    std::array::from_fn(|corner| {
        let [x, y, z] = std::array::from_fn(|axis| axes[axis][corner >> axis & 1]);
        ([x.0, y.0, z.0], x.1 * y.1 * z.1)
    })
}
