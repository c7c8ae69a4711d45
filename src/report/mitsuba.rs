//! Scenes for Mitsuba 3, an independent renderer: extinction and colour as grid volumes, camera and lights as XML.
//!
//! Mitsuba's `volpath` with paths of two segments computes single scattering. Our picture without ambient light is the same
//! integral: albedo is the colour of the transfer function, and the factor `1 / (4 pi)` of the phase function is taken
//! into the radiance of the lights. Grid volumes are interpolated between points of a grid, so extinction and colour are
//! equal everywhere if they are linear in the value, and the value is constant beyond the outer voxel centres in both.

use crate::error::{Error, Result};
use crate::files::output::{prepare_output_dir, write_whole};
use crate::random::Chance;
use crate::scene::{Extent, Light, LightSource, Scene, Shading};
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use glam::{DAffine3, DMat4, DVec3};
use rayon::prelude::*;
use std::f64::consts::PI;
use std::io::{self, Write};
use std::path::Path;

/// Name of the file with the scene in the exported folder.
pub const SCENE_FILE: &str = "scene.xml";
const EXTINCTION_FILE: &str = "extinction.vol";
const ALBEDO_FILE: &str = "albedo.vol";
/// Samples a pixel in the exported scene.
const SAMPLES: u32 = 256;
/// Largest number of points of a grid.
const MOST_POINTS: usize = 1 << 29;
/// Number of random points at which the extinction of the grid is compared.
const COMPARED_POINTS: usize = 20_000;

/// Difference between the extinction of the grid and that of the transfer function, at random points of the domain.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct GridError {
    /// Largest difference, 1/mm.
    pub max_per_mm: f64,
    /// Largest extinction at these points, 1/mm.
    pub largest_extinction_per_mm: f64,
}

/// Writes a scene for Mitsuba 3 into a folder, which is created: `scene.xml`, `extinction.vol` and `albedo.vol`. The grids have
/// `supersample` points for each voxel along each axis.
///
/// # Errors
/// Mitsuba has no counterpart of the scene, or a file cannot be written.
pub fn write_mitsuba(
    folder: &Path,
    volume: &Volume,
    tf: &TransferFunction,
    scene: &Scene,
    supersample: usize,
) -> Result<GridError> {
    check(volume, tf, scene)?;
    let count = volume.dims().iter().map(|n| n * supersample).product::<usize>();
    if count > MOST_POINTS {
        let why = format!("its grid would have {count} points, and at most {MOST_POINTS} are written");
        return Err(
            Error::input("cannot export to Mitsuba", "scene", why).hint("--supersample 1, or --downsample")
        );
    }
    let grid = Grid { volume, points: volume.dims().map(|n| n * supersample) };
    prepare_output_dir(folder)?;
    let extinction = grid.values(|value| [tf.extinction(value)]);
    let albedo = grid.values(|value| tf.color(value));
    grid.write(&folder.join(EXTINCTION_FILE), &extinction)?;
    grid.write(&folder.join(ALBEDO_FILE), &albedo)?;
    let text = scene_xml(volume, scene);
    write_whole(&folder.join(SCENE_FILE), |file| file.write_all(text.as_bytes()))?;
    Ok(grid.error(tf, &extinction))
}

