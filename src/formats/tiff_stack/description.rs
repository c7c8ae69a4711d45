//! ImageJ or OME description in the first page of a TIFF stack: voxel sizes, calibration, and page order.

use crate::formats::common::mm_of;
use crate::volume::Scaling;
use std::fs::File;
use std::io::BufReader;
use tiff::decoder::Decoder;
use tiff::decoder::ifd::Value;
use tiff::tags::Tag;

/// ImageDescription text and resolution of the first page of a TIFF stack.
#[derive(Debug, Default)]
pub(super) struct Description {
    pub(super) text: String,
    /// Resolution of a TIFF file along x and y, in pixels per length unit (XResolution and YResolution).
    pub(super) resolution: [Option<f64>; 2],
}

impl Description {
    pub(super) fn new(decoder: &mut Decoder<BufReader<File>>) -> Self {
        let text = decoder.get_tag_ascii_string(Tag::ImageDescription).unwrap_or_default();
        let mut resolution = |tag| {
            let ratio = match decoder.get_tag(tag).ok()? {
                Value::Rational(a, b) => f64::from(a) / f64::from(b),
                Value::Double(value) => value,
                Value::Float(value) => value.into(),
                _ => return None,
            };
            Some(ratio).filter(|r| r.is_finite() && *r > 0.0)
        };
        Self { resolution: [resolution(Tag::XResolution), resolution(Tag::YResolution)], text }
    }

    /// Returns the linear calibration of voxel values that ImageJ wrote into a TIFF file; the identity if there is
    /// none.
    pub(super) fn scaling(&self) -> Scaling {
        let number = |name: &str| field(&self.text, name).and_then(|v| v.parse::<f64>().ok());
        match (self.text.starts_with("ImageJ="), field(&self.text, "cf"), number("c0"), number("c1")) {
            (true, None | Some("0"), Some(intercept), Some(slope)) if slope != 0.0 => {
                Scaling { slope, intercept }
            }
            _ => Scaling::IDENTITY,
        }
    }

    /// Returns the voxel size in mm from the ImageJ or OME description of a TIFF file; `None` without a length unit.
    pub(super) fn spacing_mm(&self) -> Option<[f64; 3]> {
        if self.text.starts_with("ImageJ=") {
            let unit = mm_of(field(&self.text, "unit")?)?;
            let [x, y] = self.resolution;
            let slices = field(&self.text, "spacing").and_then(|s| s.parse().ok()).unwrap_or(1.0);
            return positive([unit / x?, unit / y.or(x)?, unit * slices]);
        }
        let size = |axis: &str| {
            let number: f64 = attribute(&self.text, &format!("PhysicalSize{axis}"))?.parse().ok()?;
            let unit = attribute(&self.text, &format!("PhysicalSize{axis}Unit")).unwrap_or("µm");
            Some(number * mm_of(unit)?)
        };
        positive([size("X")?, size("Y")?, size("Z").or_else(|| size("X"))?])
    }
}

/// Returns the value of a line `name=value` in an ImageJ description.
fn field<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix('=')).map(str::trim)
}

/// Returns the value of an XML attribute in an OME description.
fn attribute<'a>(text: &'a str, name: &str) -> Option<&'a str> {
    let key = format!("{name}=\"");
    let (at, _) = text.match_indices(&key).find(|(at, _)| text[..*at].ends_with(char::is_whitespace))?;
    text[at + key.len()..].split_once('"').map(|(value, _)| value)
}

fn positive(spacing: [f64; 3]) -> Option<[f64; 3]> {
    spacing.iter().all(|s| s.is_finite() && *s > 0.0).then_some(spacing)
}

/// Order of the pages of a TIFF stack by channel, slice and time. In ImageJ files channels vary fastest, then slices,
/// then times; OME files declare the order.
#[derive(Debug, PartialEq)]
pub(super) struct Order {
    channels: usize,
    pub(super) slices: usize,
    times: usize,
    /// Distance in pages of a TIFF stack between neighbouring channels, slices and times.
    strides: [usize; 3],
}

