//! Light space in float64: rays and points are inverse to each other, and tiles cover all active bricks.

use fastrand::Rng;
use glam::{DVec2, DVec3};
use umbravox::field::{ActiveBricks, LightSpace, MapShape, March, Projection, TILE, View};
use umbravox::open::presets;
use umbravox::open::{VolumeSpec, load};
use umbravox::scene::{Camera, Light, Scene};
use umbravox::volume::{BRICK_CELLS, Volume};

fn chest() -> (Volume, ActiveBricks) {
    let volume = load(&VolumeSpec::new("phantom:thorax:70")).unwrap();
    let tf = presets::resolve("bone", &volume).unwrap().tf;
    let active = ActiveBricks::of(volume.bricks(), &tf);
    (volume, active)
}

fn shape(texels: u32) -> MapShape {
    MapShape { texels: Some(texels), fits_view: true, reach: 1, border: 1, march: March::Cells, near: 0.0 }
}

fn lights(volume: &Volume) -> [(Projection, Light); 5] {
    let (center, radius) = volume.bounding_sphere_mm();
    let at =
        |distance: f64| Light::Point { position: center + DVec3::new(0.6, -0.64, 0.48) * distance * radius };
    [
        (Projection::Orthographic, Light::Directional { toward: DVec3::new(0.3, 2.0, -0.9) }),
        (Projection::Orthographic, Light::Directional { toward: -DVec3::Z }),
        (Projection::Perspective, at(30.0)),
        (Projection::Perspective, at(2.5)),
        (Projection::Octahedral, at(0.2)),
    ]
}

#[test]
fn rays_and_points_are_inverse() {
    let (volume, active) = chest();
    let mut random = Rng::with_seed(1);
    for (projection, light) in lights(&volume) {
        let space = LightSpace::fit(&volume, &active, light, shape(300), None);
        assert_eq!(space.projection, projection);
        let [near, far] = space.z_range;
        assert!(near < far);
        for _ in 0..2000 {
            let texel = DVec2::new(random.f64(), random.f64()) * 299.0;
            let z = near + (far - near) * (0.01 + 0.99 * random.f64());
            let (origin, direction) = space.world_ray(texel);
            assert!((direction.length() - 1.0).abs() < 1e-12);
            let (found, depth) = space.light_point(origin + z * direction);
            assert!(
                found.distance(texel) < 1e-6 && (depth - z).abs() < 1e-6,
                "{projection:?}: {texel} {found}, {z} {depth}"
            );
            // The ray points away from the light, and passes through it.
            match light {
                Light::Directional { toward } => assert!(direction.dot(toward.normalize()) < -1.0 + 1e-12),
                Light::Point { position } => {
                    let to_light = position - origin;
                    assert!((to_light - to_light.dot(direction) * direction).length() < 1e-6);
                    assert!((origin + z * direction - position).dot(direction) > 0.0);
                }
            }
        }
    }
}

/// Random points of active bricks lie in a built tile and within the depth range, for any size of the shadow map.
#[test]
fn tiles_cover_every_active_brick() {
    let (volume, active) = chest();
    let dims = volume.dims();
    let mut random = Rng::with_seed(2);
    let [nx, ny, _] = active.counts;
    let bricks: Vec<[usize; 3]> = (0..active.distance.len())
        .filter(|&i| active.distance[i] == 0)
        .map(|i| [i % nx, i / nx % ny, i / (nx * ny)])
        .collect();
    assert!(bricks.len() > 50 && bricks.len() < active.distance.len());
    for (projection, light) in lights(&volume) {
        for map in [1u32, 16, 17, 100, 512] {
            let space = LightSpace::fit(&volume, &active, light, shape(map), None);
            let tiles = space.occupied_tiles(&volume, &active);
            let across = space.tiles_across();
            assert_eq!((across, tiles.across()), (map.div_ceil(TILE), across));
            for _ in 0..4000 {
                let brick = bricks[random.usize(..bricks.len())];
                let index = DVec3::from_array(std::array::from_fn(|a| {
                    let cell = (brick[a] * BRICK_CELLS) as f64 + random.f64() * BRICK_CELLS as f64;
                    (cell - 1.0).clamp(-0.5, dims[a] as f64 - 0.5)
                }));
                let (texel, z) = space.light_point(volume.world_from_index().transform_point3(index));
                let half = DVec2::splat(0.5 + 1e-9);
                assert!(
                    texel.cmpge(-half).all() && texel.cmple(DVec2::splat(f64::from(map)) - half + 2e-9).all(),
                    "{texel}"
                );
                // Every texel that a bilinear lookup there reads.
                for corner in [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE] {
                    let t = (texel.floor() + corner).clamp(DVec2::ZERO, DVec2::splat(f64::from(map - 1)));
                    let [x, y] = [t.x as u32 / TILE, t.y as u32 / TILE];
                    let [z_min, z_max] = space.z_range;
                    assert!(
                        tiles.contains([x, y]) && z_min <= z && z <= z_max,
                        "{projection:?}, map {map}: {index} at texel {texel}, depth {z} of {z_min}..{z_max}"
                    );
                }
            }
        }
    }
}