/// Fails if Mitsuba has no counterpart of a scene.
///
/// # Errors
/// The scene has ambient light, shading, opaque objects, labels, clip planes, a gradient opacity, or lights of other kinds than directional
/// ones and a sky.
fn check(volume: &Volume, tf: &TransferFunction, scene: &Scene) -> Result<()> {
    let refuse = |why: &str, hint: &'static str| {
        Err(Error::input("cannot export to Mitsuba", "scene", why).hint(hint))
    };
    if scene.ambient != 0.0 {
        return refuse("ambient light has no counterpart", "--ambient 0");
    }
    if !matches!(scene.shading, Shading::None | Shading::Phase) {
        return refuse(
            "shading has no counterpart, but for a phase function",
            "--shading none, or --phase G",
        );
    }
    if scene.mesh.is_some() || volume.labels().is_some() || !(tf.rules.is_empty() && tf.clip.is_empty()) {
        return refuse("opaque objects, labels and clip planes have no counterpart", "leave them out");
    }
    let is_known = |source: &LightSource| {
        let is_known = source.extent == Extent::None || source.extent == Extent::SKY;
        is_known && matches!(source.light, Light::Directional { .. })
    };
    if tf.gradient_opacity.is_some() {
        return refuse("gradient opacity has no counterpart", "--gradient-opacity none");
    }
    if !scene.sources_shining().iter().all(is_known) {
        let why = "its light falls off with distance, and the lights here do not; a cone of directions or a map has no counterpart";
        return refuse(why, "--light dir:x,y,z or sky");
    }
    Ok(())
}

/// Regular grid over the domain of a volume. Its points are the centres of equal boxes.
struct Grid<'a> {
    volume: &'a Volume,
    /// Number of points along each axis.
    points: [usize; 3],
}

impl Grid<'_> {
    /// Returns the index position of a point of the grid.
    fn index_position(&self, point: [usize; 3]) -> DVec3 {
        let dims = self.volume.dims();
        let along =
            |axis: usize| (point[axis] as f64 + 0.5) * dims[axis] as f64 / self.points[axis] as f64 - 0.5;
        DVec3::new(along(0), along(1), along(2))
    }

    /// Returns channels of all points as functions of the value, x fastest.
    fn values<const N: usize>(&self, of_value: impl Fn(f64) -> [f64; N] + Sync) -> Vec<[f32; N]> {
        let [nx, ny, nz] = self.points;
        let at = |i: usize| [i % nx, i / nx % ny, i / (nx * ny)];
        let value = |i: usize| of_value(self.volume.value_at(self.index_position(at(i)))).map(|x| x as f32);
        (0..nx * ny * nz).into_par_iter().map(value).collect()
    }

    /// Writes channels of all points in Mitsuba's binary format of volumes, version 3: dimensions and number of channels as
    /// `i32`, the unit cube as bounds, and `f32` values.
    fn write<const N: usize>(&self, path: &Path, values: &[[f32; N]]) -> Result<()> {
        write_whole(path, |file: &mut dyn Write| -> io::Result<()> {
            file.write_all(b"VOL\x03")?;
            let header = [1, self.points[0], self.points[1], self.points[2], N];
            header.into_iter().try_for_each(|n| file.write_all(&(n as i32).to_le_bytes()))?;
            let bounds = [0.0_f32, 0.0, 0.0, 1.0, 1.0, 1.0];
            bounds
                .into_iter()
                .chain(values.iter().flatten().copied())
                .try_for_each(|x| file.write_all(&x.to_le_bytes()))
        })
    }

    /// Compares the interpolated extinction of the grid with that of the transfer function.
    fn error(&self, tf: &TransferFunction, extinction: &[[f32; 1]]) -> GridError {
        let mut chance = Chance::new(1, 0);
        let mut error = GridError { max_per_mm: 0.0, largest_extinction_per_mm: 0.0 };
        for _ in 0..COMPARED_POINTS {
            let unit = [(); 3].map(|()| chance.unit());
            let dims = self.volume.dims();
            let position =
                DVec3::from_array(std::array::from_fn(|axis| unit[axis] * dims[axis] as f64 - 0.5));
            let exact = tf.extinction(self.volume.value_at(position));
            let off = (self.interpolated(extinction, unit) - exact).abs();
            error.max_per_mm = error.max_per_mm.max(off);
            error.largest_extinction_per_mm = error.largest_extinction_per_mm.max(exact);
        }
        error
    }

    /// Returns the trilinear interpolation of values at a position in the unit cube, clamped at the outer points.
    fn interpolated(&self, values: &[[f32; 1]], unit: [f64; 3]) -> f64 {
        let along: [(usize, usize, f64); 3] = std::array::from_fn(|axis| {
            let last = self.points[axis] - 1;
            let p = (unit[axis] * self.points[axis] as f64 - 0.5).clamp(0.0, last as f64);
            let low = (p as usize).min(last);
            (low, (low + 1).min(last), p - low as f64)
        });
        let [nx, ny, _] = self.points;
        (0..8_usize)
            .map(|corner| {
                let pick = |axis: usize| match corner >> axis & 1 {
                    0 => (along[axis].0, 1.0 - along[axis].2),
                    _ => (along[axis].1, along[axis].2),
                };
                let [(i, x), (j, y), (k, z)] = [0, 1, 2].map(pick);
                x * y * z * f64::from(values[i + nx * (j + ny * k)][0])
            })
            .sum()
    }
}

