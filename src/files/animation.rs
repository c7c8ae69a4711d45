//! Writes animation files: animated PNG, with the same pixels as single PNG files, and GIF, with at most 256 colours.

use super::output::{WholeFile, extension, spool_beside};
use super::picture::{Backdrop, codes, color_type, joined, png_encoder};
use crate::error::{Error, Result};
use color_quant::NeuQuant;
use gif::{AnyExtension, Extension, Frame, Repeat};
use ndarray::Array3;
use std::collections::HashMap;
use std::fs::File;
use std::io::{BufWriter, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use tempfile::SpooledTempFile;

/// File name extensions of the supported animation formats.
pub const ANIMATION_EXTENSIONS: &[&str] = &["apng", "gif"];

/// Smallest and largest frame rate of an animation, frames per second. Viewers ignore GIF frame delays below 20 ms.
pub const PICTURES_PER_SECOND: [f64; 2] = [0.1, 50.0];

/// Largest number of colours of a GIF file.
const COLORS: usize = 256;
/// Approximate number of pixels, spread over all frames, from which the colours of a GIF file are chosen.
const TRAINING_PIXELS: u64 = 1 << 21;
/// Bytes of pixels that wait in memory until the colours of a GIF file are chosen; further pixels go to a temporary
/// file.
const SPOOL_BYTES: usize = 64 << 20;

/// Returns whether a file name has the extension of an animation format.
pub fn is_animation(path: &Path) -> bool {
    extension(path, ANIMATION_EXTENSIONS).is_ok()
}

/// Returns an error for a GIF file without a background, since GIF has no partly transparent pixels.
///
/// # Errors
/// Input error: a GIF file was requested without a background.
pub fn check_backdrop(path: &Path, backdrop: Backdrop) -> Result<()> {
    if backdrop == Backdrop::LeftOut && extension(path, &["gif"]).is_ok() {
        let why = "a GIF file has no half-transparent pixels, which a picture without background needs";
        return Err(Error::input("cannot write file", path.display(), why)
            .hint("an .apng file has them, and so have numbered .png files"));
    }
    Ok(())
}

/// Properties of an animation file: size, number of frames, frame rate and background.
#[derive(Debug, Clone)]
pub struct Animated {
    /// Width and height of each frame, pixels.
    pub size: [u32; 2],
    /// Number of frames of the animation.
    pub frames: u32,
    /// Frame rate of the animation, frames per second, within [`PICTURES_PER_SECOND`].
    pub fps: f64,
    /// Background behind the volume in each frame of the animation.
    pub backdrop: Backdrop,
    /// Metadata of the animation file, as keys and texts: `iTXt` chunks in a PNG file, one comment in a GIF file.
    pub texts: Vec<(String, String)>,
}

/// Writer of an animation file that loops for ever. The file appears only when it is complete.
pub struct Animation {
    path: PathBuf,
    whole: WholeFile,
    of: Animated,
    encoder: Encoder,
}

enum Encoder {
    /// Encoder of an animated PNG, which writes each frame at once.
    Png(Box<png::Writer<BufWriter<File>>>),
    /// Encoder of an animated GIF, which stores all frames until their common colours are chosen.
    Gif(Box<Waiting>),
}

/// Frames of a GIF file that wait until their common colours are chosen.
struct Waiting {
    file: BufWriter<File>,
    /// Pixels of the GIF frames that wait for their common colours, 8-bit RGB.
    pixels: SpooledTempFile,
    palette: Palette,
}

impl Animation {
    /// Begins an animation file; the file name extension selects the format.
    ///
    /// # Errors
    /// The extension is unknown, a GIF file was requested without a background, or the folder is not writable.
    pub fn begin(path: &Path, of: Animated) -> Result<Self> {
        let kind = extension(path, ANIMATION_EXTENSIONS)?;
        check_backdrop(path, of.backdrop)?;
        let (whole, file) = WholeFile::begin(path)?;
        let file = BufWriter::new(file);
        let encoder = match kind {
            "apng" => Encoder::Png(Box::new(png_writer(file, &of).map_err(|e| failed(path, e))?)),
            _ => {
                let pixels = u64::from(of.size[0]) * u64::from(of.size[1]) * u64::from(of.frames);
                let palette = Palette::with_stride(pixels.div_ceil(TRAINING_PIXELS) as usize);
                Encoder::Gif(Box::new(Waiting { file, pixels: spool_beside(path, SPOOL_BYTES), palette }))
            }
        };
        Ok(Self { path: path.into(), whole, of, encoder })
    }

    /// Adds the next frame of the animation: `height x width x 4`, in the form that
    /// [`write_picture`](super::picture::write_picture) takes.
    ///
    /// # Errors
    /// Writing to the disk fails.
    pub fn add(&mut self, picture: &Array3<f32>) -> Result<()> {
        let fail = |e: &dyn std::fmt::Display| failed(&self.path, e);
        let pixels = codes(picture, self.of.backdrop);
        match &mut self.encoder {
            Encoder::Png(writer) => writer.write_image_data(&pixels).map_err(|e| fail(&e))?,
            Encoder::Gif(waiting) => {
                waiting.palette.add(&pixels);
                waiting.pixels.write_all(&pixels).map_err(|e| fail(&e))?;
            }
        }
        Ok(())
    }

    /// Completes the animation file, which appears under its name.
    ///
    /// # Errors
    /// Frames are missing, or writing to the disk fails.
    pub fn finish(self) -> Result<()> {
        let Self { path, whole, of, encoder } = self;
        match encoder {
            Encoder::Png(writer) => writer.finish().map_err(|e| failed(&path, e))?,
            Encoder::Gif(waiting) => write_gif(*waiting, &of).map_err(|e| failed(&path, e))?,
        }
        whole.finish()
    }
}

fn failed(path: &Path, why: impl std::fmt::Display) -> Error {
    Error::runtime("cannot write file", path.display(), why)
}

fn png_writer(
    file: BufWriter<File>,
    of: &Animated,
) -> Result<png::Writer<BufWriter<File>>, png::EncodingError> {
    let mut encoder = png_encoder(file, of.size, color_type(of.backdrop), &of.texts)?;
    encoder.set_animated(of.frames, 0)?;
    // The frame rate is exact to 0.01 per second. Each frame replaces the previous one, including alpha.
    encoder.set_frame_delay(100, (100.0 * of.fps).round() as u16)?;
    encoder.set_blend_op(png::BlendOp::Source)?;
    encoder.validate_sequence(true);
    encoder.write_header()
}

/// Colour palette of a GIF file, shared by all frames, since a palette for each frame would flicker.
struct Palette {
    /// Interval between the pixels that are sampled to choose the palette of a GIF file: every `stride`-th pixel.
    stride: usize,
    /// Number of pixels to skip at the start of the next GIF frame before a pixel is sampled for the palette.
    next: usize,
    /// Sampled pixels from which the palette of a GIF file is chosen, RGBA.
    sample: Vec<u8>,
    /// Palette index of each colour of a GIF file, filled on demand. Before [`Self::choose`], the keys are the
    /// colours found in the frames, until there are more than [`COLORS`].
    places: HashMap<[u8; 3], u8>,
    /// Neural network that finds the nearest palette colour; `None` if the palette contains every colour of the GIF
    /// file.
    net: Option<NeuQuant>,
}

impl Palette {
    fn with_stride(pixels: usize) -> Self {
        // An odd stride samples all columns of frames with usual widths.
        Self { stride: pixels | 1, next: 0, sample: Vec::new(), places: HashMap::new(), net: None }
    }

    fn add(&mut self, pixels: &[u8]) {
        let (colors, _) = pixels.as_chunks::<3>();
        let sampled = colors.iter().skip(self.next).step_by(self.stride);
        self.next += sampled.len() * self.stride;
        self.sample.extend(sampled.flat_map(|&[r, g, b]| [r, g, b, u8::MAX]));
        self.next -= colors.len();
        // Frames have long runs of one colour.
        for run in colors.chunk_by(|a, b| a == b) {
            if self.places.len() > COLORS {
                break;
            }
            self.places.insert(run[0], 0);
        }
    }

    /// Chooses the palette colours of a GIF file and returns them, RGB.
    fn choose(&mut self) -> Vec<u8> {
        let mut colors: Vec<_> = std::mem::take(&mut self.places).into_keys().collect();
        if colors.len() > COLORS {
            return self.net.insert(NeuQuant::new(1, COLORS, &self.sample)).color_map_rgb();
        }
        colors.sort_unstable();
        self.places = colors.iter().copied().zip(0..=u8::MAX).collect();
        colors.concat()
    }

    fn place(&mut self, color: [u8; 3]) -> u8 {
        let [r, g, b] = color;
        let nearest = || self.net.as_ref().map_or(0, |net| net.index_of(&[r, g, b, u8::MAX]) as u8);
        *self.places.entry(color).or_insert_with(nearest)
    }
}

/// Writes all frames of a GIF file, without dithering, which would flicker between frames and triple the file size.
fn write_gif(waiting: Waiting, of: &Animated) -> Result<(), gif::EncodingError> {
    let Waiting { file, pixels: mut spooled, mut palette } = waiting;
    // Frames are at most 16,384 pixels wide, which fits the 16-bit size of a GIF file.
    let [width, height] = of.size.map(|side| side as u16);
    let mut encoder = gif::Encoder::new(file, width, height, &palette.choose())?;
    encoder.set_repeat(Repeat::Infinite)?;
    if let Some(lines) = joined(&of.texts) {
        encoder.write_raw_extension(AnyExtension::from(Extension::Comment), &[lines.as_bytes()])?;
    }
    spooled.seek(SeekFrom::Start(0))?;
    let mut pixels = vec![0; 3 * of.size[0] as usize * of.size[1] as usize];
    for frame in 0..of.frames {
        spooled.read_exact(&mut pixels)?;
        let (colors, _) = pixels.as_chunks::<3>();
        let runs = colors.chunk_by(|a, b| a == b);
        let places: Vec<u8> =
            runs.flat_map(|run| std::iter::repeat_n(palette.place(run[0]), run.len())).collect();
        let delay = delay_hundredths(frame, of.fps);
        encoder.write_frame(&Frame { width, height, buffer: places.into(), delay, ..Frame::default() })?;
    }
    encoder.into_inner()?.flush()?;
    Ok(())
}

/// Duration of one frame of a GIF file in units of 0.01 s; the sum over all frames has no accumulated rounding error.
fn delay_hundredths(frame: u32, fps: f64) -> u16 {
    let at = |frame: u32| (100.0 * f64::from(frame) / fps).round();
    (at(frame + 1) - at(frame)) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;
    use std::io::Cursor;

    const SIZE: [u32; 2] = [37, 23];

    fn picture(frame: u32, hues: f32) -> Array3<f32> {
        Array3::from_shape_fn((23, 37, 4), |(j, i, c)| match c {
            3 => (i as f32 + frame as f32) / 50.0,
            _ => ((j + c + frame as usize) as f32 / 30.0 * (i as f32 / 37.0) * hues).round() / hues,
        })
    }

    fn written(path: &Path, frames: u32, fps: f64, backdrop: Backdrop, hues: f32) -> Vec<u8> {
        let texts = vec![("umbravox:scene".to_owned(), "name = 'Kopf ä'\n".repeat(40))];
        let of = Animated { size: SIZE, frames, fps, backdrop, texts };
        let mut animation = Animation::begin(path, of).unwrap();
        (0..frames).for_each(|frame| animation.add(&picture(frame, hues)).unwrap());
        animation.finish().unwrap();
        std::fs::read(path).unwrap()
    }

    #[test]
    fn an_animated_png_keeps_every_pixel_of_every_picture() {
        let dir = tempfile::tempdir().unwrap();
        for (backdrop, channels) in [(Backdrop::Drawn, 3), (Backdrop::LeftOut, 4)] {
            let bytes = written(&dir.path().join("a.apng"), 4, 12.5, backdrop, 1e6);
            let mut reader = png::Decoder::new(Cursor::new(bytes)).read_info().unwrap();
            assert_eq!(reader.info().animation_control().unwrap().num_frames, 4);
            assert_eq!(reader.info().utf8_text[0].keyword, "umbravox:scene");
            let mut pixels = vec![0; 37 * 23 * channels];
            for frame in 0..4 {
                reader.next_frame(&mut pixels).unwrap();
                assert_eq!(pixels, codes(&picture(frame, 1e6), backdrop), "picture {frame}");
                let control = reader.info().frame_control().unwrap();
                assert_eq!((control.delay_num, control.delay_den), (100, 1250));
                assert_eq!((control.width, control.height), (37, 23));
            }
            assert!(reader.next_frame(&mut pixels).is_err());
        }
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    /// Decoded frames of a GIF file, RGB, and their durations.
    fn decoded(bytes: &[u8]) -> (Vec<Vec<u8>>, Vec<u16>) {
        let mut options = gif::DecodeOptions::new();
        options.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(bytes).unwrap();
        assert_eq!(decoder.repeat(), Repeat::Infinite);
        let (mut pictures, mut delays) = (Vec::new(), Vec::new());
        while let Some(frame) = decoder.read_next_frame().unwrap() {
            let rgb = frame.buffer.as_chunks::<4>().0.iter().flat_map(|&[r, g, b, _]| [r, g, b]).collect();
            pictures.push(rgb);
            delays.push(frame.delay);
        }
        (pictures, delays)
    }

    #[test]
    fn a_gif_keeps_few_colours_and_comes_near_many() {
        let dir = tempfile::tempdir().unwrap();
        let bytes = written(&dir.path().join("few.gif"), 3, 12.0, Backdrop::Drawn, 3.0);
        let said = "name = 'Kopf ä'".as_bytes();
        assert!(bytes.windows(said.len()).any(|w| w == said));
        let (pictures, delays) = decoded(&bytes);
        assert_eq!(delays, [8, 9, 8], "12 a second");
        for (frame, rgb) in (0..).zip(&pictures) {
            assert_eq!(*rgb, codes(&picture(frame, 3.0), Backdrop::Drawn), "picture {frame}");
        }
        let (pictures, _) = decoded(&written(&dir.path().join("many.gif"), 9, 10.0, Backdrop::Drawn, 1e6));
        let mut colors = HashSet::new();
        for (frame, rgb) in (0..).zip(&pictures) {
            let exact = codes(&picture(frame, 1e6), Backdrop::Drawn);
            colors.extend(rgb.as_chunks::<3>().0.iter().copied());
            let off: f64 = rgb.iter().zip(&exact).map(|(a, b)| f64::from(a.abs_diff(*b)).powi(2)).sum();
            let rms = (off / exact.len() as f64).sqrt();
            assert!(rms < 6.0, "picture {frame}: {rms} of 255");
        }
        assert!(pictures.len() == 9 && colors.len() <= COLORS && colors.len() > 128, "{}", colors.len());
    }

    #[test]
    fn an_unfinished_or_refused_animation_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let of = |backdrop| Animated { size: SIZE, frames: 2, fps: 10.0, backdrop, texts: Vec::new() };
        for name in ["a.apng", "a.gif"] {
            let mut animation = Animation::begin(&dir.path().join(name), of(Backdrop::Drawn)).unwrap();
            animation.add(&picture(0, 1e6)).unwrap();
            assert_eq!(animation.finish().unwrap_err().exit_status(), 1, "a picture is missing");
        }
        let e = Animation::begin(&dir.path().join("a.gif"), of(Backdrop::LeftOut)).err().unwrap();
        assert!(e.exit_status() == 2 && e.why.contains("half-transparent"), "{e}");
        assert!(Animation::begin(&dir.path().join("a.mp4"), of(Backdrop::Drawn)).is_err());
        assert!(Animation::begin(&dir.path().join("none/a.gif"), of(Backdrop::Drawn)).is_err());
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }

    #[test]
    fn samples_are_spread_evenly_over_pictures() {
        let pixels = |n: usize| vec![7; 3 * n];
        let mut palette = Palette::with_stride(6);
        for n in [5, 1, 9, 20, 2] {
            palette.add(&pixels(n));
        }
        // One of seven of 37, from the first on.
        assert_eq!((palette.sample.len() / 4, palette.places.len()), (6, 1));
    }
}
