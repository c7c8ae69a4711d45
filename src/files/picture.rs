//! Writes and reads image files: PNG, OpenEXR and NPY.

use super::color::srgb8_from_linear;
use super::output::{extension_or_first, write_whole};
use crate::error::{Error, Result};
use exr::prelude::{Image, SpecificChannels, Text, Vec2, WritableImage as _};
use ndarray::Array3;
use ndarray_npy::WriteNpyExt;
use png::text_metadata::{EncodableTextChunk, ITXtChunk};
use std::fs::File;
use std::io::{BufReader, Cursor, Read as _};
use std::path::Path;

/// File name extensions of the supported image formats.
pub const PICTURE_EXTENSIONS: &[&str] = &["png", "exr", "npy"];

/// Whether an image or animation file includes the background behind the volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Backdrop {
    /// Opaque image, which shows the background over which the picture was drawn.
    #[default]
    Drawn,
    /// Transparent image without background. The picture was drawn over black, so its colours are premultiplied by
    /// opacity.
    LeftOut,
}

/// Writes a picture to an image file: `height x width x 4`, linear RGB composited over the background, and opacity
/// `1 - T_eye` (`T_eye`: transmittance along the eye ray). The extension selects the format: `.png` (8-bit sRGB,
/// opaque), `.exr` (linear, 32-bit float RGBA) or `.npy` (float32, all four channels unchanged).
///
/// # Errors
/// The file name extension is unknown, or the file cannot be written.
///
/// # Panics
/// The picture does not have four channels.
pub fn write_picture(path: &Path, picture: &Array3<f32>) -> Result<()> {
    write_picture_with(path, picture, Backdrop::Drawn, &[])
}

/// Writes a picture to an image file, with or without background, and with text metadata.
///
/// Without a background, a `.png` is RGBA with straight (unassociated) alpha, as the PNG standard demands. The
/// colours of an `.exr` or `.npy` are premultiplied by (associated with) the opacity, as OpenEXR's convention
/// demands. Each metadata text has a key. A `.png` stores them in `iTXt` chunks, an `.exr` in its attribute
/// `comments`; an `.npy` stores none.
///
/// # Errors
/// The file name extension is unknown, or the file cannot be written.
///
/// # Panics
/// The picture does not have four channels.
pub fn write_picture_with(
    path: &Path,
    picture: &Array3<f32>,
    backdrop: Backdrop,
    texts: &[(String, String)],
) -> Result<()> {
    assert_eq!(picture.dim().2, 4, "a picture is height x width x 4");
    // The encoders need a seekable output, so pictures are encoded in memory.
    let mut bytes = Vec::new();
    let encoded = match extension_or_first(path, PICTURE_EXTENSIONS)? {
        "png" => {
            bytes = png(picture, backdrop, texts)?;
            Ok(())
        }
        "exr" => exr(picture, texts, &mut bytes),
        _ => picture.as_standard_layout().write_npy(&mut bytes).map_err(|e| e.to_string()),
    };
    encoded.map_err(|why| Error::runtime(WHAT, path.display(), why))?;
    write_whole(path, |file| file.write_all(&bytes))
}

const WHAT: &str = "cannot encode picture";

/// Encodes a picture as an OpenEXR file, 32-bit float RGBA, with text metadata (UTF-8) in the attribute `comments`.
fn exr(picture: &Array3<f32>, texts: &[(String, String)], bytes: &mut Vec<u8>) -> Result<(), String> {
    let (height, width, _) = picture.dim();
    let pixel = |at: Vec2<usize>| {
        let channel = |c| picture[[at.y(), at.x(), c]];
        (channel(0), channel(1), channel(2), channel(3))
    };
    let mut image = Image::from_channels((width, height), SpecificChannels::rgba(pixel));
    // One attribute for all keys: the library writes several in any order, but equal pictures must give equal files.
    image.layer_data.attributes.comments =
        joined(texts).map(|lines| Text::from_slice_unchecked(lines.as_bytes()));
    image.write().to_buffered(Cursor::new(bytes)).map_err(|e| e.to_string())
}

/// Joins the text metadata of an image file to one text of lines `key: text`; `None` if there is none.
pub(super) fn joined(texts: &[(String, String)]) -> Option<String> {
    let lines: Vec<String> = texts.iter().map(|(key, text)| format!("{key}: {text}")).collect();
    (!lines.is_empty()).then(|| lines.join("\n"))
}

