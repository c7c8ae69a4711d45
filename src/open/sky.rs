//! Reads the maps of skies that the lights of a scene name.

use super::values::MOST_INTENSITY;
use crate::error::{Error, Result};
use crate::scene::{Extent, Light, LightSource, SkyRadiance};
use glam::DVec3;
use image::{ImageFormat, ImageReader};
use std::path::Path;
use std::sync::Arc;

const WHAT: &str = "cannot read sky";

/// Returns a light source as a scene uses it: a disc faces the centre of the volume, and the map of a sky is read.
///
/// # Errors
/// The map cannot be read, or is no map of a sky, or is too bright.
pub(super) fn opened(source: LightSource, center_mm: DVec3) -> Result<LightSource> {
    let mut source = source.facing(center_mm);
    if let Extent::Map(map) = &mut source.extent {
        if map.radiance.is_none() {
            map.radiance = Some(Arc::new(read(Path::new(&map.path))?));
        }
        let path = map.path.clone();
        source.light = Light::Directional { toward: map.mean_direction() };
        if source.radiance().into_iter().any(|c| c > MOST_INTENSITY) {
            let why = format!("its mean radiance times the intensity is above {MOST_INTENSITY:e}");
            return Err(Error::input(WHAT, path, why));
        }
    }
    Ok(source)
}

/// Reads an equirectangular map of radiance: Radiance HDR (`.hdr`) or OpenEXR (`.exr`).
fn read(path: &Path) -> Result<SkyRadiance> {
    let refuse = |why: String| Error::input(WHAT, path.display(), why);
    let reader = ImageReader::open(path).map_err(|e| refuse(e.to_string()))?;
    let reader = reader.with_guessed_format().map_err(|e| refuse(e.to_string()))?;
    if !matches!(reader.format(), Some(ImageFormat::Hdr | ImageFormat::OpenExr)) {
        let why = "it is neither Radiance HDR (.hdr) nor OpenEXR (.exr)".into();
        return Err(refuse(why).hint("other formats have no radiance beyond white"));
    }
    let picture = reader.decode().map_err(|e| refuse(e.to_string()))?.into_rgb32f();
    let rgb = picture.pixels().map(|pixel| pixel.0).collect();
    SkyRadiance::new(picture.width() as usize, rgb).map_err(refuse)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::open::values;
    use image::{DynamicImage, Rgb32FImage};

    #[test]
    fn maps_are_read_and_bad_ones_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let opened = |name: &str| {
            let light = format!("sky:{},intensity=3,samples=4", at(name).display());
            opened(values::light(&light).unwrap(), DVec3::ZERO)
        };
        let map =
            Rgb32FImage::from_fn(8, 4, |_, row| image::Rgb([0.0, 2.0, if row < 2 { 4.0 } else { 2.0 }]));
        let white = Rgb32FImage::from_pixel(3, 3, image::Rgb([1.0; 3]));
        for name in ["sky.hdr", "sky.exr"] {
            DynamicImage::from(map.clone()).save(at(name)).unwrap();
            let source = opened(name).unwrap();
            let radiance = source.radiance();
            assert!((0..3).all(|c| (radiance[c] - [0.0, 6.0, 9.0][c]).abs() < 0.05), "{name}: {radiance:?}");
            let sum = source.samples().map(|sample| sample.radiance()[1]).sum::<f64>();
            assert!((sum - radiance[1]).abs() < 0.3, "{name}: {sum}");
            let Light::Directional { toward } = source.light else { panic!("directional") };
            assert!(toward.distance(DVec3::Z) < 1e-6, "{toward}");
            DynamicImage::from(white.clone()).save(at(name)).unwrap();
            assert!(opened(name).unwrap_err().why.contains("twice as wide"));
            std::fs::write(at(name), b"#?RADIANCE\nnonsense").unwrap();
            assert!(!opened(name).unwrap_err().why.contains('\n'));
        }
        DynamicImage::from(map).to_rgb8().save(at("sky.png")).unwrap();
        assert!(opened("sky.png").unwrap_err().why.contains("neither"));
        assert!(opened("none.hdr").is_err());
        DynamicImage::from(Rgb32FImage::from_pixel(2, 1, image::Rgb([1e6; 3]))).save(at("sky.exr")).unwrap();
        assert!(opened("sky.exr").unwrap_err().why.contains("above 1e6"));
    }
}
