//! Fits the projection of a shadow map to all active bricks (blocks of cells with extinction), or to those in the
//! camera's view.

use super::boxes::{GridBox, Region};
use super::mapping::{LightSpace, MapShape, Projection};
use crate::field::constants::FAR;
use crate::field::{ActiveBricks, BrickHull, BrickRun, View, grid_from_world};
use crate::scene::Light;
use crate::volume::Volume;
use glam::{DAffine3, DMat3, DVec2, DVec3};
use rayon::prelude::*;
use std::borrow::Cow;

/// Tangent of the largest half angle of a perspective shadow map. A wider angle needs an octahedral shadow map, since
/// corner texels of a perspective one would be too coarse.
const WIDEST_TANGENT: f64 = 2.0;

/// Smallest and largest number of texels per side of a shadow map, if its size is chosen from the scene.
const LEAST_TEXELS: f64 = 64.0;
const MOST_TEXELS: f64 = 2048.0;
/// Width of a shadow-map texel in screen pixels, where a voxel covers several pixels.
const PIXELS_PER_TEXEL: f64 = 2.0;
/// Largest number of shadow-map texels across a voxel. Finer texels gain little, since the field is smooth there.
const MOST_TEXELS_PER_VOXEL: f64 = 2.0;
/// Factor by which the area and the texel width of a reused shadow map may exceed the needs of a new view. Beyond it,
/// the map is built again.
const MOST_TOO_LARGE: f64 = 2.0;

/// Ratio of areas, turned shadow map to default one, below which the axes of a shadow map are turned along the view
/// direction.
const WORTH_TURNING: f64 = 0.8;
/// Smallest sine of the angle between view and light direction at which the axes of a shadow map can be turned along
/// the view direction.
const LEAST_ACROSS: f64 = 0.05;

impl LightSpace {
    /// Fits the projection of a shadow map to all active bricks (blocks of cells with extinction), or to those in a
    /// camera's view. Except in an octahedral map, it leaves a border of empty texels.
    pub fn fit(
        volume: &Volume,
        active: &ActiveBricks,
        light: Light,
        shape: MapShape,
        view: Option<&View>,
    ) -> Self {
        let plain = Self::framed(volume, active, light, shape, None);
        let all = active.hull(volume.dims());
        let whole = plain.region_of(volume, active, all);
        let Some(view) = view.filter(|_| plain.can_fit_view()) else {
            return plain.laid_out(volume, whole, None);
        };
        // A map for a view without visible bricks covers everything.
        let Some(visible) = plain.visible_hull(volume, active, view) else {
            return plain.laid_out(volume, whole, None);
        };
        let wanted = plain.texel_wanted(volume, &visible, view);
        // The visible part often is a long strip: a frame along it has fewer unused texels.
        let turned = Self::framed(volume, active, light, shape, Some(view.forward()));
        let fitted = [plain, turned].map(|space| {
            let whole = space.region_of(volume, active, all);
            let region = space.region_of(volume, active, Some(&visible)).grown(view.margin).within(whole);
            (space, region, whole)
        });
        let [plain, turned] = fitted;
        let turn = turned.1.area() < WORTH_TURNING * plain.1.area();
        let (mut space, region, whole) = if turn { turned } else { plain };
        space.region = (region != whole).then_some(region);
        space.laid_out(volume, region, Some(wanted))
    }

