//! Parses the metadata of a Zarr array, versions 2 and 3: its shape and the layout of its chunks.
//!
//! The crate `zarrs` is not used: it decompresses to any size that a file claims, allocates chunks before it reads
//! them, and needs seventy crates and libraries in C and C++ for Blosc and zstd. Source: "Zarr core specification" 2
//! and 3.1, and the specifications of its codecs.

use super::compression::Compression;
use crate::volume::{ByteOrder, Element};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Largest accepted number of axes of a Zarr array.
const MAX_AXES: usize = 16;
/// Largest accepted number of chunks in a Zarr shard.
const MAX_SHARD_CHUNKS: usize = 1 << 20;

/// Reads a JSON metadata file of a Zarr array or group; `None` if it does not exist.
///
/// # Errors
/// The file cannot be read, or is not JSON.
pub(super) fn json(path: &Path) -> Result<Option<Value>, String> {
    let named = |why: String| format!("{}: {why}", path.file_name().unwrap_or_default().to_string_lossy());
    if !path.is_file() {
        return Ok(None);
    }
    let bytes = std::fs::read(path).map_err(|e| named(e.to_string()))?;
    serde_json::from_slice(&bytes).map(Some).map_err(|e| named(e.to_string()))
}

/// Parses a JSON list of sizes, such as the shape of a Zarr array.
fn sizes(value: Option<&Value>) -> Option<Vec<usize>> {
    let numbers = value?.as_array()?.iter().map(|n| usize::try_from(n.as_u64()?).ok());
    numbers.collect()
}

/// Layout of the elements of a Zarr chunk: shape, axis order, byte order and compression.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Layout {
    /// Size of a Zarr chunk along each axis of the array.
    pub(super) shape: Vec<usize>,
    /// Index of the array axis for each stored axis of a Zarr chunk; the last stored axis varies fastest.
    pub(super) axes: Vec<usize>,
    pub(super) byte_order: ByteOrder,
    pub(super) compression: Compression,
}

/// Zarr shards: files that hold several chunks and an index of them.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Shards {
    /// Size of a Zarr shard along each axis of the array.
    pub(super) shape: Vec<usize>,
    pub(super) index_is_first: bool,
    pub(super) index_has_checksum: bool,
}

/// Zarr array, described by its metadata.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Array {
    pub(super) folder: PathBuf,
    pub(super) shape: Vec<usize>,
    pub(super) element: Element,
    /// Fill value of the Zarr array: the value of elements in missing chunks.
    pub(super) fill: f64,
    /// Layout of the Zarr chunks, which may be grouped in shards.
    pub(super) layout: Layout,
    pub(super) shards: Option<Shards>,
    /// Separator between the chunk indices in the file name of a Zarr chunk, and the prefix before them.
    separator: char,
    prefix: Option<&'static str>,
}

impl Array {
    /// Reads the metadata of the Zarr array in a folder; `None` if there is no array.
    ///
    /// # Errors
    /// The Zarr array is not supported, or its metadata are invalid.
    pub(super) fn open(folder: &Path) -> Result<Option<Self>, String> {
        if let Some(metadata) = json(&folder.join("zarr.json"))? {
            let is_array = metadata.get("node_type").and_then(Value::as_str) == Some("array");
            return is_array.then(|| Self::from_v3(folder, &metadata)).transpose();
        }
        let metadata = json(&folder.join(".zarray"))?;
        metadata.map(|metadata| Self::from_v2(folder, &metadata)).transpose()
    }

    fn from_v2(folder: &Path, metadata: &Value) -> Result<Self, String> {
        let text = |key: &str| metadata.get(key).and_then(Value::as_str);
        let (shape, chunks) = (sizes(metadata.get("shape")), sizes(metadata.get("chunks")));
        let (shape, chunks) = (shape.ok_or("it has no shape")?, chunks.ok_or("it has no chunks")?);
        let dtype = text("dtype").ok_or("its elements are records; numbers are needed")?;
        let (element, byte_order) = Element::from_numpy(dtype).ok_or_else(|| {
            format!("its elements are `{dtype}`; integers and 32- or 64-bit floats are supported")
        })?;
        let axes = match text("order") {
            Some("F") => (0..shape.len()).rev().collect(),
            _ => (0..shape.len()).collect(),
        };
        let layout = Layout { shape: chunks, axes, byte_order, compression: Compression::from_v2(metadata)? };
        let separator = if text("dimension_separator") == Some("/") { '/' } else { '.' };
        Self {
            folder: folder.into(),
            shape,
            element,
            fill: fill(metadata, element)?,
            layout,
            shards: None,
            separator,
            prefix: None,
        }
        .checked()
    }