#[test]
fn tiles_without_bricks_are_left_out() {
    let (volume, active) = chest();
    let light = Light::Directional { toward: DVec3::new(1.0, 1.0, 1.0) };
    let tiles = LightSpace::fit(&volume, &active, light, shape(512), None).occupied_tiles(&volume, &active);
    let all = tiles.across().pow(2);
    assert!(
        tiles.len() < all - all / 20,
        "a box seen along its diagonal leaves corners empty: {} of {all}",
        tiles.len()
    );
}

/// Random visible points lie inside a shadow map that is fitted to the view, at least one texel from its edge.
#[test]
fn a_map_of_a_view_covers_the_visible_points() {
    let (volume, active) = chest();
    let mut random = Rng::with_seed(3);
    let whole = Camera::framing(&volume, DVec3::Z, 40.0);
    let inside = Camera { eye: whole.target + DVec3::new(20.0, 5.0, 0.0), fov_deg: 50.0, ..whole };
    for camera in [whole, Camera { fov_deg: 6.0, ..whole }, inside] {
        let scene = Scene { camera, width: 300, height: 200, ..Scene::framing(&volume) };
        let view = View::of(&scene);
        for (projection, light) in lights(&volume) {
            let space = LightSpace::fit(&volume, &active, light, shape(100), Some(&view));
            let tiles = space.occupied_tiles(&volume, &active);
            let everything = LightSpace::fit(&volume, &active, light, shape(100), None);
            let finer = projection != Projection::Octahedral && camera.fov_deg < 10.0;
            assert!(
                space.texel_mm() < if finer { 0.95 } else { 1.001 } * everything.texel_mm(),
                "{projection:?}"
            );
            assert!(space.serves(&volume, &active, light, Some(&view)));
            assert!(everything.serves(&volume, &active, light, None));
            assert_eq!(
                space.serves(&volume, &active, light, None),
                space.texel_mm() == everything.texel_mm()
            );
            let mut seen = 0;
            for _ in 0..20_000 {
                let (i, j) = (300.0 * random.f64() - 0.5, 200.0 * random.f64() - 0.5);
                let away = (camera.eye.distance(camera.target) + 600.0 * (random.f64() - 0.5)).max(1.0);
                let point = camera.eye + away * camera.ray_direction(i, j, 300, 200);
                let grid = volume.index_from_world().transform_point3(point) + 1.0;
                let brick = (grid / BRICK_CELLS as f64).floor();
                let counts = DVec3::from_array(active.counts.map(|n| n as f64));
                if brick.cmplt(DVec3::ZERO).any() || brick.cmpge(counts).any() {
                    continue;
                }
                let at = brick.x + counts.x * (brick.y + counts.y * brick.z);
                let dims = DVec3::from_array(volume.dims().map(|n| n as f64));
                if active.distance[at as usize] > 0
                    || grid.cmplt(DVec3::splat(0.5)).any()
                    || grid.cmpgt(dims + 0.5).any()
                {
                    continue;
                }
                seen += 1;
                let (texel, _) = space.light_point(point);
                let rim = if projection == Projection::Octahedral { -0.5 } else { 0.5 };
                let (low, high) = (DVec2::splat(rim - 1e-6), DVec2::splat(99.0 - rim + 1e-6));
                assert!(
                    texel.cmpge(low).all() && texel.cmple(high).all(),
                    "{projection:?}: {point} at {texel}"
                );
                // Every texel that a bilinear query reads there is in a tile that is built.
                for corner in [DVec2::ZERO, DVec2::X, DVec2::Y, DVec2::ONE] {
                    let t = (texel.floor() + corner).clamp(DVec2::ZERO, DVec2::splat(99.0));
                    let [x, y] = [t.x as u32 / TILE, t.y as u32 / TILE];
                    assert!(tiles.contains([x, y]), "{projection:?}: {texel}");
                }
            }
            assert!(seen > 300, "{seen}");
        }
    }
}
