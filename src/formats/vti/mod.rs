//! Reads VTK XML images (`.vti`): one scalar array of an `ImageData`, from its points or else its cells.
//!
//! VTK defines no anatomical axes, so coordinates are taken as RAS+ mm, also in `.vtk` and `.vtp` files. If a file
//! has `SPACE=LPS` among its first bytes, x and y are negated.

mod skeleton;

use self::skeleton::Skeleton;
use super::assembly::Assembly;
use super::common::{affine, numbers, refusal, with_integer_warning};
use super::head::Head;
use super::text_numbers::TextNumbers;
use crate::error::Result;
use crate::files::input::says_lps;
use crate::files::loading::{Loading, ReadingStage, Watched};
use crate::files::memory_budget::refuse_beyond_host;
use crate::files::vtk_xml::{Coding, array_bytes, kind_of};
use crate::files::xml;
use crate::volume::element::grid_bytes;
use crate::volume::read::{ReadFailure, read_voxels};
use crate::volume::{AffineSource, ByteOrder, Element, Provenance, Scaling, Volume, Voxels};
use glam::{DMat3, DVec3};
use roxmltree::{Document, Node};
use std::fs::File;
use std::io::{self, BufRead, Read, Seek, SeekFrom};
use std::path::Path;

/// File extensions of the VTK XML image format.
pub const EXTENSIONS: &[&str] = &["vti"];

/// Largest accepted number of point-in-box tests that find out whether the `Piece` elements of a VTK image cover its
/// grid.
const MAX_COVER_TESTS: usize = 20_000_000;
/// Largest accepted number of XML nodes of a VTK image file.
const MAX_NODES: u32 = 200_000;

/// Whether a file is a VTK XML image.
pub fn is_vti(head: &Head) -> bool {
    !head.is_gzipped && kind_of(&head.bytes).is_some_and(|kind| kind == "ImageData")
}

/// Reads the active scalars of a VTK XML image, or its first scalar array, as a volume.
///
/// # Errors
/// The file cannot be read, is no VTK image, holds no scalars, or has fewer numbers than its header claims.
pub fn read_with(path: &Path, loading: &Loading) -> Result<Volume> {
    let refuse = refusal(path);
    loading.begin(ReadingStage::Reading);
    let open = || File::open(path).map_err(|e| e.to_string());
    let bytes = std::fs::metadata(path).map_err(|e| refuse(e.to_string()))?.len();
    let skeleton = open().and_then(Skeleton::new).map_err(&refuse)?;
    let document = xml::parse(&skeleton.text, MAX_NODES)
        .map_err(|e| refuse(format!("it is no XML file of VTK: {}", e.why)))?;
    let image = Image::new(&document, &skeleton, bytes).map_err(&refuse)?;
    let mut warnings = Vec::new();
    let (pieces, element) = image.pieces(&mut warnings).map_err(&refuse)?;
    let world_from_index = image.affine().map_err(&refuse)?;
    let open = || open().map(|file| Watched::new(file, bytes, loading));
    let voxels = image.voxels(&pieces, element, open).map_err(refuse)?;
    let provenance = Provenance {
        affine_source: AffineSource::Axes,
        warnings,
        ..Provenance::new(path.display().to_string(), "vti", element.describe(image.byte_order()))
    };
    let volume = Volume::new_with(voxels, Scaling::IDENTITY, world_from_index, provenance, loading)?;
    Ok(with_integer_warning(volume, element))
}

/// Position of the voxels of a VTK image: at the grid points or at the cell centres.
#[derive(Debug, Clone, Copy, PartialEq)]
enum At {
    Points,
    Cells,
}

/// VTK image, described by the tags of its XML file.
struct Image<'a, 'input> {
    node: Node<'a, 'input>,
    coding: Coding,
    skeleton: &'a Skeleton,
    file_bytes: u64,
    /// Index of the first and last grid point of the VTK image along x, y and z.
    extent: [[i64; 2]; 3],
    at: At,
}

