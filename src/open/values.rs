//! Parsers for the values of command-line flags. Each returns an error as a reason in one line.

use crate::files::color;
use crate::scene::{AXIS_VIEWS, AmbientOcclusion, AxisView, Extent, Light, LightSource, SkyMap};
use crate::strands::{MAX_MM, RESOLUTIONS};
use glam::DVec3;
use serde::{Serialize, Serializer};
use std::ops::RangeInclusive;

/// Largest coordinate that flags accept, mm: squares of larger ones lose all precision in float32.
const MAX_COORDINATE: f64 = 1e9;

/// Length of the shortest direction vector that flags accept.
const MIN_DIRECTION: f64 = 1e-9;

/// Deviation of a vector's squared length from 1 up to which the vector counts as normalised.
const ROUNDING: f64 = 1e-14;

/// Largest width and height of a picture, pixels; a common limit of 2-D textures.
const MAX_PICTURE_SIDE: u32 = 16_384;

/// Width and height of a picture, pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Size {
    /// Width of the picture, pixels.
    pub width: u32,
    /// Height of the picture, pixels.
    pub height: u32,
}

impl Serialize for Size {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("{}x{}", self.width, self.height))
    }
}

/// Background of rendered pictures: a colour, or transparent.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Background {
    /// Background colour, linear RGB.
    Color([f64; 3]),
    /// Black background, which is transparent in picture files.
    None,
}

impl Serialize for Background {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self {
            Self::Color(rgb) => serializer.serialize_str(&color::to_hex(*rgb)),
            Self::None => serializer.serialize_str("none"),
        }
    }
}

/// Parses a picture size `WxH`, each from 1 to 16384 pixels; a single number stands for both.
pub fn size(text: &str) -> Result<Size, String> {
    let side = |s: &str| s.parse().ok().filter(|n| (1..=MAX_PICTURE_SIDE).contains(n));
    let (width, height) = text.split_once(['x', 'X']).unwrap_or((text, text));
    match (side(width), side(height)) {
        (Some(width), Some(height)) => Ok(Size { width, height }),
        _ => Err(format!(
            "expected WxH or one number for both, each a whole number from 1 to {MAX_PICTURE_SIDE}"
        )),
    }
}

/// Parses a SHA-256 checksum of 64 hexadecimal digits.
pub fn sha256(text: &str) -> Result<String, String> {
    match text.len() == 64 && text.bytes().all(|b| b.is_ascii_hexdigit()) {
        true => Ok(text.to_ascii_lowercase()),
        false => Err("expected 64 hexadecimal digits".into()),
    }
}

/// Forms of a light on the command line, for error messages.
const OF_OTHERS: &str = "radius= belongs to disc:x,y,z and angle= to sun:x,y,z";
const LIGHT_FORMS: &str =
    "expected dir:x,y,z, point:x,y,z, disc:x,y,z,radius=MM, sun:x,y,z,angle=DEG, sky or sky:FILE";

fn number(text: &str) -> Result<f64, String> {
    match text.trim().parse::<f64>() {
        Ok(x) if x.is_finite() => Ok(x),
        Ok(_) => Err("it must be a finite number".into()),
        Err(_) => Err(format!("`{text}` is not a number")),
    }
}

/// Returns a parser of numbers that accepts only those within a range.
pub fn within(range: RangeInclusive<f64>) -> impl Fn(&str) -> Result<f64, String> + Clone + Send + Sync {
    move |text| match number(text)? {
        x if range.contains(&x) => Ok(x),
        _ => Err(format!("it must be from {} to {}", range.start(), range.end())),
    }
}

fn vector(text: &str) -> Result<DVec3, String> {
    let parts: Vec<&str> = text.split(',').collect();
    let [x, y, z] = parts[..] else {
        return Err("expected three numbers x,y,z".into());
    };
    Ok(DVec3::new(number(x)?, number(y)?, number(z)?))
}

/// Parses a point `x,y,z` in world mm.
pub fn point(text: &str) -> Result<DVec3, String> {
    let v = vector(text)?;
    if v.abs().max_element() > MAX_COORDINATE {
        return Err(format!("a coordinate is beyond {MAX_COORDINATE:e} mm"));
    }
    Ok(v)
}

/// Parses a direction `x,y,z` and normalises it. A vector that already has unit length stays unchanged to the last
/// bit.
pub fn direction(text: &str) -> Result<DVec3, String> {
    let v = point(text)?;
    if v.length() < MIN_DIRECTION {
        return Err("its length is 0".into());
    }
    Ok(if (v.length_squared() - 1.0).abs() < ROUNDING { v } else { v.normalize() })
}