/// Returns the text of the scene file.
fn scene_xml(volume: &Volume, scene: &Scene) -> String {
    let numbers = |v: DVec3| format!("{}, {}, {}", v.x, v.y, v.z);
    let camera = &scene.camera;
    let phase = match scene.shading {
        Shading::Phase => {
            format!("<phase type=\"hg\"><float name=\"g\" value=\"{}\"/></phase>", scene.mean_cosine)
        }
        _ => "<phase type=\"isotropic\"/>".into(),
    };
    let dims = volume.dims().map(|n| n as f64);
    // From the unit cube of grid volumes to index positions, and on to the world.
    let index_from_unit = DAffine3::from_scale(DVec3::from_array(dims));
    let domain = volume.world_from_index() * DAffine3::from_translation(DVec3::splat(-0.5)) * index_from_unit;
    // The cube of Mitsuba is [-1, 1]^3.
    let cube =
        domain * DAffine3::from_translation(DVec3::splat(0.5)) * DAffine3::from_scale(DVec3::splat(0.5));
    let mut text = format!(
        r#"<scene version="3.0.0">
  <integrator type="volpath">
    <integer name="max_depth" value="2"/>
    <integer name="rr_depth" value="1000"/>
    <boolean name="hide_emitters" value="true"/>
  </integrator>
  <sensor type="perspective">
    <float name="fov" value="{fov}"/>
    <string name="fov_axis" value="y"/>
    <float name="near_clip" value="{near}"/>
    <float name="far_clip" value="{far}"/>
    <transform name="to_world"><lookat origin="{eye}" target="{target}" up="{up}"/></transform>
    <film type="hdrfilm">
      <integer name="width" value="{width}"/>
      <integer name="height" value="{height}"/>
      <string name="pixel_format" value="rgba"/>
      <rfilter type="box"/>
    </film>
    <sampler type="independent"><integer name="sample_count" value="{SAMPLES}"/></sampler>
  </sensor>
  <shape type="cube">
    <transform name="to_world"><matrix value="{cube}"/></transform>
    <bsdf type="null"/>
    <medium name="interior" type="heterogeneous">
      {extinction}
      {albedo}
      {phase}
    </medium>
  </shape>
"#,
        fov = camera.fov_deg,
        near = 1e-3 * volume.min_spacing_mm(),
        far = 10.0 * volume.corners_mm().iter().map(|c| c.distance(camera.eye)).fold(0.0, f64::max),
        eye = numbers(camera.eye),
        target = numbers(camera.target),
        up = numbers(camera.up),
        width = scene.width,
        height = scene.height,
        cube = matrix(cube),
        extinction = grid_volume("sigma_t", EXTINCTION_FILE, domain),
        albedo = grid_volume("albedo", ALBEDO_FILE, domain),
    );
    for source in scene.sources_shining() {
        text += &emitter(&source);
    }
    text + "</scene>\n"
}

