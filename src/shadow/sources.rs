//! Lights for which a method builds the shadow maps of a scene.

use super::method::{Method, ShadowMap};
use crate::scene::{LightSource, Scene};
use std::borrow::Borrow;

/// Returns the lights of a scene for which a method builds shadow maps, in the order of the maps: lights with a size
/// that one map answers for ([`Method::covers`]), and the samples of all others.
pub fn mapped_lights(method: &dyn Method, scene: &Scene) -> Vec<LightSource> {
    let lights = scene.sources_shining();
    let of = |source: &LightSource| match source.is_soft() && method.covers(&source.extent) {
        true => vec![source.clone()],
        false => source.samples().collect(),
    };
    lights.iter().flat_map(of).collect()
}

impl ShadowMap {
    /// Returns the number of lights without size ([`Scene::shining`]) for which this map answers.
    pub fn samples(&self) -> usize {
        1 + self.report.more_samples
    }
}

/// Splits shadow maps into those of a light with `samples` samples, and the rest.
pub fn split_samples<Map: Borrow<ShadowMap>>(maps: &[Map], samples: usize) -> (&[Map], &[Map]) {
    let mut left = samples;
    let is_of_light = |map: &&Map| {
        let has_more = left > 0;
        left = left.saturating_sub((*map).borrow().samples());
        has_more
    };
    maps.split_at(maps.iter().take_while(is_of_light).count())
}
