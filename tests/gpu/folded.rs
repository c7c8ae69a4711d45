//! A volume longer than the adapter's 3-D textures, folded into one: same pictures and shadows.

use crate::{extinction, renderer, volume_of};
use glam::{DAffine3, DMat3, DVec3};
use ndarray::Array3;
use std::sync::{Arc, OnceLock};
use umbravox::gpu::Gpu;
use umbravox::render::{DisabledOptimizations, Renderer, Session};
use umbravox::scene::{Light, Scene, Shading};
use umbravox::shadow;
use umbravox::transfer::{LabelRule, LabelVisibility, TransferFunction};
use umbravox::volume::{Labels, Volume, Voxels};

/// Largest side of the small device's 3-D textures, texels.
const LIMIT: u32 = 64;

/// Device with smaller limits than its adapter has.
fn small_device() -> Option<&'static Arc<Renderer>> {
    static SMALL: OnceLock<Arc<Renderer>> = OnceLock::new();
    let renderer = renderer()?;
    Some(SMALL.get_or_init(|| limited(renderer)))
}

fn limited(renderer: &Renderer) -> Arc<Renderer> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let same = |a: &wgpu::Adapter| a.get_info().name == renderer.gpu().info.name;
    let adapter = adapters.into_iter().find(same).expect("the adapter is still there");
    let mut descriptor = Gpu::device_descriptor(&adapter);
    descriptor.required_limits.max_texture_dimension_3d = LIMIT;
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    Arc::new(Renderer::new(Gpu::from_parts(&adapter, device, queue).unwrap()))
}

/// Volume of waves with noise, on an oblique grid.
fn waves([nx, ny, nz]: [usize; 3], half: bool) -> Arc<Volume> {
    let value = |(k, j, i): (usize, usize, usize)| {
        let wave =
            (0.31 * i as f32).sin() + (0.23 * j as f32 + 0.11 * k as f32).cos() + (0.17 * k as f32).sin();
        (300.0 * wave).round() + ((i * 7 + j * 13 + k * 29) % 17) as f32
    };
    let values = Array3::from_shape_fn((nz, ny, nx), value);
    let voxels = if half { Voxels::I16(values.mapv(|v| v as i16)) } else { Voxels::F32(values) };
    let axes = DMat3::from_rotation_x(0.2) * DMat3::from_diagonal(DVec3::new(1.0, 0.9, 0.8));
    Arc::new(volume_of(voxels, DAffine3::from_mat3_translation(axes, DVec3::new(3.0, -8.0, 5.0))))
}

fn sessions(volume: &Arc<Volume>) -> Option<[Session; 2]> {
    sessions_through(volume, &extinction(&[(150.0, 0.0), (500.0, 0.12)]))
}

fn sessions_through(volume: &Arc<Volume>, tf: &TransferFunction) -> Option<[Session; 2]> {
    let (whole, small) = (renderer()?, small_device()?);
    let on = |renderer| Session::on(renderer, Arc::clone(volume), tf, DisabledOptimizations::NONE).unwrap();
    let [whole, small] = [on(whole), on(small)];
    assert!(!whole.loaded.on_device.fold.is_folded() && small.loaded.on_device.fold.is_folded());
    Some([whole, small])
}

/// Largest difference between two lists of values.
fn apart<'a>(a: impl IntoIterator<Item = &'a f32>, b: impl IntoIterator<Item = &'a f32>) -> f32 {
    a.into_iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max)
}

/// Points spread over the whole volume.
fn points(volume: &Volume) -> Vec<DVec3> {
    let dims = DVec3::from_array(volume.dims().map(|n| n as f64));
    let share = |i: usize| DVec3::new(0.618_034, 0.754_878, 0.569_84) * i as f64 % 1.0;
    (0..2000).map(|i| volume.world_from_index().transform_point3(share(i) * dims - 0.5)).collect()
}