/// Parses a light: `dir:x,y,z` (or `x,y,z` alone), `point:x,y,z`, `disc:x,y,z,radius=MM`, `sun:x,y,z,angle=DEG`, `sky`
/// or `sky:FILE`.
/// Then optionally `,samples=N` for a light with a size, `,color=` with `#rrggbb` (sRGB) or a name, and `,intensity=F`,
/// each at most once.
pub fn light(text: &str) -> Result<LightSource, String> {
    let (place, [color, intensity, radius, angle, turn, samples]) =
        with_keys(text, ["color", "intensity", "radius", "angle", "turn", "samples"])?;
    let sky_file = place.strip_prefix("sky:").filter(|file| !file.is_empty());
    if let (None, Some((item, _))) = (sky_file, place.split_once('=')) {
        return Err(format!(
            "`{item}` is no key of a light: there is color=, intensity=, radius=, angle=, turn=, samples="
        ));
    }
    let (kind, light) = match place.split_once(':') {
        Some((kind @ ("dir" | "sun"), v)) => (kind, Light::Directional { toward: direction(v)? }),
        Some((kind @ ("point" | "disc"), v)) => (kind, Light::Point { position: point(v)? }),
        _ if place == "sky" || sky_file.is_some() => ("sky", Light::Directional { toward: DVec3::Z }),
        None => {
            let refuse = |_| format!("`{place}` is no light: {LIGHT_FORMS}");
            ("dir", Light::Directional { toward: direction(place).map_err(refuse)? })
        }
        _ => return Err(LIGHT_FORMS.into()),
    };
    let white = LightSource::from(light);
    let extent = match sky_file {
        Some(file) => sky_map(file, [radius, angle], turn)?,
        None if turn.is_some() => return Err("turn= belongs to sky:FILE".into()),
        None => light_extent(kind, radius, angle)?,
    };
    Ok(LightSource {
        light,
        extent,
        samples: samples.map_or(Ok(white.samples), |text| light_samples(kind, text))?,
        color: color.map_or(Ok(white.color), color::parse)?,
        intensity: intensity.map_or(Ok(white.intensity), light_intensity)?,
    })
}

/// Returns a sky with a map, which is read when the scene is opened.
fn sky_map(file: &str, of_others: [Option<&str>; 2], turn: Option<&str>) -> Result<Extent, String> {
    if of_others.iter().any(Option::is_some) {
        return Err(OF_OTHERS.into());
    }
    let turn_deg = turn.map_or(Ok(0.0), within(-360.0..=360.0)).map_err(|why| format!("turn: {why}"))?;
    Ok(Extent::Map(SkyMap { path: file.into(), turn_deg, radiance: None }))
}

/// Returns the size of a light of the given kind from the values of its keys.
fn light_extent(kind: &str, radius: Option<&str>, angle: Option<&str>) -> Result<Extent, String> {
    let positive = |key: &str, most: f64, text: &str| match within(0.0..=most)(text) {
        Ok(x) if x > 0.0 => Ok(x),
        Ok(_) => Err(format!("{key}: it must be above 0")),
        Err(why) => Err(format!("{key}: {why}")),
    };
    match (kind, radius, angle) {
        ("disc", Some(radius), None) => Ok(Extent::Disc {
            radius_mm: positive("radius", MAX_COORDINATE, radius)?,
            facing_mm: DVec3::ZERO,
        }),
        ("sun", None, Some(angle)) => Ok(Extent::Cone { angle_deg: positive("angle", 360.0, angle)? }),
        ("sky", None, None) => Ok(Extent::SKY),
        ("dir" | "point", None, None) => Ok(Extent::None),
        ("disc", ..) => Err("a disc has radius=MM and no angle".into()),
        ("sun", ..) => Err("a sun has angle=DEG and no radius".into()),
        _ => Err(OF_OTHERS.into()),
    }
}

/// Parses the number of samples of a light with a size.
fn light_samples(kind: &str, text: &str) -> Result<u32, String> {
    if matches!(kind, "dir" | "point") {
        return Err("samples= belongs to lights with a size: disc, sun, sky".into());
    }
    sample_count(text)
}

/// Parses a number of samples.
fn sample_count(text: &str) -> Result<u32, String> {
    match text.parse() {
        Ok(count) if (1..=LightSource::MOST_SAMPLES).contains(&count) => Ok(count),
        _ => Err(format!("samples: expected a whole number from 1 to {}", LightSource::MOST_SAMPLES)),
    }
}

/// Splits a flag's text such as `FILE,color=#rrggbb` into the name before the first key and the values of the known
/// keys.
pub(super) fn with_keys<'a, const N: usize>(
    text: &'a str,
    keys: [&str; N],
) -> Result<(&'a str, [Option<&'a str>; N]), String> {
    let (mut name, mut values) = (text, [None; N]);
    // Read from the end, since a name may have commas.
    while let Some((before, item)) = name.rsplit_once(',') {
        let known = item.split_once('=').and_then(|(key, value)| {
            Some((keys.iter().position(|known| *known == key.trim())?, value.trim()))
        });
        let Some((place, value)) = known else { break };
        if values[place].replace(value).is_some() {
            return Err(format!("`{}` is given twice", keys[place]));
        }
        name = before;
    }
    if name.is_empty() {
        let keys: String = keys.iter().map(|key| format!("[,{key}=...]")).collect();
        return Err(format!("expected FILE{keys}"));
    }
    Ok((name, values))
}

