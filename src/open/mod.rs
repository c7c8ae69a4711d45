//! Opening of volumes and scenes: loads the inputs that command-line flags, scene files and the window name.

mod diagnostic;
mod downsample;
pub mod formats;
mod layer;
mod lighting;
mod likely_labels;
mod load;
mod masking;
mod meshes;
pub mod presets;
pub mod provenance;
#[allow(rustdoc::broken_intra_doc_links, reason = "square brackets of the flags' help")]
mod request;
mod scene_file;
#[allow(rustdoc::broken_intra_doc_links, reason = "square brackets of the flags' help")]
pub mod settings;
mod sky;
mod strands;
pub mod units;
pub mod user_presets;
pub mod values;
mod view;

pub use diagnostic::{Diagnostic, Level};
pub use formats::{FORMATS, Read, ReadFlags, VolumeSpec, load};
pub use layer::Layer;
pub use likely_labels::likely_labels;
pub use load::{Functions, Loaded};
pub use masking::{LabelFunction, LabelList, MaskFlags};
pub use meshes::{OpaqueFile, OpaqueFlags};
pub use request::{RunFlags, SceneArgs, SceneRequest};
pub use scene_file::flag_error;
pub use settings::{DEFAULT_VOLUME, SceneSettings};
pub use strands::{StrandFlags, is_strand_source, lacks_thickness, load_any_strands, load_strands};
pub use values::{resolution as parse_resolution, thickness_mm as parse_thickness_mm};
