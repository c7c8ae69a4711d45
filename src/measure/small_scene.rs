//! Scene of the exact reference picture, which has fewer pixels than the scene that it belongs to.

use crate::scene::Scene;

/// Approximate number of pixels in the exact reference picture.
const EXACT_PIXELS: f64 = 48.0 * 32.0;

/// Returns the scene reduced to about [`EXACT_PIXELS`] pixels with the same aspect ratio. Smaller scenes stay
/// unchanged.
pub fn small_scene(scene: &Scene) -> Scene {
    let (width, height) = (f64::from(scene.width), f64::from(scene.height));
    let scale = (EXACT_PIXELS / (width * height)).sqrt().min(1.0);
    let scaled = |n: f64| (n * scale).round().max(1.0) as u32;
    Scene { width: scaled(width), height: scaled(height), ..scene.clone() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;

    #[test]
    fn the_exact_picture_has_the_shape_of_the_picture() {
        let scene = Scene::framing(&Phantom::Slab.build(8).unwrap());
        for (size, small) in
            [((512, 512), (39, 39)), ((1920, 1280), (48, 32)), ((20, 30), (20, 30)), ((9000, 1), (3718, 1))]
        {
            let scene = small_scene(&Scene { width: size.0, height: size.1, ..scene.clone() });
            assert_eq!((scene.width, scene.height), small);
        }
    }
}