/// Reads an `.exr` image file that [`write_picture`] has written; every value is bit-identical.
///
/// # Errors
/// The file cannot be read, or is not an OpenEXR image.
pub fn read_exr(path: &Path) -> Result<Array3<f32>> {
    let fail = |why: String| Error::input("cannot read picture", path.display(), why);
    let mut reader = image::ImageReader::open(path).map_err(|e| fail(e.to_string()))?;
    reader.set_format(image::ImageFormat::OpenExr);
    let picture = reader.decode().map_err(|e| fail(e.to_string()))?.into_rgba32f();
    let shape = (picture.height() as usize, picture.width() as usize, 4);
    Array3::from_shape_vec(shape, picture.into_raw()).map_err(|e| fail(e.to_string()))
}

/// Encodes a picture as the bytes of a PNG file: 8-bit sRGB, opaque.
///
/// # Errors
/// The encoder fails.
pub fn picture_png(picture: &Array3<f32>) -> Result<Vec<u8>> {
    png(picture, Backdrop::Drawn, &[])
}

fn png(picture: &Array3<f32>, backdrop: Backdrop, texts: &[(String, String)]) -> Result<Vec<u8>> {
    let (height, width, _) = picture.dim();
    encode_png(&codes(picture, backdrop), [width as u32, height as u32], color_type(backdrop), texts)
}

/// PNG colour type of an image: RGB with background, RGBA without.
pub(super) fn color_type(backdrop: Backdrop) -> png::ColorType {
    match backdrop {
        Backdrop::Drawn => png::ColorType::Rgb,
        Backdrop::LeftOut => png::ColorType::Rgba,
    }
}

/// Converts a linear RGBA picture to 8-bit sRGB pixels, with an alpha channel if it has no background.
pub(super) fn codes(picture: &Array3<f32>, backdrop: Backdrop) -> Vec<u8> {
    let pixels = picture.rows().into_iter().map(|p| [0, 1, 2, 3].map(|c| f64::from(p[c])));
    let opaque = |[r, g, b, _]: [f64; 4]| [r, g, b].map(srgb8_from_linear);
    match backdrop {
        Backdrop::Drawn => pixels.flat_map(opaque).collect(),
        Backdrop::LeftOut => pixels.flat_map(straight_srgb8).collect(),
    }
}

/// Encodes 8-bit pixels as the bytes of a PNG file with text metadata.
fn encode_png(
    codes: &[u8],
    [width, height]: [u32; 2],
    kind: png::ColorType,
    texts: &[(String, String)],
) -> Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let mut encode = || {
        let mut writer = png_encoder(&mut bytes, [width, height], kind, texts)?.write_header()?;
        writer.write_image_data(codes)?;
        writer.finish()
    };
    encode().map_err(|e: png::EncodingError| Error::runtime(WHAT, "PNG", e))?;
    Ok(bytes)
}

/// Creates a PNG encoder for 8 bits per channel, with text metadata.
pub(super) fn png_encoder<W: std::io::Write>(
    output: W,
    [width, height]: [u32; 2],
    kind: png::ColorType,
    texts: &[(String, String)],
) -> Result<png::Encoder<'static, W>, png::EncodingError> {
    let mut encoder = png::Encoder::new(output, width, height);
    encoder.set_color(kind);
    encoder.set_depth(png::BitDepth::Eight);
    for (key, text) in texts {
        encoder.add_itxt_chunk(key.clone(), text.clone())?;
    }
    Ok(encoder)
}

/// Encodes an 8-bit RGB picture as the bytes of a PNG file with text metadata.
///
/// # Errors
/// The encoder fails.
pub fn rgb_png(picture: &image::RgbImage, texts: &[(String, String)]) -> Result<Vec<u8>> {
    encode_png(picture.as_raw(), [picture.width(), picture.height()], png::ColorType::Rgb, texts)
}

/// Length in bytes of the PNG signature and header chunk, after which text chunks are inserted.
const PNG_HEADER: usize = 33;