/// `Piece` element of a VTK image, a sub-box of the grid with its data array.
struct Piece<'a, 'input> {
    /// Index of the first voxel of the VTK piece, and its number of voxels, along x, y and z.
    from: [usize; 3],
    dims: [usize; 3],
    array: Node<'a, 'input>,
}

impl<'a, 'input> Image<'a, 'input> {
    fn new(document: &'a Document<'input>, skeleton: &'a Skeleton, file_bytes: u64) -> Result<Self, String> {
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

    /// Returns the number of voxels along x, y and z of a VTK extent.
    fn dims(&self, extent: [[i64; 2]; 3]) -> Result<[usize; 3], String> {
        let more = i64::from(self.at == At::Points);
        let dims = extent.map(|[from, to]| to.checked_sub(from).and_then(|n| n.checked_add(more)));
        let dims = dims.map(|n| n.and_then(|n| usize::try_from(n).ok()).unwrap_or(0));
        match dims.contains(&0) {
            true => Err("its extent has no voxels along an axis".into()),
            false => Ok(dims),
        }
    }

    /// Finds the pieces of a VTK image with their data arrays, and the number type common to all.
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
                return Err("a piece of it is outside the image".into());
            };
            pieces.push(Piece { from: [x, y, z], dims: self.dims(part)?, array });
        }
        if self.at == At::Cells {
            warnings.push("its values belong to cells: each is placed at the centre of its cell".into());
        }
        Ok((pieces, element.ok_or("it has no pieces")?))
    }

    /// Parses the numbers of an XML attribute of the VTK image; the text `usual` is used if the attribute is missing.
    fn attribute<const N: usize>(&self, name: &str, usual: &str) -> Result<[f64; N], String> {
        let text = self.node.attribute(name).unwrap_or(usual);
        let found = numbers(text).and_then(|all| all.try_into().ok());
        found.ok_or_else(|| {
            format!("its {name} is `{}`, not {N} numbers", text.chars().take(60).collect::<String>())
        })
    }

    /// Returns the affine from voxel indices of the VTK image to world coordinates (RAS+, mm).
    fn affine(&self) -> Result<glam::DAffine3, String> {
        let (origin, spacing) = (self.attribute("Origin", "0 0 0")?, self.attribute("Spacing", "1 1 1")?);
        let (origin, spacing) = (DVec3::from_array(origin), DVec3::from_array(spacing));
        let rows = self.attribute("Direction", "1 0 0 0 1 0 0 0 1")?;
        let axes = DMat3::from_cols_array(&rows).transpose() * DMat3::from_diagonal(spacing);
        // Indices of VTK start at the image's extent, and cells are between points.
        let centre = if self.at == At::Cells { 0.5 } else { 0.0 };
        let first = DVec3::from_array(self.extent.map(|[from, _]| from as f64 + centre));
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
        refuse_beyond_host(grid_bytes(dims, element.memory_bytes()))?;
        if let [piece] = pieces {
            if piece.dims != dims {
                return Err("its piece is smaller than the image".into());
            }
            return self.read(piece, element, open()?);
        }
        let boxes: Vec<_> = pieces.iter().map(|piece| (piece.from, piece.dims)).collect();
        if !cover(&boxes, dims)? {
            return Err("its pieces do not cover the image".into());
        }
        let mut whole = Assembly::new(dims);
        for piece in pieces {
            whole.put(self.read(piece, element, open()?)?, piece.from)?;
        }
        whole.finish().ok_or_else(|| "it has no pieces".into())
    }

    /// Reads the voxels of a `Piece` element of a VTK image.
    fn read<R: Read + Seek>(
        &self,
        piece: &Piece<'_, '_>,
        element: Element,
        mut file: R,
    ) -> Result<Voxels, String> {
        let array = piece.array;
        let name = array.attribute("Name").unwrap_or("?");
        let named = |why: String| format!("array `{name}`: {why}");
        let bytes = grid_bytes(piece.dims, element.bytes() as u64)
            .ok_or("more voxels than can be counted are claimed")?;
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
        let format = array.attribute("format").unwrap_or("not given");
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
        let mut input = io::BufReader::with_capacity(1 << 16, file.take(length));
        if format == "ascii" {
            // A number and its separator take at least two bytes.
            if count > length / 2 + 1 {
                return Err(named(format!("{count} numbers are claimed in {length} bytes")));
            }
            let mut numbers = TextNumbers::new(input, element, count);
            return read_voxels(&mut numbers, piece.dims, element, ByteOrder::Little, None).map_err(failed);
        }
        let check = |found: u64| match found == bytes {
            true => Ok(()),
            false => {
                Err(format!("it holds {found} bytes, and {nx}x{ny}x{nz} {} have {bytes}", element.name()))
            }
        };
        while !is_raw && input.fill_buf().map_err(io_error)?.first().is_some_and(u8::is_ascii_whitespace) {
            input.consume(1);
        }
        let mut stream = array_bytes(input, is_raw, &self.coding, check).map_err(named)?;
        read_voxels(&mut stream, piece.dims, element, self.byte_order(), None).map_err(failed)
    }
}

