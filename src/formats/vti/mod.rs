//! VTK XML images, `.vti`: one scalar array of an `ImageData`, of its points or else its cells.
//!
//! Places are world mm, RAS+, as they stand: VTK knows no patient, and `.vtk` and `.vtp` are read so, too; a file that says
//! `SPACE=LPS` among its first bytes has x and y turned about.

mod skeleton;

use self::skeleton::Skeleton;
use super::head::Head;
use super::source::inexact_integers;
use super::text_header::{affine, numbers};
use super::text_numbers::TextNumbers;
use crate::error::{Error, Result};
use crate::files::input::says_lps;
use crate::files::loading::{Loading, ReadingStage, Watched};
use crate::files::memory_budget::refuse_beyond_host;
use crate::files::vtk_xml::{Coding, array_bytes, kind_of};
use crate::files::xml;
use crate::volume::element::{ByteOrder, Element, ReadFailure, data_bytes, read_voxels};
use crate::volume::{AffineSource, Provenance, Scaling, Volume, Voxels};
use glam::{DMat3, DVec3};
use ndarray::{Array3, s};
use roxmltree::{Document, Node};
use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::Path;

/// File-name endings of the format.
pub const EXTENSIONS: &[&str] = &["vti"];

/// Places between the ends of pieces, times pieces, that are looked at.
const MOST_PLACES: usize = 20_000_000;
/// Nodes of no image's tags are more.
const NODES_MOST: u32 = 200_000;
/// Pieces that an image is cut into.
const PIECES_MOST: usize = 4096;

/// Whether a file is of this format.
pub fn is_vti(head: &Head) -> bool {
    !head.is_packed() && kind_of(head.bytes()).is_some_and(|kind| kind == "ImageData")
}

/// Reads the active scalars, or the first ones of one number at each voxel.
///
/// # Errors
/// The file cannot be read, is no image, holds no scalars, or has fewer numbers than its header claims.
pub fn read_with(path: &Path, loading: &Loading) -> Result<Volume> {
    let refuse = |why: String| Error::input("cannot read volume", path.display(), why);
    loading.begin(ReadingStage::Reading);
    let open = || File::open(path).map_err(|e| e.to_string());
    let bytes = std::fs::metadata(path).map_err(|e| refuse(e.to_string()))?.len();
    let skeleton = open().and_then(Skeleton::of).map_err(refuse)?;
    let document = xml::parse(&skeleton.text, NODES_MOST)
        .map_err(|e| refuse(format!("it is no XML file of VTK: {}", e.why)))?;
    let image = Image::of(&document, &skeleton, bytes).map_err(refuse)?;
    let mut warnings = Vec::new();
    let (pieces, element) = image.pieces(&mut warnings).map_err(refuse)?;
    let world_from_index = image.placed().map_err(refuse)?;
    let open = || open().map(|file| Watched::new(file, bytes, loading));
    let voxels = image.voxels(&pieces, element, open).map_err(refuse)?;
    warnings.extend(inexact_integers(&voxels, element));
    let provenance = Provenance {
        affine_source: AffineSource::Axes,
        warnings,
        ..Provenance::new(path.display().to_string(), "vti", element.describe(image.byte_order()))
    };
    Volume::new_with(voxels, Scaling::IDENTITY, world_from_index, provenance, loading)
}

/// Whether voxels are at points of the grid or between them.
#[derive(Debug, Clone, Copy, PartialEq)]
enum At {
    Points,
    Cells,
}

/// What the tags say.
struct Image<'a, 'input> {
    node: Node<'a, 'input>,
    coding: Coding,
    skeleton: &'a Skeleton,
    file_bytes: u64,
    /// First and last point along x, y and z.
    extent: [[i64; 2]; 3],
    at: At,
}

/// A part of the grid and the array that holds it.
struct Piece<'a, 'input> {
    /// The voxel at which it begins, and how many it has.
    from: [usize; 3],
    dims: [usize; 3],
    array: Node<'a, 'input>,
}

impl<'a, 'input> Image<'a, 'input> {
    fn of(document: &'a Document<'input>, skeleton: &'a Skeleton, file_bytes: u64) -> Result<Self, String> {
        let root = document.root_element();
        let node = root.children().find(|node| node.has_tag_name("ImageData"));
        let node = node.filter(|_| root.has_tag_name("VTKFile")).ok_or("it has no ImageData")?;
        let extent = extent(node, "WholeExtent")?;
        let has = |data: &str| scalars(node, data).next().is_some();
        let at = if has("PointData") || !has("CellData") { At::Points } else { At::Cells };
        Ok(Self { node, coding: Coding::of(root)?, skeleton, file_bytes, extent, at })
    }