    fn from_v3(folder: &Path, metadata: &Value) -> Result<Self, String> {
        let shape = sizes(metadata.get("shape")).ok_or("it has no shape")?;
        let kind = metadata.get("data_type").and_then(Value::as_str).unwrap_or("?");
        let element = if kind == "bool" { Some(Element::U8) } else { Element::from_name(kind) };
        let element = element.ok_or_else(|| {
            format!("its elements are `{kind}`; integers and 32- or 64-bit floats are supported")
        })?;
        let grid = Extension::new(metadata.get("chunk_grid"))?;
        if grid.name != "regular" {
            return Err(format!("its grid of chunks is `{}`, which is not supported", grid.name));
        }
        let chunks = sizes(grid.get("chunk_shape")).ok_or("it has no chunks")?;
        let keys = Extension::new(metadata.get("chunk_key_encoding"))?;
        let (prefix, usual) = match keys.name {
            "default" => (Some("c"), '/'),
            "v2" => (None, '.'),
            other => return Err(format!("its chunks are named as `{other}`, which is not supported")),
        };
        let separator = match keys.get("separator").and_then(Value::as_str) {
            Some("/") => '/',
            Some(".") => '.',
            _ => usual,
        };
        let (layout, shards) = codecs(metadata.get("codecs"), chunks, true)?;
        let fill = fill(metadata, element)?;
        Self { folder: folder.into(), shape, element, fill, layout, shards, separator, prefix }.checked()
    }

    /// Returns an error if the metadata of a Zarr array are inconsistent.
    fn checked(self) -> Result<Self, String> {
        let axes = self.shape.len();
        let outer = self.file_shape();
        if !(2..=MAX_AXES).contains(&axes) || outer.len() != axes || self.layout.shape.len() != axes {
            return Err(format!("it has {axes} axes, and its chunks {}", outer.len()));
        }
        if self.shape.iter().chain(outer).chain(&self.layout.shape).any(|n| *n == 0) {
            return Err("a size of it, or of its chunks, is 0".into());
        }
        let mut axes_found = self.layout.axes.clone();
        axes_found.sort_unstable();
        if !axes_found.into_iter().eq(0..axes) {
            return Err("the order of its axes is invalid (transpose)".into());
        }
        if let Some(shards) = &self.shards {
            let parts = shards.shape.iter().zip(&self.layout.shape);
            if parts.clone().any(|(shard, chunk)| shard % chunk != 0) {
                return Err("its shards are not cut into whole chunks".into());
            }
            let count = parts.fold(1usize, |n, (shard, chunk)| n.saturating_mul(shard / chunk));
            if count > MAX_SHARD_CHUNKS {
                return Err(format!("its shards hold {count} chunks; {MAX_SHARD_CHUNKS} are supported"));
            }
        }
        Ok(self)
    }

    /// Returns the number of elements of one chunk or shard file along each axis of the Zarr array.
    pub(super) fn file_shape(&self) -> &[usize] {
        self.shards.as_ref().map_or(&self.layout.shape, |shards| &shards.shape)
    }

    /// Returns the path of the Zarr chunk or shard file at an index of the chunk grid.
    pub(super) fn file_of(&self, place: &[usize]) -> PathBuf {
        let numbers = place.iter().map(ToString::to_string);
        let parts: Vec<String> = self.prefix.map(String::from).into_iter().chain(numbers).collect();
        self.folder.join(parts.join(&self.separator.to_string()))
    }

    /// Lists the existing metadata files of the Zarr array.
    pub(super) fn metadata_files(&self) -> Vec<PathBuf> {
        let all = ["zarr.json", ".zarray"].map(|name| self.folder.join(name));
        all.into_iter().filter(|file| file.is_file()).collect()
    }
}