/// Largest accepted intensity of a light: in float32 sums with a larger one, dim lights would be lost.
pub const MOST_INTENSITY: f64 = 1e6;

/// Parses the intensity of a light, 0 or more.
fn light_intensity(text: &str) -> Result<f64, String> {
    // Negative zero becomes zero.
    within(0.0..=MOST_INTENSITY)(text).map(|x| x + 0.0).map_err(|why| format!("intensity: {why}"))
}

/// Parses a background colour: `#rrggbb`, a name, or `none`.
pub fn background(text: &str) -> Result<Background, String> {
    match text {
        "none" => Ok(Background::None),
        _ => color::parse(text).map(Background::Color).map_err(|why| format!("{why}, or `none`")),
    }
}

/// Parses the voxel spacing `x,y,z` of a volume, mm; each must be above 0.
pub fn spacing_mm(text: &str) -> Result<[f64; 3], String> {
    let v = point(text)?;
    if v.min_element() <= 0.0 {
        return Err("each spacing must be greater than 0".into());
    }
    Ok(v.to_array())
}

/// Parses a side from which the camera looks, by its letter (A, P, L, R, S, I), its name, or front, back, top or bottom.
pub fn view(text: &str) -> Result<AxisView, String> {
    let common = [("front", "A"), ("back", "P"), ("top", "S"), ("bottom", "I")];
    let text = common.iter().find(|(name, _)| name.eq_ignore_ascii_case(text)).map_or(text, |(_, mark)| mark);
    let is = |side: &&AxisView| side.mark.eq_ignore_ascii_case(text) || side.name.eq_ignore_ascii_case(text);
    AXIS_VIEWS
        .iter()
        .find(is)
        .copied()
        .ok_or_else(|| format!("`{text}` is not one of A, P, L, R, S, I, front, back, top, bottom"))
}

/// Parses the number of voxels along the longest side of a strand grid.
pub fn resolution(text: &str) -> Result<usize, String> {
    let known = RESOLUTIONS;
    text.parse()
        .ok()
        .filter(|n| known.contains(n))
        .ok_or_else(|| format!("expected a whole number from {} to {}", known.start(), known.end()))
}

/// Parses the diameter of a strand, mm.
pub fn thickness_mm(text: &str) -> Result<f64, String> {
    text.parse()
        .ok()
        .filter(|d| *d > 0.0 && *d <= f64::from(MAX_MM))
        .ok_or_else(|| "expected a diameter above 0 and at most 1e9 mm".into())
}