    fn byte_order(&self) -> ByteOrder {
        if self.coding.big_endian { ByteOrder::Big } else { ByteOrder::Little }
    }

    /// Voxels of an extent.
    fn dims(&self, extent: [[i64; 2]; 3]) -> Result<[usize; 3], String> {
        let more = i64::from(self.at == At::Points);
        let dims = extent.map(|[from, to]| to.checked_sub(from).and_then(|n| n.checked_add(more)));
        let dims = dims.map(|n| n.and_then(|n| usize::try_from(n).ok()).unwrap_or(0));
        match dims.contains(&0) {
            true => Err("its extent has no voxels along an axis".into()),
            false => Ok(dims),
        }
    }

    /// The pieces with their arrays, and the type of all of these.
    fn pieces(&self, warnings: &mut Vec<String>) -> Result<(Vec<Piece<'a, 'input>>, Element), String> {
        let data = if self.at == At::Points { "PointData" } else { "CellData" };
        let named = self
            .node
            .descendants()
            .find_map(|n| n.has_tag_name(data).then(|| n.attribute("Scalars")).flatten());
        let mut candidates: Vec<&str> =
            scalars(self.node, data).filter_map(|n| n.attribute("Name")).collect();
        candidates.dedup();
        let all: Vec<Node> = self.node.children().filter(|node| node.has_tag_name("Piece")).collect();
        if all.len() > PIECES_MOST {
            return Err(format!("it has {} pieces; {PIECES_MOST} are read", all.len()));
        }
        let (mut pieces, mut element) = (Vec::new(), None);
        for node in all {
            let array = match named {
                Some(name) => arrays(node, data).find(|n| n.attribute("Name") == Some(name)),
                None => scalars(node, data).next(),
            };
            let array = array.ok_or("it has no array of one number at each voxel")?;
            let components = array.attribute("NumberOfComponents").unwrap_or("1");
            let name = array.attribute("Name").unwrap_or("?");
            if components != "1" {
                return Err(format!(
                    "its scalars `{name}` are {components} numbers at each voxel; scalars are needed"
                ));
            }
            let kind = array.attribute("type").unwrap_or_default();
            let of = Element::from_name(&kind.to_lowercase())
                .ok_or_else(|| format!("array `{name}`: numbers of the kind `{kind}`"))?;
            if *element.get_or_insert(of) != of {
                return Err("its pieces are of several types".into());
            }
            if pieces.is_empty() && candidates.len() > 1 {
                warnings.push(format!("{} arrays: `{name}` was read", candidates.len()));
            }
            let part = extent(node, "Extent")?;
            let from = std::array::from_fn(|axis| {
                part[axis][0].checked_sub(self.extent[axis][0]).and_then(|n| usize::try_from(n).ok())
            });
            let [Some(x), Some(y), Some(z)] = from else {
                return Err("a piece of it lies beside the image".into());
            };
            pieces.push(Piece { from: [x, y, z], dims: self.dims(part)?, array });
        }
        if self.at == At::Cells {
            warnings.push("its values are of cells: each is placed in the middle of its own".into());
        }
        Ok((pieces, element.ok_or("it has no pieces")?))
    }

    /// World mm from index coordinates.
    fn placed(&self) -> Result<glam::DAffine3, String> {
        let read = |name: &str, usual: &str| {
            let text = self.node.attribute(name).unwrap_or(usual);
            numbers(text)
                .ok_or_else(|| format!("its {name} is `{}`", text.chars().take(60).collect::<String>()))
        };
        let wrong = |name: &str| format!("its {name} has too few or too many numbers");
        let triple = |name: &str, usual: &str| {
            <[f64; 3]>::try_from(read(name, usual)?).map(DVec3::from_array).map_err(|_| wrong(name))
        };
        let (origin, spacing) = (triple("Origin", "0 0 0")?, triple("Spacing", "1 1 1")?);
        let rows =
            <[f64; 9]>::try_from(read("Direction", "1 0 0 0 1 0 0 0 1")?).map_err(|_| wrong("Direction"))?;
        let axes = DMat3::from_cols_array(&rows).transpose() * DMat3::from_diagonal(spacing);
        // Indices of VTK count from the image's extent, and cells lie between points.
        let middle = if self.at == At::Cells { 0.5 } else { 0.0 };
        let first = DVec3::from_array(self.extent.map(|[from, _]| from as f64 + middle));
        let is_lps = says_lps(self.skeleton.text.as_bytes());
        Ok(affine([axes.x_axis, axes.y_axis, axes.z_axis], origin + axes * first, is_lps))
    }

