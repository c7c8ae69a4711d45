//! Volumes that are stored as pages: pictures, shadows and nodes are those of a whole texture, to the last bit.

use crate::{extinction, renderer, volume_of};
use glam::{DAffine3, DMat3, DVec3};
use ndarray::Array3;
use std::sync::{Arc, OnceLock};
use umbravox::gpu::Gpu;
use umbravox::open::{ReadFlags, VolumeSpec, load};
use umbravox::render::{DisabledOptimizations, Renderer, Session, VisibleBounds};
use umbravox::scene::{Scene, Shading};
use umbravox::shadow;
use umbravox::transfer::{LabelRule, LabelVisibility, TransferFunction};
use umbravox::volume::{ByteCount, Labels, Volume, Voxels};

/// Largest side of the small device's 3-D textures, texels: four pages.
const LIMIT: u32 = 150;

/// Two devices whose shaders interpolate with float32 weights, the second with small textures.
pub fn devices() -> Option<&'static [Arc<Renderer>; 2]> {
    static DEVICES: OnceLock<[Arc<Renderer>; 2]> = OnceLock::new();
    let renderer = renderer()?;
    Some(
        DEVICES
            .get_or_init(|| [u32::MAX, LIMIT].map(|limit| Arc::new(Renderer::new(device(renderer, limit))))),
    )
}

fn device(renderer: &Renderer, limit: u32) -> Gpu {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    let adapters = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let same = |a: &wgpu::Adapter| a.get_info().name == renderer.gpu().info.name;
    let adapter = adapters.into_iter().find(same).expect("the adapter is still there");
    let mut descriptor = Gpu::device_descriptor(&adapter);
    descriptor.required_features.remove(wgpu::Features::FLOAT32_FILTERABLE);
    let limits = &mut descriptor.required_limits;
    limits.max_texture_dimension_3d = limits.max_texture_dimension_3d.min(limit);
    let (device, queue) = pollster::block_on(adapter.request_device(&descriptor)).unwrap();
    Gpu::from_parts(&adapter, device, queue).unwrap()
}

/// Device like the first one, with at most `pages` pages of a volume with 4 bytes a voxel.
pub fn limited(whole: &Renderer, pages: u64) -> Renderer {
    let limit = pages * 33_u64.pow(3) * 4;
    Renderer::new(device(whole, u32::MAX).with_memory_limit(Some(limit)))
}

/// Value types of a volume, which pages store in different formats.
#[derive(Debug, Clone, Copy)]
pub enum Kind {
    Narrow,
    Signed,
    Unsigned,
    Float,
}

/// Volume of waves with noise, on an oblique grid, with extinction above 150. Wide integers have 16 times the values.
pub fn waves([nx, ny, nz]: [usize; 3], kind: Kind) -> Arc<Volume> {
    let value = |(k, j, i): (usize, usize, usize)| {
        let wave =
            (0.31 * i as f32).sin() + (0.23 * j as f32 + 0.11 * k as f32).cos() + (0.17 * k as f32).sin();
        (300.0 * wave).round() + ((i * 7 + j * 13 + k * 29) % 17) as f32
    };
    let values = Array3::from_shape_fn((nz, ny, nx), value);
    let (voxels, slope, intercept): (Voxels, _, _) = match kind {
        Kind::Narrow => (values.mapv(|v| v as i16).into(), 1.0, 0.0),
        Kind::Signed => (values.mapv(|v| 16 * v as i16).into(), -0.0625, 0.0),
        Kind::Unsigned => (values.mapv(|v| (16.0 * v + 30_000.0) as u16).into(), 0.0625, -1875.0),
        Kind::Float => (values.into(), 1.0, 0.0),
    };
    let axes = DMat3::from_rotation_x(0.2) * DMat3::from_diagonal(DVec3::new(1.0, 0.9, 0.8));
    let mut volume = volume_of(voxels, DAffine3::from_mat3_translation(axes, DVec3::new(3.0, -8.0, 5.0)));
    if slope != 1.0 {
        let scaling = umbravox::volume::Scaling { slope, intercept };
        let (affine, provenance) = (volume.world_from_index(), volume.provenance.clone());
        volume = Volume::new(volume.resident().unwrap().clone(), scaling, affine, provenance).unwrap();
    }
    Arc::new(volume)
}

