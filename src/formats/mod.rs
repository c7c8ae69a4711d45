//! The files that hold volumes: a file or folder here for each format, with what recognises it and what reads it.
//!
//! Which of them a name stands for is decided above (`open::FORMATS`), by content first and by name second: every
//! reader says from the [`Head`] of a file whether it is its own.

mod beside;
pub mod dicom;
mod frames;
mod head;
pub mod metaimage;
pub mod nifti;
mod nifti_header;
mod nifti_write;
pub mod npy;
pub mod nrrd;
mod parts;
pub mod raw;
pub mod raw_layout;
mod sidecar;
mod source;
mod text_header;
mod text_numbers;
pub mod tiff_stack;
mod units;
pub mod vti;
mod write;
pub mod zarr;

pub use head::Head;
pub use nifti_write::{NIFTI_EXTENSIONS, write_nifti};
pub use raw_layout::RawLayout;
pub use sidecar::Sidecar;
pub use write::{VOLUME_EXTENSIONS, write_volume};
