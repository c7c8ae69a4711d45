//! What a user names, on the command line, in a scene file or in the window, becomes what the program works on.

pub mod asked;
mod file;
mod fit;
pub mod formats;
mod help;
mod lights;
mod load;
mod meshes;
mod parts;
pub mod presets;
mod refusal;
mod remark;
#[allow(rustdoc::broken_intra_doc_links, reason = "square brackets of the flags' help")]
pub mod settings;
mod strands;
pub mod units;
pub mod values;
mod view;

pub use formats::{FORMATS, Read, ReadFlags, VolumeSpec, load, load_with, read_with};
pub use load::{Functions, Loaded};
pub use meshes::{MeshFile, OpaqueFlags, StrandFile};
pub use parts::{LabelFunction, LabelList, PartFlags};
pub use refusal::{Refusal, refusal};
pub use remark::Remark;
pub use settings::{DEFAULT_SHADOW, DEFAULT_VOLUME, SceneArgs, SceneSettings};
pub use strands::{
    StrandFlags, is_strand_source, lacks_thickness, load_strands, parse_resolution, parse_thickness_mm,
};
