//! The lights of a picture: a map for each, and passes over the picture that add up.

use crate::error::{Error, Result};
use crate::scene::{LightSource, Scene};
use crate::shadow::ShadowMap;

/// Shadow structures of a scene's lights: one for each that shines, in their order ([`Scene::shining`]).
#[derive(Clone)]
pub struct LightMaps<'a>(Vec<&'a ShadowMap>);

impl<'a> LightMaps<'a> {
    /// The maps.
    pub fn maps(&self) -> &[&'a ShadowMap] {
        &self.0
    }

    /// Refuses any other number of maps than that of the lights that shine.
    pub(super) fn checked(self, scene: &Scene) -> Result<Self> {
        let (maps, lights) = (self.0.len(), scene.shining().len());
        match maps == lights && maps > 0 {
            true => Ok(self),
            false => {
                let why = format!("{maps} shadow structures for {lights} lights that shine");
                Err(Error::runtime("cannot render", "picture", why))
            }
        }
    }
}

impl<'a> From<&'a ShadowMap> for LightMaps<'a> {
    fn from(map: &'a ShadowMap) -> Self {
        Self(vec![map])
    }
}

impl<'a> From<Vec<&'a ShadowMap>> for LightMaps<'a> {
    fn from(maps: Vec<&'a ShadowMap>) -> Self {
        Self(maps)
    }
}

impl<'a> From<&'a [ShadowMap]> for LightMaps<'a> {
    fn from(maps: &'a [ShadowMap]) -> Self {
        Self(maps.iter().collect())
    }
}

impl<'a> From<&'a Vec<ShadowMap>> for LightMaps<'a> {
    fn from(maps: &'a Vec<ShadowMap>) -> Self {
        maps.as_slice().into()
    }
}

/// One pass over a picture: the share of one light, or of several that nothing tells apart.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct LightPass {
    /// Place of its map.
    pub map: usize,
    /// Linear light that a lit point gets; `None` for a white light of intensity 1 that is the only one, whose picture
    /// needs neither a factor nor a sum.
    pub radiance: Option<[f64; 3]>,
}

impl LightPass {
    /// The only pass, or one of several; a factor of 1 is no factor.
    fn only(radiance: [f64; 3]) -> Self {
        Self { map: 0, radiance: (radiance != LightSource::WHITE).then_some(radiance) }
    }

    /// The passes of a picture, one at least; `told_apart` says whether it is another under another light.
    pub fn all(scene: &Scene, told_apart: bool) -> Vec<Self> {
        let lights = scene.shining();
        if scene.ambient >= 1.0 {
            return vec![Self::only(LightSource::WHITE)];
        }
        if lights.len() == 1 || !told_apart {
            let sum = |c: usize| lights.iter().map(|light| light.radiance()[c]).sum();
            return vec![Self::only(std::array::from_fn(sum))];
        }
        let pass = |(map, light): (usize, &LightSource)| Self { map, radiance: Some(light.radiance()) };
        lights.iter().enumerate().map(pass).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;

    #[test]
    fn passes_are_no_more_than_a_picture_needs() {
        let volume = Phantom::Slab.build(8).unwrap();
        let light = |color: [f64; 3], intensity| LightSource { color, intensity, ..LightSource::default() };
        let [half, white, red] = [light([1.0; 3], 0.5), light([1.0; 3], 1.0), light([1.0, 0.0, 0.0], 2.0)];
        let passes = |lights: &[LightSource], ambient, told_apart| {
            let scene = Scene { lights: lights.to_vec(), ambient, ..Scene::framing(&volume) };
            let passes = LightPass::all(&scene, told_apart);
            assert!(passes.iter().enumerate().all(|(i, pass)| pass.map == i));
            passes.iter().map(|pass| pass.radiance).collect::<Vec<_>>()
        };
        assert_eq!(passes(&[white], 0.1, true), [None]);
        assert_eq!(passes(&[red], 0.1, true), [Some([2.0, 0.0, 0.0])]);
        assert_eq!(passes(&[white, red], 0.1, true), [Some([1.0; 3]), Some([2.0, 0.0, 0.0])]);
        assert_eq!(passes(&[white, red], 0.1, false), [Some([3.0, 1.0, 1.0])]);
        assert_eq!(passes(&[half, half], 0.1, false), [None]);
        assert_eq!(passes(&[white, red], 1.0, true), [None]);
        let dark = light([1.0; 3], 0.0);
        assert_eq!(passes(&[dark, dark], 0.1, false), [Some([0.0; 3])]);
        assert_eq!(passes(&[dark, white], 0.1, true), [None]);
    }
}