    fn voxels<R: Read + Seek>(
        &self,
        pieces: &[Piece<'_, '_>],
        element: Element,
        open: impl Fn() -> Result<R, String>,
    ) -> Result<Voxels, String> {
        let dims = self.dims(self.extent)?;
        let kept = |dims: [usize; 3]| {
            dims.iter().try_fold(element.kept_bytes() as u64, |bytes, n| bytes.checked_mul(*n as u64))
        };
        refuse_beyond_host(kept(dims))?;
        if let [piece] = pieces {
            if piece.dims != dims {
                return Err("its piece is smaller than the image".into());
            }
            return self.read(piece, element, open()?);
        }
        let boxes: Vec<_> = pieces.iter().map(|piece| (piece.from, piece.dims)).collect();
        if !cover(&boxes, dims)? {
            return Err("its pieces leave voxels of the image out".into());
        }
        let mut whole = None;
        for piece in pieces {
            let read = self.read(piece, element, open()?)?;
            put(&mut whole, read, dims, piece.from)?;
        }
        whole.ok_or_else(|| "it has no pieces".into())
    }

    /// The voxels of a piece.
    fn read<R: Read + Seek>(
        &self,
        piece: &Piece<'_, '_>,
        element: Element,
        mut file: R,
    ) -> Result<Voxels, String> {
        let array = piece.array;
        let name = array.attribute("Name").unwrap_or("?");
        let named = |why: String| format!("array `{name}`: {why}");
        let bytes = data_bytes(piece.dims, element).ok_or("more voxels than can be counted are claimed")?;
        let count = bytes / element.bytes() as u64;
        let [nx, ny, nz] = piece.dims;
        let failed = |failure: ReadFailure| {
            named(match failure {
                ReadFailure::Short { got } => {
                    format!(
                        "{nx}x{ny}x{nz} {} are claimed, {bytes} bytes, but it ends after {got}",
                        element.name()
                    )
                }
                other => other.to_string(),
            })
        };
        let inside = || {
            let number = array.text().and_then(|number| number.parse::<usize>().ok());
            number.and_then(|number| self.skeleton.arrays.get(number)).copied().ok_or("it has no numbers")
        };
        let format = array.attribute("format").unwrap_or("not said");
        let (from, length, is_raw) = match (format, self.skeleton.appended) {
            ("ascii" | "binary", _) => {
                let [from, length] = inside().map_err(|why| named(why.into()))?;
                (from, length, false)
            }
            ("appended", Some((data, is_raw))) => {
                let text = array.attribute("offset").unwrap_or_default();
                let offset =
                    text.trim().parse::<u64>().map_err(|_| named(format!("its offset is `{text}`")))?;
                let from = data.checked_add(offset).filter(|from| *from < self.file_bytes);
                let from = from.ok_or_else(|| named(format!("its offset {offset} is beyond the file")))?;
                (from, self.file_bytes - from, is_raw)
            }
            ("appended", None) => return Err(named("the file has no appended data".into())),
            (other, _) => return Err(named(format!("its format is {other}"))),
        };
        let io_error = |e: io::Error| named(e.to_string());
        file.seek(SeekFrom::Start(from)).map_err(io_error)?;
        let input = io::BufReader::with_capacity(1 << 16, file.take(length));
        if format == "ascii" {
            // A number and its blank take two bytes at the least.
            if count > length / 2 + 1 {
                return Err(named(format!("{count} numbers are claimed in {length} bytes")));
            }
            let mut numbers = TextNumbers::new(input, element, count);
            return read_voxels(&mut numbers, piece.dims, element, ByteOrder::Little).map_err(failed);
        }
        let check = |said: u64| match said == bytes {
            true => Ok(()),
            false => {
                Err(format!("it holds {said} bytes, and {nx}x{ny}x{nz} {} have {bytes}", element.name()))
            }
        };
        let input = Trimmed { input, begun: is_raw };
        let mut stream = array_bytes(input, is_raw, &self.coding, check).map_err(named)?;
        read_voxels(&mut stream, piece.dims, element, self.byte_order()).map_err(failed)
    }
}

/// A text without the blanks before it.
struct Trimmed<R> {
    input: R,
    begun: bool,
}