impl Order {
    pub(super) fn new(text: &str, pages: usize) -> Result<Self, String> {
        let count = |name: &str| field(text, name).and_then(|n| n.parse::<usize>().ok()).filter(|&n| n > 0);
        let plain = Self { channels: 1, slices: pages, times: 1, strides: [1, 1, pages] };
        if let Some(ome) = Self::from_ome(text).filter(|o| o.channels * o.slices * o.times == pages) {
            return Ok(ome);
        }
        if !text.starts_with("ImageJ=") {
            return Ok(plain);
        }
        if let Some(images) = count("images").filter(|&n| n > pages) {
            return Err(format!(
                "ImageJ put {images} slices into {pages} pages (a file beyond 4 GB), which is not supported"
            ));
        }
        let (channels, times) = (count("channels").unwrap_or(1), count("frames").unwrap_or(1));
        let slices = pages / channels.saturating_mul(times).max(1);
        let fits = channels.checked_mul(times).and_then(|n| n.checked_mul(slices)) == Some(pages);
        let strides = [1, channels, channels * slices];
        Ok(if fits && slices > 0 { Self { channels, slices, times, strides } } else { plain })
    }

    /// Reads the page order of a TIFF stack from the first `Pixels` element of an OME description.
    fn from_ome(text: &str) -> Option<Self> {
        let (_, pixels) = text.split_once("<Pixels ")?;
        let pixels = &format!(" {}", pixels.split('>').next()?);
        let size = |axis: &str| {
            let size = attribute(pixels, &format!("Size{axis}"))?.parse::<usize>().ok();
            size.filter(|n| (1..=1 << 20).contains(n))
        };
        let sizes = [size("C")?, size("Z")?, size("T")?];
        let order = attribute(pixels, "DimensionOrder")?.strip_prefix("XY")?;
        let mut strides = [1; 3];
        let mut stride = 1;
        for axis in order.chars() {
            let at = "CZT".find(axis)?;
            strides[at] = stride;
            stride *= sizes[at];
        }
        let [channels, slices, times] = sizes;
        Some(Self { channels, slices, times, strides })
    }

    pub(super) fn frames(&self) -> usize {
        self.channels * self.times
    }

    pub(super) fn page(&self, slice: usize, frame: usize) -> usize {
        let [channel, depth, time] = self.strides;
        frame % self.channels * channel + slice * depth + frame / self.channels * time
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn voxel_sizes_of_imagej_and_ome() {
        let image_j = Description {
            text: "ImageJ=1.53t\nimages=4\nslices=4\nunit=micron\nspacing=2.5\n".into(),
            resolution: [Some(4.0), Some(2.0)],
        };
        let mm = image_j.spacing_mm().unwrap();
        assert!(mm.iter().zip([0.25e-3, 0.5e-3, 2.5e-3]).all(|(a, b)| (a - b).abs() < 1e-12), "{mm:?}");
        let ome = Description {
            text: r#"<OME><Image><Pixels SizeX="4" PhysicalSizeX="0.5" PhysicalSizeY="0.25" PhysicalSizeZ="1" PhysicalSizeZUnit="mm"/></Image></OME>"#.into(),
            resolution: [None; 2],
        };
        assert_eq!(ome.spacing_mm(), Some([0.5e-3, 0.25e-3, 1.0]));
        let photo = Description { text: "made by a camera".into(), resolution: [Some(72.0); 2] };
        assert_eq!(photo.spacing_mm(), None);
    }

    #[test]
    fn page_order_with_channels_and_times() {
        let order = Order::new("ImageJ=1\nchannels=2\nslices=3\nframes=2\n", 12).unwrap();
        assert_eq!(order, Order { channels: 2, slices: 3, times: 2, strides: [1, 2, 6] });
        let ome = r#"<OME><Pixels SizeX="4" DimensionOrder="XYZCT" SizeC="2" SizeT="2" SizeZ="3">"#;
        let by_ome = Order::new(ome, 12).unwrap();
        assert_eq!((by_ome.page(2, 0), by_ome.page(0, 1), by_ome.page(1, 2)), (2, 3, 7));
        let pages: Vec<usize> = (0..3).map(|z| order.page(z, 3)).collect();
        assert_eq!(pages, [7, 9, 11]);
        assert!(Order::new("ImageJ=1\nimages=900\n", 1).is_err());
    }
}