/// Lists the `DataArray` elements below an XML node of a VTK image, for point or cell data.
fn arrays<'a, 'input>(node: Node<'a, 'input>, data: &str) -> impl Iterator<Item = Node<'a, 'input>> {
    let of: Vec<Node> = node.descendants().filter(|n| n.has_tag_name(data)).collect();
    of.into_iter().flat_map(|n| n.children()).filter(|n| n.has_tag_name("DataArray"))
}

/// Lists the VTK data arrays with one number per voxel below an XML node.
fn scalars<'a, 'input>(node: Node<'a, 'input>, data: &str) -> impl Iterator<Item = Node<'a, 'input>> {
    arrays(node, data).filter(|n| n.attribute("NumberOfComponents").is_none_or(|count| count == "1"))
}

/// Parses a VTK extent: index of the first and last grid point along x, y and z.
fn extent(node: Node<'_, '_>, name: &str) -> Result<[[i64; 2]; 3], String> {
    let text = node.attribute(name).unwrap_or_default();
    let all: Option<Vec<i64>> = text.split_ascii_whitespace().map(|n| n.parse().ok()).collect();
    match all.as_deref() {
        Some([a, b, c, d, e, f]) => Ok([[*a, *b], [*c, *d], [*e, *f]]),
        _ => Err(format!("its {name} is `{}`", text.chars().take(60).collect::<String>())),
    }
}

/// Whether boxes, given by first voxel and size, cover a whole voxel grid; they may overlap.
fn cover(boxes: &[([usize; 3], [usize; 3])], dims: [usize; 3]) -> Result<bool, String> {
    // Voxels between neighbouring box ends are in the same boxes.
    let ends: [Vec<usize>; 3] = std::array::from_fn(|a| {
        let of_boxes = boxes.iter().flat_map(|(from, size)| [from[a], from[a].saturating_add(size[a])]);
        let mut ends: Vec<usize> = of_boxes.chain([0]).filter(|end| *end < dims[a]).collect();
        ends.sort_unstable();
        ends.dedup();
        ends
    });
    let places = ends.iter().map(Vec::len).product::<usize>();
    if places.saturating_mul(boxes.len()) > MAX_COVER_TESTS {
        return Err(format!("its {} pieces are too many to combine", boxes.len()));
    }
    let is_in = |at: [usize; 3]| {
        boxes.iter().any(|(from, size)| (0..3).all(|a| at[a] >= from[a] && at[a] - from[a] < size[a]))
    };
    let [x, y, z] = &ends;
    Ok(z.iter().all(|k| y.iter().all(|j| x.iter().all(|i| is_in([*i, *j, *k])))))
}
