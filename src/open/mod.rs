//! Input: turns what a user names on the command line, in a scene file or in the window into volumes and scenes.

pub mod formats;
mod layer;
mod load;
mod masking;
mod meshes;
pub mod presets;
pub mod provenance;
mod scene_file;
#[allow(rustdoc::broken_intra_doc_links, reason = "square brackets of the flags' help")]
pub mod settings;
mod strands;
pub mod units;
pub mod values;
mod view;

pub use formats::{FORMATS, Read, ReadFlags, VolumeSpec, load};
pub use layer::Layer;
pub use load::{Diagnostic, Functions, Level, Loaded};
pub use masking::{LabelFunction, LabelList, MaskFlags};
pub use meshes::{MeshFile, OpaqueFlags, StrandFile};
pub use settings::{DEFAULT_VOLUME, RunFlags, SceneArgs, SceneRequest, SceneSettings};
pub use strands::{
    StrandFlags, is_strand_source, lacks_thickness, load_strands, parse_resolution, parse_thickness_mm,
};
