//! Lights of a picture: the shadow map of each light, and one rendering pass over the picture per light.

use crate::error::{Error, Result};
use crate::field::DeferredPasses;
use crate::scene::{LightSource, Scene};
use crate::shadow::ShadowMap;

/// Shadow maps of a scene's lights that are not black, in the order of the lights
/// ([`mapped_lights`](crate::shadow::mapped_lights)).
#[derive(Clone)]
pub struct LightMaps<'a> {
    maps: Vec<&'a ShadowMap>,
    /// Build passes of these maps that wait for the submission of the picture.
    pub(super) deferred: Option<&'a DeferredPasses>,
}

impl<'a> LightMaps<'a> {
    /// Returns the shadow maps, one per light that is not black, in the order of the scene's lights.
    pub fn maps(&self) -> &[&'a ShadowMap] {
        &self.maps
    }

    /// Adds build passes of these maps. The first submission of a picture submits them too, before its own passes.
    #[must_use]
    pub fn after(self, deferred: &'a DeferredPasses) -> Self {
        Self { deferred: Some(deferred), ..self }
    }

    /// Returns an error if the number of shadow maps differs from the number of the scene's lights that are not
    /// black.
    pub(super) fn checked(self, scene: &Scene) -> Result<Self> {
        let (maps, lights) =
            (self.maps.iter().map(|map| map.samples()).sum::<usize>(), scene.shining().len());
        match maps == lights && maps > 0 {
            true => Ok(self),
            false => {
                let why = format!("{maps} shadow maps for {lights} lights that are not black");
                Err(Error::runtime("cannot render", "picture", why))
            }
        }
    }
}

impl<'a> From<&'a ShadowMap> for LightMaps<'a> {
    fn from(map: &'a ShadowMap) -> Self {
        vec![map].into()
    }
}

impl<'a> From<Vec<&'a ShadowMap>> for LightMaps<'a> {
    fn from(maps: Vec<&'a ShadowMap>) -> Self {
        Self { maps, deferred: None }
    }
}

impl<'a> From<&'a [ShadowMap]> for LightMaps<'a> {
    fn from(maps: &'a [ShadowMap]) -> Self {
        maps.iter().collect::<Vec<_>>().into()
    }
}

impl<'a> From<&'a Vec<ShadowMap>> for LightMaps<'a> {
    fn from(maps: &'a Vec<ShadowMap>) -> Self {
        maps.as_slice().into()
    }
}

/// Rendering pass over a picture that adds one light, or at once several lights for which shading and shadows are
/// equal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LightPass {
    /// Index of the light's shadow map among the shadow maps of the picture.
    pub map: usize,
    /// Linear RGB of the light that reaches an unshadowed point. `None` for a single white light of intensity 1, so
    /// that the shader needs no factor.
    pub radiance: Option<[f64; 3]>,
}

impl LightPass {
    /// Creates the rendering pass of a picture that needs one pass only, for a light of the given linear RGB.
    ///
    /// Occluded ambient light needs a factor: the pass adds the light of the sources alone.
    fn only(scene: &Scene, radiance: [f64; 3]) -> Self {
        let needs_factor = radiance != LightSource::WHITE || scene.occlusion().is_some();
        Self { map: 0, radiance: needs_factor.then_some(radiance) }
    }

    /// Returns the rendering passes of a picture, one per shadow map or a single one for all lights. `samples` are the
    /// numbers of lights without size for which the maps answer, and `depends_on_light` says whether shading or shadows
    /// differ between lights.
    pub fn all(scene: &Scene, samples: &[usize], depends_on_light: bool) -> Vec<Self> {
        let lights = scene.shining();
        if scene.ambient >= 1.0 {
            return vec![Self::only(scene, LightSource::WHITE)];
        }
        let sum = |lights: &[LightSource]| {
            std::array::from_fn(|c| lights.iter().map(|light| light.radiance()[c]).sum())
        };
        if samples.len() == 1 || !depends_on_light {
            return vec![Self::only(scene, sum(&lights))];
        }
        let mut rest = &lights[..];
        let pass = |(map, samples): (usize, &usize)| {
            let (own, others) = rest.split_at((*samples).min(rest.len()));
            rest = others;
            Self { map, radiance: Some(sum(own)) }
        };
        samples.iter().enumerate().map(pass).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;
    use crate::scene::Extent;

    #[test]
    fn a_picture_has_the_fewest_passes() {
        let volume = Phantom::Slab.build(8).unwrap();
        let [half, white, red] = [([1.0; 3], 0.5), ([1.0; 3], 1.0), ([1.0, 0.0, 0.0], 2.0)];
        let light = |&(color, intensity): &([f64; 3], f64)| LightSource {
            color,
            intensity,
            ..LightSource::default()
        };
        let passes = |lights: &[([f64; 3], f64)], ambient, depends_on_light| {
            let scene =
                Scene { lights: lights.iter().map(light).collect(), ambient, ..Scene::framing(&volume) };
            let samples = vec![1; scene.shining().len()];
            let passes = LightPass::all(&scene, &samples, depends_on_light);
            assert!(passes.iter().enumerate().all(|(i, pass)| pass.map == i));
            passes.iter().map(|pass| pass.radiance).collect::<Vec<_>>()
        };
        assert_eq!(passes(&[white], 0.1, true), [None]);
        assert_eq!(passes(&[red], 0.1, true), [Some([2.0, 0.0, 0.0])]);
        assert_eq!(passes(&[white, red], 0.1, true), [Some([1.0; 3]), Some([2.0, 0.0, 0.0])]);
        assert_eq!(passes(&[white, red], 0.1, false), [Some([3.0, 1.0, 1.0])]);
        assert_eq!(passes(&[half, half], 0.1, false), [None]);
        assert_eq!(passes(&[white, red], 1.0, true), [None]);
        let dark = ([1.0; 3], 0.0);
        assert_eq!(passes(&[dark, dark], 0.1, false), [Some([0.0; 3])]);
        assert_eq!(passes(&[dark, white], 0.1, true), [None]);
        // One map for a light with four samples, between two others.
        let soft = LightSource { extent: Extent::SKY, samples: 4, ..light(&red) };
        let scene = Scene { lights: vec![light(&white), soft, light(&half)], ..Scene::framing(&volume) };
        let passes = LightPass::all(&scene, &[1, 4, 1], true);
        let radiances: Vec<_> = passes.iter().map(|pass| pass.radiance).collect();
        assert_eq!(radiances, [Some([1.0; 3]), Some([2.0, 0.0, 0.0]), Some([0.5; 3])]);
    }
}