fn sessions(volume: &Arc<Volume>, tf: &TransferFunction) -> Option<[Session; 2]> {
    let on = |renderer| Session::on(renderer, Arc::clone(volume), tf, DisabledOptimizations::NONE).unwrap();
    let both = devices()?.each_ref().map(on);
    assert!(both[0].transfer.pages.is_none() && both[1].transfer.pages.is_some());
    Some(both)
}

pub fn shell() -> TransferFunction {
    extinction(&[(150.0, 0.0), (500.0, 0.12)])
}

/// Points spread over the whole volume.
fn points(volume: &Volume) -> Vec<DVec3> {
    let dims = DVec3::from_array(volume.dims().map(|n| n as f64));
    let share = |i: usize| DVec3::new(0.618_034, 0.754_878, 0.569_84) * i as f64 % 1.0;
    (0..2000).map(|i| volume.world_from_index().transform_point3(share(i) * dims - 0.5)).collect()
}

/// Compares answers and pictures of methods to the last bit.
pub fn assert_same(volume: &Volume, both: &[Session; 2], scene: &Scene, methods: &[&str]) {
    let points = points(volume);
    for name in methods {
        let method = shadow::parse(name).unwrap();
        let [a, b] = both.each_ref().map(|session| {
            let map = session.shadow(method.as_ref(), scene.light()).unwrap();
            let nodes = map.report.nodes_total;
            (session.query(&map, &points).unwrap(), session.render(&map, scene).unwrap().pixels, nodes)
        });
        assert!(a.1.iter().any(|c| *c > 0.05), "{name}: nothing is seen");
        assert!(a.0 == b.0, "{name}: answers differ");
        assert!(a.1 == b.1, "{name}: pictures differ");
        assert_eq!(a.2, b.2, "{name}: nodes");
    }
}

#[test]
fn pages_are_the_volume_to_the_last_bit() {
    for (dims, kind) in [
        ([20, 30, 170], Kind::Narrow),
        ([170, 20, 14], Kind::Signed),
        ([9, 200, 40], Kind::Unsigned),
        ([160, 40, 9], Kind::Float),
    ] {
        let volume = waves(dims, kind);
        let Some(both) = sessions(&volume, &shell()) else { return };
        let scene = Scene { width: 96, height: 80, shading: Shading::Lambert, ..Scene::framing(&volume) };
        println!("{dims:?} {kind:?}: {:?}", both[1].transfer.pages);
        assert_same(&volume, &both, &scene, &["none", "rays", "dsm", "dsm:march=samples"]);
    }
}

#[test]
fn all_methods_read_pages() {
    let volume = waves([40, 30, 170], Kind::Unsigned);
    let Some(both) = sessions(&volume, &shell()) else { return };
    let scene = Scene { width: 48, height: 40, ..Scene::framing(&volume) };
    let methods = [
        "dsm:enclose=on",
        "osm",
        "dom:layers=4",
        "bom:march=samples",
        "lightvolume:scale=4",
        "lightvolume:scale=4,build=sweep",
        "avsm",
        "moments",
        "fourier",
        "clusters",
        "wavelet",
        "beer",
        "sat:scale=4",
    ];
    assert_same(&volume, &both, &scene, &methods);
}

/// Volumes of narrow waves: one with labels, functions of labels and a clip plane, and one with gradient opacity.
pub fn special([nx, ny, nz]: [usize; 3]) -> [(Arc<Volume>, TransferFunction); 2] {
    let plain = waves([nx, ny, nz], Kind::Narrow);
    let label = |(k, j, i): (usize, usize, usize)| ((i / 5 + j / 7 + k / 9) % 3) as u8;
    let labels = Array3::from_shape_fn((nz, ny, nx), label);
    let labels = Labels::sampled(&volume_of(labels.into(), plain.world_from_index()), &plain).unwrap();
    let labelled = Arc::new(Volume::clone(&plain).labelled(Arc::new(labels)).unwrap());
    let other = extinction(&[(-100.0, 0.0), (300.0, 0.05)]);
    let rules = vec![
        LabelRule { labels: vec![1], visibility: LabelVisibility::Hidden },
        LabelRule { labels: vec![2], visibility: LabelVisibility::Visible(Box::new(other)) },
    ];
    let clip = vec!["0.2,0.1,1,20".parse().unwrap()];
    let with_labels = TransferFunction { rules, clip, ..shell() };
    let gradient_opacity = "20:0,60:1".parse().unwrap();
    let with_gradient = TransferFunction { gradient_opacity: Some(gradient_opacity), ..shell() };
    [(labelled, with_labels), (plain, with_gradient)]
}