    /// Returns a light space with the axes, the projection and the depth range of a shadow map, but without its
    /// texels. The first axis lies along the part of `along` that is perpendicular to the light.
    fn framed(
        volume: &Volume,
        active: &ActiveBricks,
        light: Light,
        shape: MapShape,
        along: Option<DVec3>,
    ) -> Self {
        let grid_from_world = grid_from_world(volume);
        let world_from_grid = grid_from_world.inverse();
        let bounds = GridBox::of_active(active, volume.dims());
        let center = world_from_grid.transform_point3(bounds.center);
        let (axis, distance) = match light {
            Light::Directional { toward } => (-toward.normalize(), f64::from(FAR)),
            Light::Point { position } => {
                let d = center - position;
                let axis = if d.length() > 1e-9 { d.normalize() } else { DVec3::Z };
                (axis, d.length())
            }
        };
        let across = along.map(|v| v - v.dot(axis) * axis).filter(|v| v.length() > LEAST_ACROSS);
        let a = across.map_or_else(|| axis.any_orthonormal_vector(), DVec3::normalize);
        let b = axis.cross(a);
        let mut space = Self {
            projection: Projection::Orthographic,
            map_size: shape.texels.unwrap_or(1),
            world_from_frame: DAffine3::from_mat3_translation(DMat3::from_cols(a, b, axis), center),
            frame_from_world: DAffine3::IDENTITY,
            grid_from_world,
            light_distance: distance,
            texel_scale: DVec2::ONE,
            texel_offset: DVec2::ZERO,
            z_range: [0.0, 0.0],
            step_mm: 0.0,
            near_mm: shape.near * volume.min_spacing_mm(),
            region: None,
            shape,
        };
        space.frame_from_world = space.world_from_frame.inverse();
        if let Light::Point { position } = light {
            let corners = bounds
                .corners()
                .map(|g| space.frame_from_world.transform_point3(world_from_grid.transform_point3(g)));
            let nearest = corners.iter().map(|c| c.z + distance).fold(f64::INFINITY, f64::min);
            let widest = corners
                .iter()
                .map(|c| c.truncate().abs().max_element() / (c.z + distance))
                .fold(0.0, f64::max);
            if nearest > 1e-3 * volume.min_spacing_mm() && widest < WIDEST_TANGENT {
                space.projection = Projection::Perspective;
            } else {
                space.projection = Projection::Octahedral;
                space.light_distance = 0.0;
                space.world_from_frame.translation = position;
                space.frame_from_world = space.world_from_frame.inverse();
            }
        }
        let [near, far] = space.depths(&world_from_grid, bounds);
        space.z_range = [near, far];
        space
    }

    /// Sets the texels of a shadow map to cover a rectangle of its projection plane. If the settings do not fix the
    /// number of texels, a texel is `wanted_mm` wide (`None`: as wide as a voxel).
    fn laid_out(mut self, volume: &Volume, covered: Region, wanted_mm: Option<f64>) -> Self {
        // Texels of a part are square; tiles outside it are not built.
        let region = if self.region.is_some() { covered.squared() } else { covered };
        if self.shape.texels.is_none() {
            let texel_mm = wanted_mm.unwrap_or(volume.min_spacing_mm());
            let across = self.mm_per_plane() * region.size().max_element() / texel_mm;
            let texels = across.ceil() + 2.0 * f64::from(self.shape.reach);
            self.map_size = texels.clamp(LEAST_TEXELS, MOST_TEXELS) as u32;
        }
        let size = f64::from(self.map_size);
        // A border of empty texels avoids a seam to the full light around the map. A map of a part of the scene
        // needs as many as a query reads.
        let border = match self.projection {
            Projection::Octahedral => 0.0,
            _ if self.map_size < MapShape::LEAST_WITH_BORDER => 0.0,
            _ if self.region.is_some() => f64::from(self.shape.reach),
            _ => f64::from(self.shape.border),
        };
        self.texel_scale = DVec2::splat(size - 2.0 * border) / region.size();
        self.texel_offset = DVec2::splat(border - 0.5) - region.lo * self.texel_scale;
        self
    }

    /// Whether this shadow map can be reused for another camera view of the same bricks under the same light (`None`:
    /// for all points). It has to cover the visible bricks; its area and its texel width may be at most twice what
    /// the view needs.
    pub fn serves(&self, volume: &Volume, active: &ActiveBricks, light: Light, view: Option<&View>) -> bool {
        let Some(view) = view.filter(|_| self.can_fit_view()) else {
            return self.region.is_none();
        };
        let Some(hull) = self.visible_hull(volume, active, view) else { return true };
        let hull = hull.as_ref();
        let region =
            self.region.unwrap_or_else(|| self.region_of(volume, active, active.hull(volume.dims())));
        let visible = self.region_of(volume, active, Some(hull));
        // Nothing outside the active bricks has extinction.
        let covered = self.region.is_none() || region.contains(visible);
        let turned = Self::framed(volume, active, light, self.shape, Some(view.forward()));
        let least = visible.area().min(turned.region_of(volume, active, Some(hull)).area());
        let wide = self.shape.texels.is_none() && {
            let most = self.mm_per_plane() * region.size().max_element() / MOST_TEXELS;
            self.texel_mm() > MOST_TOO_LARGE * self.texel_wanted(volume, hull, view).max(most)
        };
        covered && region.area() <= MOST_TOO_LARGE * least && !wide
    }