impl<R: Read> Read for Trimmed<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while !self.begun && !buffer.is_empty() {
            let mut byte = [0];
            if self.input.read(&mut byte)? == 0 {
                return Ok(0);
            }
            if !byte[0].is_ascii_whitespace() {
                self.begun = true;
                buffer[0] = byte[0];
                return Ok(1);
            }
        }
        self.input.read(buffer)
    }
}

/// The arrays of a piece, or of all pieces below a node.
fn arrays<'a, 'input>(node: Node<'a, 'input>, data: &str) -> impl Iterator<Item = Node<'a, 'input>> {
    let of: Vec<Node> = node.descendants().filter(|n| n.has_tag_name(data)).collect();
    of.into_iter().flat_map(|n| n.children()).filter(|n| n.has_tag_name("DataArray"))
}

/// Those of one number at each voxel.
fn scalars<'a, 'input>(node: Node<'a, 'input>, data: &str) -> impl Iterator<Item = Node<'a, 'input>> {
    arrays(node, data).filter(|n| n.attribute("NumberOfComponents").is_none_or(|count| count == "1"))
}

/// First and last point along x, y and z.
fn extent(node: Node<'_, '_>, name: &str) -> Result<[[i64; 2]; 3], String> {
    let text = node.attribute(name).unwrap_or_default();
    let all: Option<Vec<i64>> = text.split_ascii_whitespace().map(|n| n.parse().ok()).collect();
    match all.as_deref() {
        Some([a, b, c, d, e, f]) => Ok([[*a, *b], [*c, *d], [*e, *f]]),
        _ => Err(format!("its {name} is `{}`", text.chars().take(60).collect::<String>())),
    }
}

/// Whether boxes, each from a voxel on and so many along each axis, leave no voxel of a grid out; they may overlap.
fn cover(boxes: &[([usize; 3], [usize; 3])], dims: [usize; 3]) -> Result<bool, String> {
    // Between neighbouring ends of boxes all voxels are in the same ones.
    let ends: [Vec<usize>; 3] = std::array::from_fn(|a| {
        let of_boxes = boxes.iter().flat_map(|(from, size)| [from[a], from[a].saturating_add(size[a])]);
        let mut ends: Vec<usize> = of_boxes.chain([0]).filter(|end| *end < dims[a]).collect();
        ends.sort_unstable();
        ends.dedup();
        ends
    });
    let places = ends.iter().map(Vec::len).product::<usize>();
    if places.saturating_mul(boxes.len()) > MOST_PLACES {
        return Err(format!("its {} pieces are too many to be put together", boxes.len()));
    }
    let is_in = |at: [usize; 3]| {
        boxes.iter().any(|(from, size)| (0..3).all(|a| at[a] >= from[a] && at[a] - from[a] < size[a]))
    };
    let [x, y, z] = &ends;
    Ok(z.iter().all(|k| y.iter().all(|j| x.iter().all(|i| is_in([*i, *j, *k])))))
}

/// Puts a piece where it belongs; those before it have made the whole.
fn put(whole: &mut Option<Voxels>, piece: Voxels, dims: [usize; 3], from: [usize; 3]) -> Result<(), String> {
    fn place<T: Copy>(whole: &mut Array3<T>, piece: &Array3<T>, [x, y, z]: [usize; 3]) -> Result<(), String> {
        let (nz, ny, nx) = piece.dim();
        let fits = whole.dim().0 >= z.saturating_add(nz)
            && whole.dim().1 >= y.saturating_add(ny)
            && whole.dim().2 >= x.saturating_add(nx);
        if !fits {
            return Err("a piece of it lies beside the image".into());
        }
        whole.slice_mut(s![z..z + nz, y..y + ny, x..x + nx]).assign(piece);
        Ok(())
    }
    let [nx, ny, nz] = dims;
    macro_rules! put {
        ($kind:ident, $piece:expr) => {{
            match whole.get_or_insert_with(|| Voxels::$kind(Array3::zeros((nz, ny, nx)))) {
                Voxels::$kind(whole) => place(whole, &$piece, from),
                _ => Err("its pieces are of several types".into()),
            }
        }};
    }
    match piece {
        Voxels::U8(piece) => put!(U8, piece),
        Voxels::I16(piece) => put!(I16, piece),
        Voxels::U16(piece) => put!(U16, piece),
        Voxels::F32(piece) => put!(F32, piece),
        Voxels::F64(piece) => put!(F64, piece),
    }
}