/// Inserts text metadata into an encoded PNG file, as `iTXt` chunks.
///
/// # Errors
/// The file is too short for a PNG file, or a key is not a valid PNG keyword.
pub fn with_texts(mut file: Vec<u8>, texts: &[(String, String)]) -> Result<Vec<u8>> {
    if file.len() < PNG_HEADER {
        return Err(Error::runtime(WHAT, "PNG", "it is cut off"));
    }
    let mut chunks = Vec::new();
    for (key, text) in texts {
        let chunk = ITXtChunk::new(key, text);
        chunk.encode(&mut chunks).map_err(|e| Error::runtime(WHAT, "PNG", e))?;
    }
    file.splice(PNG_HEADER..PNG_HEADER, chunks);
    Ok(file)
}

/// First bytes of every PNG file.
const PNG_SIGNATURE: [u8; 8] = *b"\x89PNG\r\n\x1a\n";

/// Returns whether the first bytes of a file are those of a PNG file. A pipe, which can be read once, is none.
pub fn is_png(path: &Path) -> bool {
    let mut head = [0; PNG_SIGNATURE.len()];
    path.is_file()
        && File::open(path).and_then(|mut file| file.read_exact(&mut head)).is_ok()
        && head == PNG_SIGNATURE
}

/// Reads a text of the metadata of a PNG file by its key; `None` if there is no such text before the pixels.
///
/// # Errors
/// The file cannot be read, or is no PNG file.
pub fn png_text(path: &Path, key: &str) -> Result<Option<String>> {
    let fail = |why: String| Error::input("cannot read picture", path.display(), why);
    let file = File::open(path).map_err(|e| fail(e.to_string()))?;
    let reader = png::Decoder::new(BufReader::new(file)).read_info().map_err(|e| fail(e.to_string()))?;
    let chunk = reader.info().utf8_text.iter().find(|chunk| chunk.keyword == key);
    chunk.map(|chunk| chunk.get_text().map_err(|e| fail(e.to_string()))).transpose()
}