fn grid_volume(name: &str, file: &str, domain: DAffine3) -> String {
    format!(
        "<volume name=\"{name}\" type=\"gridvolume\"><string name=\"filename\" value=\"{file}\"/><boolean name=\"raw\" \
        value=\"true\"/><transform name=\"to_world\"><matrix value=\"{}\"/></transform></volume>",
        matrix(domain)
    )
}

/// Returns the element of a light: of all directions, or of one. A phase function has the mean `1 / (4 pi)`.
fn emitter(source: &LightSource) -> String {
    let rgb = |factor: f64| source.radiance().map(|c| (factor * c).to_string()).join(", ");
    let (toward, _) = source.light.from_point(DVec3::ZERO);
    match source.extent {
        Extent::None => format!(
            "  <emitter type=\"directional\"><vector name=\"direction\" value=\"{}, {}, {}\"/><rgb name=\"irradiance\" \
            value=\"{}\"/></emitter>\n",
            -toward.x,
            -toward.y,
            -toward.z,
            rgb(4.0 * PI)
        ),
        _ => format!(
            "  <emitter type=\"constant\"><rgb name=\"radiance\" value=\"{}\"/></emitter>\n",
            rgb(1.0)
        ),
    }
}

/// Returns the 16 numbers of a transform row by row.
fn matrix(transform: DAffine3) -> String {
    let rows = DMat4::from(transform).transpose().to_cols_array();
    rows.map(|x| x.to_string()).join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::phantom::Phantom;
    use crate::transfer::Quantity;

    #[test]
    fn grids_are_exact_for_linear_functions_and_finer_ones_nearer_for_others() {
        let folder = tempfile::tempdir().unwrap();
        let volume = Phantom::Shell.build(8).unwrap();
        let scene = Scene { ambient: 0.0, ..Scene::framing(&volume) };
        let written = |name: &str, points: &[(f64, f64)], supersample: usize| {
            let tf = TransferFunction::new(Quantity::Extinction, points);
            write_mitsuba(&folder.path().join(name), &volume, &tf, &scene, supersample).unwrap()
        };
        let linear = written("linear", &[(-10.0, 0.0), (2000.0, 0.2)], 1);
        assert!(linear.max_per_mm < 1e-7 && linear.largest_extinction_per_mm > 0.05, "{linear:?}");
        let bent = [(0.0, 0.0), (400.0, 0.0), (500.0, 0.2)];
        let [coarse, fine] = [("coarse", 1), ("fine", 8)].map(|(name, n)| written(name, &bent, n).max_per_mm);
        assert!(coarse > 0.01 && fine < 0.6 * coarse, "{coarse}, {fine}");
        let points = volume.dims().iter().product::<usize>() as u64;
        let bytes = |name: &str| std::fs::metadata(folder.path().join("linear").join(name)).unwrap().len();
        assert_eq!([bytes(EXTINCTION_FILE), bytes(ALBEDO_FILE)], [48 + 4 * points, 48 + 12 * points]);
    }

    #[test]
    fn scenes_without_a_counterpart_are_refused_before_a_folder_is_made() {
        let folder = tempfile::tempdir().unwrap();
        let volume = Phantom::Shell.build(8).unwrap();
        let tf = TransferFunction::new(Quantity::Extinction, &[(0.0, 0.0), (900.0, 0.2)]);
        let dark = Scene { ambient: 0.0, ..Scene::framing(&volume) };
        let point = Light::Point { position: DVec3::ONE };
        let sun = LightSource { extent: Extent::Cone { angle_deg: 5.0 }, ..LightSource::default() };
        for scene in [
            Scene::framing(&volume),
            Scene { shading: Shading::Lambert, ..dark.clone() },
            dark.under(point.into()),
            dark.under(sun),
        ] {
            let path = folder.path().join("scene");
            assert!(write_mitsuba(&path, &volume, &tf, &scene, 1).is_err() && !path.exists());
        }
    }
}