#[test]
fn marches_by_cells_are_the_same_to_the_last_bit() {
    for dims in [[20, 30, 150], [150, 20, 14], [9, 200, 40], [100, 80, 9]] {
        for half in [true, false] {
            let volume = waves(dims, half);
            let Some([whole, small]) = sessions(&volume) else { return };
            let points = points(&volume);
            let light = Light::Directional { toward: DVec3::new(0.4, 0.5, 0.7) };
            for method in
                ["rays", "dsm:near=0", "dom:layers=4,near=0", "lightvolume:scale=4", "sat:scale=4,near=0"]
            {
                let method = shadow::parse(method).unwrap();
                let [a, b] = [&whole, &small].map(|session| {
                    let map = session.shadow(method.as_ref(), light).unwrap();
                    session.query(&map, &points).unwrap()
                });
                assert!(a.iter().any(|t| *t < 0.9) && a.iter().any(|t| *t > 0.1), "{dims:?}");
                assert_eq!(a, b, "{dims:?} {} {}", method.entry().name, method.params());
            }
        }
    }
}

/// Pictures and marches by samples differ by rounding alone, since the hardware filter's weights depend on the place
/// in the texture.
#[test]
fn marches_by_samples_and_pictures_differ_by_rounding_alone() {
    for (dims, half) in [([20, 30, 150], true), ([150, 20, 14], false), ([100, 80, 9], true)] {
        let volume = waves(dims, half);
        let Some([whole, small]) = sessions(&volume) else { return };
        let points = points(&volume);
        let scene = Scene { width: 96, height: 80, shading: Shading::Lambert, ..Scene::framing(&volume) };
        let methods = [
            "none",
            "rays",
            "dsm:march=samples",
            "osm:march=samples,bits=16",
            "dom:march=samples,bits=16",
            "bom:march=samples,bits=16",
            "lightvolume:scale=4,march=samples",
            "lightvolume:scale=4,build=sweep",
            "avsm",
            "moments",
            "fourier",
            "clusters",
            "wavelet",
            "beer",
        ];
        for name in methods {
            let method = shadow::parse(name).unwrap();
            let [a, b] = [&whole, &small].map(|session| {
                let map = session.shadow(method.as_ref(), scene.light()).unwrap();
                (session.query(&map, &points).unwrap(), session.render(&map, &scene).unwrap().pixels)
            });
            let (query, picture) = (apart(&a.0, &b.0), apart(&a.1, &b.1));
            println!("{dims:?} {name}: shadows {query:e}, picture {picture:e}");
            assert!(a.1.iter().any(|c| *c > 0.05), "{dims:?} {name}: nothing is seen");
            assert!(query < 1e-3 && picture < 1e-3, "{dims:?} {name}: {query} {picture}");
        }
    }
}

#[test]
fn volumes_beyond_folding_are_refused_with_sizes() {
    let Some(small) = small_device() else { return };
    let refused = small.load(waves([65, 64, 64], true)).err().unwrap();
    assert!(refused.why.contains("65 x 64 x 64") && refused.why.contains("64 x 64 x 64"), "{refused}");
    assert_eq!(refused.exit_status(), 2);
}

#[test]
fn labels_and_planes_are_where_they_were() {
    for dims in [[20, 18, 150], [150, 20, 14]] {
        let plain = waves(dims, true);
        let label = |(k, j, i): (usize, usize, usize)| ((i / 5 + j / 7 + k / 9) % 3) as u8;
        let labels = Array3::from_shape_fn((dims[2], dims[1], dims[0]), label);
        let labels = Labels::sampled(&volume_of(labels.into(), plain.world_from_index()), &plain).unwrap();
        let volume = Arc::new(Volume::clone(&plain).labelled(Arc::new(labels)).unwrap());
        let other = extinction(&[(-100.0, 0.0), (300.0, 0.05)]);
        let rules = vec![
            LabelRule { labels: vec![1], visibility: LabelVisibility::Hidden },
            LabelRule { labels: vec![2], visibility: LabelVisibility::Visible(Box::new(other)) },
        ];
        let clip = vec!["0.2,0.1,1,20".parse().unwrap()];
        let tf = TransferFunction { rules, clip, ..extinction(&[(150.0, 0.0), (500.0, 0.12)]) };
        let Some(both) = sessions_through(&volume, &tf) else { return };
        let points = points(&volume);
        let light = Light::Directional { toward: DVec3::new(0.3, 0.2, -0.9) };
        for method in ["rays", "dsm:near=0,map=64"] {
            let [a, b] = both.each_ref().map(|session| {
                let map = session.shadow(shadow::parse(method).unwrap().as_ref(), light).unwrap();
                session.query(&map, &points).unwrap()
            });
            assert!(a.iter().any(|t| *t < 0.9) && a == b, "{dims:?} {method}: {}", apart(&a, &b));
        }
    }
}
