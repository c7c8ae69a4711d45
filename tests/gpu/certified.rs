//! Certified pictures: the error of every pixel against the exact picture is within its bound.

use super::*;
use umbravox::measure::certified::{CertifiedPicture, CertifiedScene};
use umbravox::open::presets;
use umbravox::scene::LightSource;

fn certified(setup: &Setup, scene: &Scene, spec: &str, eta: f64) -> CertifiedPicture {
    let maps: Vec<ShadowMap> =
        scene.shining().iter().map(|source| setup.shadow(spec, source.light)).collect();
    let field = setup.exact();
    let session = &setup.session;
    let certified = CertifiedScene {
        renderer: &session.renderer,
        loaded: &session.loaded,
        transfer: &session.transfer,
        shadows: &maps.iter().collect::<Vec<_>>(),
        field: &field,
    };
    certified.render(scene, eta, &|_| Ok(())).unwrap()
}

/// Returns the largest excess of a colour channel's error over its bound, and the mean error and bound.
fn excess(found: &CertifiedPicture, exact: &Array3<f32>) -> (f32, [f32; 2]) {
    let mut sums = [0.0; 2];
    for ((y, x), bound) in found.error.indexed_iter() {
        let channels = (0..3).map(|c| (found.pixels[[y, x, c]] - exact[[y, x, c]]).abs());
        sums = [sums[0] + channels.fold(0.0, f32::max), sums[1] + bound];
    }
    (found.excess(exact), sums.map(|sum| sum / found.error.len() as f32))
}

#[test]
fn errors_of_all_pixels_are_within_their_bounds() {
    for (name, preset) in [("thorax:48", "ct"), ("thorax:48", "isosurface"), ("shell:32", "engine")] {
        let volume = phantom(name);
        let tf = presets::resolve(preset, &volume).unwrap().tf;
        let Some(setup) = Setup::open(&volume, &tf) else { return };
        let red = LightSource { color: [0.9, 0.1, 0.1], ..lights(&volume)[1].1.into() };
        let scene = setup.scene(64, 48);
        let two = Scene { lights: vec![scene.light().into(), red], ambient: 0.2, ..scene.clone() };
        for scene in [scene, two] {
            let exact = setup.exact().picture(&scene);
            for eta in [0.1, 0.01] {
                let found = certified(&setup, &scene, "dsm:enclose=on,epsilon=0.005", eta);
                let (worst, [error, bound]) = excess(&found, &exact);
                let what = format!("{name}, {preset}, {} lights, {eta}", scene.lights.len());
                println!(
                    "{what}: {worst:.4} over, mean {error:.4} of {bound:.4}, rays {:.3}",
                    found.share_of_rays
                );
                assert!(worst <= 0.0, "{what}: {worst}");
            }
        }
    }
}

/// Bounds are narrow where rays are cast, and the samples of the eye ray have an error of their own.
#[test]
fn rays_narrow_the_bounds() {
    let volume = phantom("thorax:48");
    let tf = presets::resolve("ct", &volume).unwrap().tf;
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let scene = setup.scene(64, 48);
    let exact = setup.exact().picture(&scene);
    let [none, all] = [1.0, 0.0].map(|eta| certified(&setup, &scene, "dsm:enclose=on,epsilon=0.005", eta));
    assert_eq!((none.share_of_rays, all.share_of_rays > 0.5), (0.0, true));
    let (worst, [_, wide]) = excess(&none, &exact);
    let (_, [error, narrow]) = excess(&all, &exact);
    assert!(worst <= 0.0 && narrow < 0.7 * wide && error < narrow, "{worst}, {wide}, {error} of {narrow}");
    let rays = CertifiedPicture { error: ndarray::Array2::from_elem(all.error.dim(), 1e-3), ..all };
    assert!(excess(&rays, &exact).0 > 0.0, "the error of the rays' picture is not that of the rays alone");
}