    /// Whether a new fit to a camera view (`None`: to all points), of the same bricks under the same light, would
    /// give the same projection as this shadow map has.
    pub fn is_fitted_to(
        &self,
        volume: &Volume,
        active: &ActiveBricks,
        light: Light,
        view: Option<&View>,
    ) -> bool {
        Self::fit(volume, active, light, self.shape, view).is_laid_out_as(self)
    }

    /// Whether the shadow map covers only those active bricks (blocks of cells with extinction) that lie in a
    /// camera's view.
    pub fn is_of_view(&self) -> bool {
        self.region.is_some()
    }

    /// Whether the shadow map covers the light ray through the given texel coordinates. Rays that are not covered
    /// need not be built.
    pub fn covers(&self, texel: DVec2) -> bool {
        let plane = (texel - self.texel_offset) / self.texel_scale;
        self.region.is_none_or(|region| region.contains(Region { lo: plane, hi: plane }))
    }

    /// Whether two shadow maps of one scene have the same light rays through the same texels.
    pub fn is_laid_out_as(&self, other: &Self) -> bool {
        (self.map_size, self.world_from_frame, self.texel_scale, self.texel_offset, self.region)
            == (other.map_size, other.world_from_frame, other.texel_scale, other.texel_offset, other.region)
    }

    /// Whether the shadow map may be limited to those active bricks (blocks of cells with extinction) that lie in the
    /// camera's view.
    fn can_fit_view(&self) -> bool {
        let has_border = self.shape.texels.is_none_or(|texels| texels >= MapShape::LEAST_WITH_BORDER);
        self.shape.fits_view && has_border && self.projection != Projection::Octahedral
    }

    /// Returns the hull of the active bricks (blocks of cells with extinction) that may be visible in a camera's view;
    /// `None` if none is.
    fn visible_hull<'a>(
        &self,
        volume: &Volume,
        active: &'a ActiveBricks,
        view: &View,
    ) -> Option<Cow<'a, BrickHull>> {
        let dims = volume.dims();
        let all = active.hull(dims)?;
        let frustum = view.frustum(&self.grid_from_world.inverse());
        if frustum.contains(&all.corners) {
            return Some(Cow::Borrowed(all));
        }
        let visible = |run: &BrickRun| {
            let at = |x: u32| {
                let [low, high] = run.bounds_of([x, x], dims);
                [0.5 * (low + high), 0.5 * (high - low)]
            };
            frustum.clip_row(run.x, at).map(|x| BrickRun { x, ..*run })
        };
        let runs: Vec<BrickRun> = active.runs().par_iter().with_min_len(256).filter_map(visible).collect();
        BrickHull::of(&runs, dims).map(Cow::Owned)
    }

    /// Returns the smallest rectangle in the projection plane of the shadow map that contains the projections of
    /// bricks; without bricks, that of the box around all active bricks.
    fn region_of(&self, volume: &Volume, active: &ActiveBricks, hull: Option<&BrickHull>) -> Region {
        if self.projection == Projection::Octahedral {
            return Region { lo: DVec2::NEG_ONE, hi: DVec2::ONE };
        }
        let frame_from_grid = self.frame_from_world * self.grid_from_world.inverse();
        let around = GridBox::of_active(active, volume.dims()).corners();
        let corners = hull.map_or(&around[..], |hull| &hull.corners);
        Region::around(corners.iter().map(|g| self.plane(frame_from_grid.transform_point3(*g))))
    }

    /// Returns the width of a shadow-map texel if the scene determines it, mm: one voxel, or less if voxels appear
    /// larger than a pixel in the camera's view.
    fn texel_wanted(&self, volume: &Volume, visible: &BrickHull, view: &View) -> f64 {
        let voxel = volume.min_spacing_mm();
        let middle = self.grid_from_world.inverse().transform_point3(visible.center);
        (PIXELS_PER_TEXEL * view.pixel_mm(middle)).clamp(voxel / MOST_TEXELS_PER_VOXEL, voxel)
    }
}
