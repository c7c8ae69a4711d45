//! Extreme but valid volumes, transfer functions and settings: results are finite and in range, without a panic.

use super::*;
use umbravox::scene::{Camera, Skip};

const METHODS: [&str; 24] = [
    "none",
    "rays",
    "dsm:map=32",
    "dsm:map=32,epsilon=0",
    "dsm:map=32,epsilon=1",
    "dsm:map=32,prefilter=5",
    "dsm:map=17,prefilter=9,filter=nearest",
    "dsm:map=32,precompress=off",
    "dsm:map=16,precompress=off,prefilter=9,offset=2",
    "osm:map=32,layers=9,slicing=density,kernel=3,bits=8",
    "osm:map=17,layers=33,slicing=gamma,filter=nearest,bits=32",
    "dom:map=32,layers=3,depth_bits=8,bits=8",
    "dom:map=17,layers=1,spread=0.01,beyond=ignore,depth_bits=32,filter=nearest",
    "bom:map=17,layers=7,split=auto,measure=difference,depth_bits=32,bits=32",
    "bom:map=32,layers=5,split=texel,depth_bits=8,bits=8",
    "osm:map=17,layers=9,slicing=lit,average=transmittance",
    "dom:map=17,layers=6,split=texel,depth_bits=32,average=transmittance,lookup=each",
    "bom:map=17,layers=5,split=growing,log_size=2,lookup=each",
    "wavelet:map=32",
    "wavelet:map=17,rank=6,range=texel,bits=32",
    "beer:map=32",
    "beer:map=17,mean=matter,bits=32,align=on",
    "sat:scale=1",
    "sat:scale=2.5,boxes=3,angle=40,filter=nearest,lookup=each",
];

/// Asserts sane pictures and transmittances for every shadow method, light and way of skipping.
fn survives(volume: Volume, tf: &TransferFunction, what: &str) {
    let volume = Arc::new(volume);
    let Some(setup) = Setup::open(&volume, tf) else { return };
    let [near, far] = [volume.corners_mm()[0], volume.corners_mm()[7]];
    let points: Vec<DVec3> = (0..=20).map(|i| near.lerp(far, f64::from(i) / 20.0)).collect();
    let [directional, _, _, inside] = lights(&volume);
    for (place, light) in [directional, inside] {
        for method in METHODS {
            let map = setup.shadow(method, light);
            let inside = Camera { eye: near.lerp(far, 0.4), target: far, ..setup.scene(1, 1).camera };
            for scene in [setup.scene(13, 9), Scene { camera: inside, skip: Skip::None, ..setup.scene(7, 5) }]
            {
                let picture = setup.picture_of(&map, &Scene { lights: vec![light.into()], ..scene });
                let bad = picture.iter().find(|v| !(0.0..=1.0 + tolerance::RANGE as f32).contains(*v));
                assert_eq!(bad, None, "{what}, {place}, {method}: a picture's channel");
            }
            let values = setup.query(&map, &points);
            let bad = values.iter().find(|v| !(0.0..=1.0 + tolerance::RANGE as f32).contains(*v));
            assert_eq!(bad, None, "{what}, {place}, {method}: a transmittance");
            let counts = map.report;
            assert!(
                counts.tiles_left_out <= counts.tiles && counts.texels_hit.unwrap_or(0) <= 1024,
                "{counts:?}"
            );
        }
    }
}

fn floats([nx, ny, nz]: [usize; 3], f: impl Fn(usize, usize, usize) -> f32) -> Volume {
    volume_of(Voxels::F32(Array3::from_shape_fn((nz, ny, nx), |(k, j, i)| f(i, j, k))), DAffine3::IDENTITY)
}

fn rough(i: usize, j: usize, k: usize) -> f32 {
    ((i * 37 + j * 11 + k * 23) % 101) as f32
}

#[test]
fn shapes() {
    let [_, jumps, _] = transfer_functions([0.0, 100.0]);
    // 7 voxels make 8 cells, one brick; 8 make one more.
    for dims in [[1, 1, 1], [1, 1, 19], [33, 1, 1], [2, 1, 40], [7, 7, 7], [8, 8, 8], [15, 7, 8]] {
        survives(floats(dims, rough), &jumps, &format!("{dims:?}"));
    }
}