/// Parses ambient occlusion: the radius in mm, and optionally `,samples=N`.
pub fn ambient_occlusion(text: &str) -> Result<AmbientOcclusion, String> {
    let (radius, [samples]) = with_keys(text, ["samples"])?;
    let radius_mm = within(0.0..=MAX_COORDINATE)(radius)?;
    if radius_mm == 0.0 {
        return Err("the radius must be above 0".into());
    }
    let samples = samples.map_or(Ok(AmbientOcclusion::DEFAULT_SAMPLES), sample_count)?;
    Ok(AmbientOcclusion { radius_mm, samples })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn good_values() {
        assert_eq!(size("640x480"), Ok(Size { width: 640, height: 480 }));
        assert_eq!(size("512"), Ok(Size { width: 512, height: 512 }));
        assert_eq!(point("-1,2.5, 3e2"), Ok(DVec3::new(-1.0, 2.5, 300.0)));
        assert_eq!(direction("0,0,-4"), Ok(-DVec3::Z));
        let [up, at] = [Light::Directional { toward: DVec3::Y }, Light::Point { position: DVec3::Y * 2.0 }]
            .map(LightSource::from);
        assert_eq!((light("dir:0,2,0"), light("0,2,0")), (Ok(up.clone()), Ok(up.clone())));
        assert_eq!(light("point:0,2,0"), Ok(at.clone()));
        let red = [1.0, 0.0, 0.0];
        assert_eq!(light("dir:0,2,0,color=#ff0000"), Ok(LightSource { color: red, ..up.clone() }));
        assert_eq!(light("point:0,2,0, intensity=0"), Ok(LightSource { intensity: 0.0, ..at.clone() }));
        let sun = LightSource { extent: Extent::Cone { angle_deg: 5.5 }, samples: 4, ..up };
        assert_eq!(light("sun:0,2,0,angle=5.5,samples=4"), Ok(sun.clone()));
        let facing_mm = DVec3::ZERO;
        let disc =
            LightSource { extent: Extent::Disc { radius_mm: 30.0, facing_mm }, intensity: 2.0, ..at.clone() };
        assert_eq!(light("disc:0,2,0,intensity=2,radius=30"), Ok(disc.clone()));
        for source in [sun, disc, light("sky,samples=3,color=red").unwrap()] {
            assert_eq!(light(&source.text()), Ok(source));
        }
        let sky = light("sky:a,b=c/d.hdr,turn=-30,samples=4,intensity=2").unwrap();
        let map = SkyMap { path: "a,b=c/d.hdr".into(), turn_deg: -30.0, radiance: None };
        assert_eq!((&sky.extent, sky.samples, sky.intensity), (&Extent::Map(map), 4, 2.0));
        assert_eq!(light(&sky.text()), Ok(sky));
        let both = Ok(LightSource { color: red, intensity: 2.5, ..at });
        assert_eq!(light("point:0,2,0,color=#ff0000,intensity=2.5"), both);
        assert_eq!(light("point:0,2,0,intensity=2.5,color=#ff0000"), both);
        assert_eq!(spacing_mm("1,2,0.5"), Ok([1.0, 2.0, 0.5]));
        for red in ["#ff0000", "red", "RED"] {
            assert_eq!(background(red), Ok(Background::Color([1.0, 0.0, 0.0])));
        }
        let marks = ["front", "Back", "top", "bottom", "left", "R"].map(|name| view(name).unwrap().mark);
        assert_eq!(marks, ["A", "P", "S", "I", "L", "R"]);
        assert_eq!(background("none"), Ok(Background::None));
        assert_eq!((within(0.0..=1.0)("0"), within(0.01..=8.0)("8")), (Ok(0.0), Ok(8.0)));
    }

    #[test]
    fn bad_values_say_why() {
        for bad in ["", "0", "0x5", "5x0", "16385x1", "-1x5", "5x5x5", "1.5x2", "99999999999x1"] {
            assert!(size(bad).unwrap_err().contains("WxH"), "{bad}");
        }
        for bad in ["", "1,2", "1,2,3,4", "1,2,x", "1,2,nan", "1,inf,3", "1,2,1e10", "1;2;3"] {
            assert!(point(bad).is_err(), "{bad}");
        }
        for bad in ["0,0,0", "1e-300,0,0"] {
            assert!(direction(bad).unwrap_err().contains("length"), "{bad}");
        }
        for bad in ["", "dir", "dir:", "dir:0,0,0", "sun:1,2,3", "1,2", "point:1,2", "color=#ffffff"] {
            assert!(light(bad).is_err(), "{bad}");
        }
        for (bad, why) in [
            ("sun:0,0,1,radius=3", "angle=DEG"),
            ("disc:0,0,1", "radius=MM"),
            ("point:0,0,1,radius=3", "belongs"),
            ("sky,angle=3", "belongs"),
            ("sky:", "expected"),
            ("sky:a.hdr,angle=3", "belongs"),
            ("sky:a.hdr,turn=x", "turn"),
            ("sky,turn=3", "sky:FILE"),
            ("sun:0,0,1,angle=0", "above 0"),
            ("sun:0,0,1,angle=361", "0 to 360"),
            ("disc:0,0,1,radius=x", "number"),
            ("dir:0,0,1,samples=4", "with a size"),
            ("sky,samples=0", "1 to 256"),
            ("sky,samples=257", "1 to 256"),
            ("sky,samples=1.5", "1 to 256"),
        ] {
            let error = light(bad).unwrap_err();
            assert!(error.contains(why), "{bad}: {error}");
        }
        for (keys, why) in [
            ("color=redd", "#rrggbb"),
            ("color=", "#rrggbb"),
            ("intensity=", "number"),
            ("intensity=-1", "0 to"),
            ("intensity=inf", "finite"),
            ("intensity=nan", "finite"),
            ("intensity=1e7", "0 to"),
            ("intensity=1,intensity=1", "twice"),
            ("color=#ffffff,intensity=2,color=#ffffff", "twice"),
            ("colour=#ffffff", "no key"),
            ("intensity=2,", "no key"),
            ("intensity=2,5", "no key"),
        ] {
            let error = light(&format!("dir:0,0,1,{keys}")).unwrap_err();
            assert!(error.contains(why), "{keys}: {error}");
        }
        for bad in ["0", "180", "-5", "nan", "inf", "x", "1e-9"] {
            assert!(within(0.001..=179.9)(bad).is_err(), "{bad}");
        }
        for bad in ["1,1,0", "-1,1,1", "1,1"] {
            assert!(spacing_mm(bad).is_err(), "{bad}");
        }
    }
}
