//! Readers and writers of volume files.
//!
//! Each reader recognises its files by their [`Head`]. `open::FORMATS` lists the readers in the order in which they
//! are tried.

mod assembly;
mod common;
mod data_files;
pub mod dicom;
mod file_voxels;
mod head;
pub mod metaimage;
pub mod nifti;
pub mod npy;
pub mod nrrd;
mod numbers;
pub mod raw;
mod raw_layout;
mod slicer_segments;
mod source;
mod text_header;
mod text_numbers;
pub mod tiff_stack;
pub mod vti;
mod write;
pub mod zarr;

pub use common::frame_choice;
pub use head::Head;
pub use nifti::{NIFTI_EXTENSIONS, write_nifti};
pub use raw_layout::{RawLayout, Sidecar};
pub use write::{VOLUME_EXTENSIONS, write_volume};