/// Converts a linear colour that is premultiplied by its opacity to 8-bit sRGB with straight alpha; black if the
/// opacity is 0.
fn straight_srgb8([r, g, b, opacity]: [f64; 4]) -> [u8; 4] {
    let code = |linear: f64| if opacity > 0.0 { srgb8_from_linear(linear / opacity) } else { 0 };
    [code(r), code(g), code(b), (opacity.clamp(0.0, 1.0) * 255.0).round() as u8]
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::ImageReader;
    use ndarray_npy::ReadNpyExt;

    fn picture() -> Array3<f32> {
        Array3::from_shape_fn((3, 5, 4), |(j, i, c)| match c {
            3 => 0.25,
            _ => (j * 5 + i) as f32 / 7.0 + c as f32 * 0.01,
        })
    }

    #[test]
    fn npy_and_exr_keep_every_bit() {
        let dir = tempfile::tempdir().unwrap();
        let (npy, exr) = (dir.path().join("a.npy"), dir.path().join("a.EXR"));
        write_picture(&npy, &picture()).unwrap();
        write_picture(&exr, &picture()).unwrap();
        assert_eq!(Array3::<f32>::read_npy(std::fs::File::open(&npy).unwrap()).unwrap(), picture());
        let mut reader = ImageReader::open(&exr).unwrap();
        reader.set_format(image::ImageFormat::OpenExr);
        let read = reader.decode().unwrap().into_rgba32f();
        assert_eq!((read.width(), read.height()), (5, 3));
        assert_eq!(read.into_raw(), picture().into_raw_vec_and_offset().0);
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 2);
    }

    #[test]
    fn texts_are_in_the_file_and_the_pixels_are_as_without() {
        let dir = tempfile::tempdir().unwrap();
        let (plain, described) = (dir.path().join("a.png"), dir.path().join("b.png"));
        let texts = [("Software", "umbravox"), ("umbravox:scene", "name = 'Kopf ä \u{2192}'\nfov = 40\n")]
            .map(|(key, text)| (key.to_owned(), text.to_owned()));
        write_picture(&plain, &picture()).unwrap();
        write_picture_with(&described, &picture(), Backdrop::Drawn, &texts).unwrap();
        let pixels = |path: &Path| ImageReader::open(path).unwrap().decode().unwrap().to_rgb8();
        assert_eq!(pixels(&plain), pixels(&described));
        let read = |bytes: Vec<u8>| {
            let reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
            let chunks = reader.info().utf8_text.iter();
            chunks.map(|c| (c.keyword.clone(), c.get_text().unwrap())).collect::<Vec<_>>()
        };
        assert_eq!(read(std::fs::read(&described).unwrap()), texts);
        // Texts can also be added later.
        let added = with_texts(std::fs::read(&plain).unwrap(), &texts).unwrap();
        assert_eq!(image::load_from_memory(&added).unwrap().to_rgb8(), pixels(&plain));
        assert_eq!(read(added), texts);
        assert!(with_texts(b"no picture".to_vec(), &texts).is_err());

        let described = dir.path().join("b.exr");
        write_picture_with(&described, &picture(), Backdrop::Drawn, &texts).unwrap();
        assert_eq!(read_exr(&described).unwrap(), picture());
        let meta = exr::meta::MetaData::read_from_file(&described, false).unwrap();
        let comments = meta.headers[0].own_attributes.comments.as_ref().unwrap().as_slice().to_vec();
        let expected = format!("Software: umbravox\numbravox:scene: {}", texts[1].1);
        assert_eq!(String::from_utf8(comments).unwrap(), expected);
    }

    #[test]
    fn png_is_srgb_and_opaque() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.png");
        let mut p = picture();
        p[[0, 0, 0]] = 0.502_886;
        p[[0, 0, 1]] = f32::NAN;
        p[[0, 0, 2]] = 9.0;
        write_picture(&path, &p).unwrap();
        let read = ImageReader::open(&path).unwrap().decode().unwrap();
        assert_eq!(read.color(), image::ColorType::Rgb8);
        assert_eq!(read.to_rgb8().get_pixel(0, 0).0, [188, 0, 255]);
    }

    #[test]
    fn without_its_background_a_picture_goes_over_any_other() {
        let dir = tempfile::tempdir().unwrap();
        // Colour c and opacity a over black: times a. Over grey 0.5 it would be c a + 0.5 (1 - a).
        let colors = [[1.0, 0.5, 0.0], [0.2, 0.02, 0.9], [0.0, 0.0, 0.0], [0.7, 0.7, 0.7]];
        let opacities = [1.0, 0.5, 0.25, 0.0];
        let over_black = Array3::from_shape_fn((2, 2, 4), |(j, i, c)| {
            let at = 2 * j + i;
            if c == 3 { opacities[at] } else { colors[at][c] * opacities[at] }
        });
        let png = dir.path().join("a.png");
        write_picture_with(&png, &over_black, Backdrop::LeftOut, &[]).unwrap();
        let read = ImageReader::open(&png).unwrap().decode().unwrap();
        assert_eq!(read.color(), image::ColorType::Rgba8);
        for (at, pixel) in read.to_rgba8().pixels().enumerate() {
            let alpha = opacities[at];
            assert_eq!(pixel[3], (alpha * 255.0).round() as u8);
            for c in 0..3 {
                let straight = if alpha > 0.0 { colors[at][c] } else { 0.0 };
                assert_eq!(pixel[c], srgb8_from_linear(f64::from(straight)), "pixel {at}");
                // Composed over grey, to half a code of alpha and of colour.
                let shown = crate::files::color::linear_from_srgb(f64::from(pixel[c]) / 255.0);
                let a8 = f64::from(pixel[3]) / 255.0;
                let composed = a8 * shown + (1.0 - a8) * 0.5;
                let exact = f64::from(colors[at][c] * alpha + (1.0 - alpha) * 0.5);
                assert!((composed - exact).abs() < 0.006, "pixel {at}: {composed} {exact}");
            }
        }
        // An OpenEXR file is associated: as drawn over black, to the last bit.
        let exr = dir.path().join("a.exr");
        write_picture_with(&exr, &over_black, Backdrop::LeftOut, &[]).unwrap();
        assert_eq!(read_exr(&exr).unwrap(), over_black);
    }

    #[test]
    fn odd_opacities_make_no_odd_colours() {
        let nan = f64::NAN;
        assert_eq!(straight_srgb8([0.0, 0.0, 0.0, 0.0]), [0; 4]);
        assert_eq!(straight_srgb8([nan, 1e-30, 9.0, 1e-30]), [0, 255, 255, 0]);
        assert_eq!(straight_srgb8([0.5, 0.5, 0.5, nan]), [0; 4]);
        assert_eq!(straight_srgb8([2.0, 0.0, -1.0, 1.5]), [255, 0, 0, 255]);
    }
}