#[test]
fn labels_clip_planes_and_gradient_opacity_read_pages() {
    for (volume, tf) in special([20, 18, 170]) {
        let Some(both) = sessions(&volume, &tf) else { return };
        let scene = Scene { width: 64, height: 48, ..Scene::framing(&volume) };
        assert_same(&volume, &both, &scene, &["rays", "dsm:map=64"]);
    }
}

/// Voxels that are read in parts are those in memory: in one texture, as pages, with labels and in a camera's framing.
#[test]
fn volumes_that_are_read_in_parts_are_drawn_the_same() {
    let Some(renderers) = devices() else { return };
    let crop = Some(",60:99,60:99".parse().unwrap());
    let flags = ReadFlags { crop, ..ReadFlags::default() };
    let [whole, parts] = [flags.clone(), ReadFlags { host_memory: Some(ByteCount(1)), ..flags }]
        .map(|flags| load(&VolumeSpec { flags, ..VolumeSpec::new("phantom:struts:160") }).unwrap());
    assert!(whole.out_of_core().is_none() && parts.out_of_core().is_some());
    let label = |(k, j, i): (usize, usize, usize)| ((i / 40 + j / 20 + k / 30) % 2) as u8;
    let labels = volume_of(Array3::from_shape_fn((40, 40, 160), label).into(), whole.world_from_index());
    let labels = Arc::new(Labels::sampled(&labels, &whole).unwrap());
    let tf = TransferFunction {
        rules: vec![LabelRule { labels: vec![1], visibility: LabelVisibility::Hidden }],
        ..extinction(&[(200.0, 0.0), (800.0, 0.5)])
    };
    for renderer in renderers {
        let both =
            [&whole, &parts].map(|volume| Arc::new(volume.clone().labelled(Arc::clone(&labels)).unwrap()));
        let sessions = both.each_ref().map(|volume| {
            Session::on(renderer, Arc::clone(volume), &tf, DisabledOptimizations::NONE).unwrap()
        });
        let [scene, of_parts] = both.each_ref().map(|volume| {
            let bounds = VisibleBounds::of(volume, &tf, None);
            let camera = bounds.framed(DVec3::new(0.3, -1.0, 0.2), DVec3::Z, 30.0, 1.0);
            Scene { width: 64, height: 64, camera, ..Scene::framing(volume) }
        });
        assert_eq!(scene.camera, of_parts.camera);
        assert_same(&both[0], &sessions, &scene, &["rays", "dsm"]);
        both[1].check_reads().unwrap();
    }
}

/// Volume with 0 at one end and 300 at the other. Only values between have extinction, so that pages are empty on both sides
/// of the interface, with values below and above the extinction.
fn interface() -> Arc<Volume> {
    let value = |(k, j, i): (usize, usize, usize)| {
        let x = i as f32 + 0.2 * (0.9 * j as f32).sin() + 0.3 * (0.7 * k as f32).cos();
        (16.0 * 75.0 * (x - 98.0).clamp(0.0, 4.0)) as u16 + ((i + 3 * j + 5 * k) % 7) as u16
    };
    let voxels = Voxels::U16(Array3::from_shape_fn((24, 40, 250), value));
    Arc::new(volume_of(voxels, DAffine3::from_scale(DVec3::new(1.0, 0.9, 1.1))))
}