#[test]
fn values() {
    let [ramp, jumps, peaks] = transfer_functions([0.0, 100.0]);
    survives(floats([6, 6, 6], |_, _, _| 50.0), &ramp, "uniform");
    survives(
        floats([9, 9, 9], |i, j, k| if (i + j + k) % 3 == 0 { f32::NAN } else { rough(i, j, k) }),
        &jumps,
        "NaN",
    );
    survives(
        floats([9, 9, 9], |i, j, k| if i == 4 { f32::INFINITY } else { rough(i, j, k) }),
        &peaks,
        "infinite",
    );
    for scale in [1e-30, 1e30] {
        let tf = &transfer_functions([0.0, 100.0 * f64::from(scale)])[1];
        survives(floats([9, 9, 9], |i, j, k| rough(i, j, k) * scale), tf, &format!("values of {scale:e}"));
    }
    survives(
        volume_of(
            Voxels::F64(Array3::from_shape_fn((5, 5, 5), |(k, j, i)| f64::from(rough(i, j, k)) * 1e250)),
            DAffine3::IDENTITY,
        ),
        &transfer_functions([0.0, 1e252])[0],
        "values of 1e250",
    );
    survives(
        volume_of(
            Voxels::U16(Array3::from_shape_fn((5, 5, 5), |(k, j, i)| (rough(i, j, k) * 655.0) as u16)),
            DAffine3::IDENTITY,
        ),
        &transfer_functions([0.0, 65_500.0])[2],
        "16 bits",
    );
}

#[test]
fn transfer_function_ends() {
    let volume = || floats([9, 9, 9], rough);
    for (what, tf) in [
        ("no extinction", extinction(&[(0.0, 0.0), (100.0, 0.0)])),
        ("no extinction, one point", extinction(&[(50.0, 0.0)])),
        ("fully opaque", opacity(&[(0.0, 1.0)])),
        ("fully opaque beyond a jump", opacity(&[(40.0, 0.0), (40.0, 1.0)])),
        ("the same everywhere", extinction(&[(50.0, 0.02)])),
        ("huge extinction", extinction(&[(0.0, 0.0), (100.0, 1e12)])),
        ("vanishing extinction", extinction(&[(0.0, 0.0), (100.0, 1e-30)])),
        ("above every value", extinction(&[(1e6, 0.0), (2e6, 1.0)])),
        ("below every value", extinction(&[(-2e6, 1.0), (-1e6, 0.0)])),
        (
            "points that float32 cannot tell apart",
            extinction(&[(50.0, 0.0), (50.000_000_1, 0.4), (50.000_000_2, 0.0)]),
        ),
    ] {
        survives(volume(), &tf, what);
    }
}

#[test]
fn nothing_is_lit_through_and_everything_where_nothing_is() {
    let volume = Arc::new(floats([9, 9, 9], rough));
    let scene = |s: &Setup| Scene { ambient: 0.0, ..s.scene(16, 16) };
    let Some(empty) = Setup::open(&volume, &extinction(&[(0.0, 0.0)])) else { return };
    for method in METHODS {
        let picture = empty.picture(method, &scene(&empty));
        let background = [0.1f32, 0.25, 0.4, 0.0];
        assert!(picture.indexed_iter().all(|((_, _, c), v)| *v == background[c]), "{method}");
    }
    let Some(solid) = Setup::open(&volume, &opacity(&[(0.0, 1.0)])) else { return };
    for (_, light) in lights(&volume) {
        let middle = solid.query(&solid.shadow("dsm:map=32", light), &[DVec3::new(4.0, 4.1, 3.9)]);
        let beyond = matches!(light, Light::Directional { .. });
        // The map may be wrong by its epsilon.
        assert!(!beyond || middle[0] < 0.025, "{middle:?}");
        let rays = solid.query(&solid.shadow("rays", light), &[DVec3::new(4.0, 4.1, 3.9)]);
        assert!(!beyond || rays[0] < 1e-3, "{rays:?}");
    }
}