/// Parses the fill value of a Zarr array; 0 if none is given.
fn fill(metadata: &Value, element: Element) -> Result<f64, String> {
    let refuse = |value: &Value| {
        let short: String = value.to_string().chars().take(40).collect();
        format!("its fill value {short} is no {}", element.name())
    };
    let is_float = matches!(element, Element::F32 | Element::F64);
    match metadata.get("fill_value") {
        None | Some(Value::Null) => Ok(0.0),
        Some(Value::Bool(on)) => Ok(f64::from(u8::from(*on))),
        Some(value @ Value::Number(number)) => number.as_f64().ok_or_else(|| refuse(value)),
        // Texts are `NaN`, `Infinity` and `-Infinity`.
        Some(value) => {
            let number = value.as_str().filter(|_| is_float).and_then(|text| text.parse().ok());
            number.ok_or_else(|| refuse(value))
        }
    }
}

/// Extension point of Zarr 3 metadata, such as a codec: a name and its configuration.
struct Extension<'a> {
    name: &'a str,
    configuration: Option<&'a Value>,
}

impl<'a> Extension<'a> {
    fn new(value: Option<&'a Value>) -> Result<Self, String> {
        let value = value.ok_or("its zarr.json lacks a required entry")?;
        let name = value.as_str().or_else(|| value.get("name")?.as_str());
        let name = name.ok_or("an entry of its zarr.json has no name")?;
        Ok(Self { name, configuration: value.get("configuration") })
    }

    fn get(&self, key: &str) -> Option<&'a Value> {
        self.configuration?.get(key)
    }
}

/// Parses the list of codecs of a Zarr 3 array with chunks of this shape; a shard codec is allowed if
/// `may_be_shards`.
fn codecs(
    list: Option<&Value>,
    shape: Vec<usize>,
    may_be_shards: bool,
) -> Result<(Layout, Option<Shards>), String> {
    let axes = (0..shape.len()).collect();
    let mut layout =
        Layout { shape, axes, byte_order: ByteOrder::Little, compression: Compression::default() };
    let mut shards = None;
    let list = list.and_then(Value::as_array).ok_or("it has no codecs")?;
    for codec in list {
        let codec = Extension::new(Some(codec))?;
        match codec.name {
            "transpose" => {
                let order = codec.get("order");
                layout.axes = match order.and_then(Value::as_str) {
                    Some("F") => (0..layout.shape.len()).rev().collect(),
                    Some(_) => layout.axes,
                    None => sizes(order).ok_or("the order of its axes is invalid (transpose)")?,
                };
            }
            "bytes" | "endian" => {
                let is_big = codec.get("endian").and_then(Value::as_str) == Some("big");
                layout.byte_order = if is_big { ByteOrder::Big } else { ByteOrder::Little };
            }
            "sharding_indexed" if may_be_shards && shards.is_none() => {
                if !layout.axes.iter().copied().eq(0..layout.shape.len()) {
                    return Err("its shards are transposed as a whole, which is not supported".into());
                }
                let inner = sizes(codec.get("chunk_shape")).ok_or("its shards have no chunks")?;
                shards = Some(Shards {
                    shape: std::mem::take(&mut layout.shape),
                    index_is_first: codec.get("index_location").and_then(Value::as_str) == Some("start"),
                    index_has_checksum: index_has_checksum(codec.get("index_codecs"))?,
                });
                layout = codecs(codec.get("codecs"), inner, false)?.0;
            }
            "sharding_indexed" => return Err("its shards are nested, which is not supported".into()),
            _ if shards.is_some() => {
                return Err("its shards are compressed as a whole, which is not supported".into());
            }
            codec => layout.compression.push(codec)?,
        }
    }
    Ok((layout, shards))
}

/// Whether the index of a Zarr shard has a checksum. An index that is compressed or big-endian is an error.
fn index_has_checksum(list: Option<&Value>) -> Result<bool, String> {
    let mut has_checksum = false;
    for codec in list.and_then(Value::as_array).into_iter().flatten() {
        let codec = Extension::new(Some(codec))?;
        match (codec.name, codec.get("endian").and_then(Value::as_str)) {
            ("bytes", Some("little") | None) => {}
            ("crc32c", _) => has_checksum = true,
            (other, _) => {
                return Err(format!(
                    "the index of its shards is written by `{other}`, which is not supported"
                ));
            }
        }
    }
    Ok(has_checksum)
}