#[test]
fn empty_pages_have_no_extinction_on_either_side() {
    let volume = interface();
    let band = || extinction(&[(1500.0, 0.0), (1600.0, 0.3), (3200.0, 0.3), (3300.0, 0.0)]);
    let label = |(_, _, i): (usize, usize, usize)| u8::from(i >= 150);
    let labels = Array3::from_shape_fn((24, 40, 250), label);
    let labels = Labels::sampled(&volume_of(labels.into(), volume.world_from_index()), &volume).unwrap();
    let labelled = Arc::new(Volume::clone(&volume).labelled(Arc::new(labels)).unwrap());
    let other = extinction(&[(4900.0, 0.0), (5000.0, 0.1)]);
    let rules = vec![LabelRule { labels: vec![1], visibility: LabelVisibility::Visible(Box::new(other)) }];
    let forced: DisabledOptimizations = "bricks".parse().unwrap();
    for (volume, tf, disabled) in [
        (&volume, band(), DisabledOptimizations::NONE),
        (&volume, band(), forced),
        (&labelled, TransferFunction { rules, ..band() }, DisabledOptimizations::NONE),
    ] {
        let Some(renderers) = devices() else { return };
        let both = renderers
            .each_ref()
            .map(|renderer| Session::on(renderer, Arc::clone(volume), &tf, disabled).unwrap());
        let pages = both[1].transfer.pages.unwrap();
        assert!(pages.needed < pages.total, "{pages:?}");
        for step in [0.5, 8.0] {
            let scene = Scene { width: 48, height: 40, step, ..Scene::framing(volume) };
            assert_same(
                volume,
                &both,
                &scene,
                &["rays:march=samples,step=4", "dsm:near=32", "osm:march=samples"],
            );
        }
    }
}

/// Volume of small blobs of different values. A limit on memory leaves room for the pages of one of them at a time.
fn blobs() -> Arc<Volume> {
    let centres = [[16.0, 16.0, 16.0], [80.0, 80.0, 80.0], [100.0, 20.0, 60.0]];
    let value = |(k, j, i): (usize, usize, usize)| {
        let p = DVec3::new(i as f64, j as f64, k as f64);
        let of = |(n, c): (usize, &[f64; 3])| {
            (100.0 * (n + 1) as f64) * f64::from(u8::from(p.distance(DVec3::from_array(*c)) < 6.0))
        };
        centres.iter().enumerate().map(of).sum::<f64>() as f32
    };
    Arc::new(volume_of(Array3::from_shape_fn((120, 120, 120), value).into(), DAffine3::IDENTITY))
}

#[test]
fn transfer_functions_upload_the_pages_that_they_need() {
    let Some([whole, _]) = devices() else { return };
    let volume = blobs();
    let page_bytes = 33_u64.pow(3) * 4;
    let limited = Arc::new(limited(whole, 48));
    let tf = |value: f64| {
        extinction(&[(value - 60.0, 0.0), (value - 30.0, 0.3), (value + 30.0, 0.3), (value + 60.0, 0.0)])
    };
    let scene = Scene { width: 64, height: 48, ..Scene::framing(&volume) };
    let picture = |session: &Session| {
        let map = session.shadow(shadow::parse("dsm:map=64").unwrap().as_ref(), scene.light()).unwrap();
        session.render(&map, &scene).unwrap().pixels
    };
    let on = |renderer, tf: TransferFunction| {
        Session::on(renderer, Arc::clone(&volume), &tf, DisabledOptimizations::NONE)
    };
    let mut session = on(&limited, tf(300.0)).unwrap();
    let first = session.transfer.pages.unwrap();
    assert!(first.total == 64 && (1..=27).contains(&first.needed), "{first:?}");
    assert!(first.pool_bytes <= 48 * page_bytes, "{first:?}");
    let before = picture(&session);
    // Later functions need other pages; the former one stays valid.
    for value in [200.0, 100.0, 300.0] {
        let transfer = session.fresh_transfer(&tf(value)).unwrap();
        let former = std::mem::replace(&mut session.transfer, transfer);
        assert_eq!(picture(&session), picture(&on(whole, tf(value)).unwrap()), "{value}");
        let now = std::mem::replace(&mut session.transfer, former);
        picture(&session);
        session.transfer = now;
    }
    assert_eq!(picture(&session), before);
    // A function that needs more pages than the pool holds goes through them block by block.
    let all = extinction(&[(-1.0, 0.1), (400.0, 0.1)]);
    session.transfer = session.fresh_transfer(&all).unwrap();
    assert!(session.transfer.pages.unwrap().blocks > 1 && session.transfer.stream().is_some());
    assert_eq!(picture(&session), picture(&on(whole, all).unwrap()));
    session.transfer = session.fresh_transfer(&tf(300.0)).unwrap();
    assert_eq!(picture(&session), before);
}
