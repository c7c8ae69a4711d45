//! Fitting a map to what it is to cover: all active bricks, or those that the camera may see.

use super::boxes::{GridBox, active_box, active_rows};
use super::projection::Projection;
use super::region::Region;
use super::shape::MapShape;
use super::space::LightSpace;
use crate::field::constants::FAR;
use crate::field::{ActiveBricks, View, grid_from_world};
use crate::scene::Light;
use crate::volume::Volume;
use glam::{DAffine3, DMat3, DVec2, DVec3};

/// A perspective map wider than this (tangent of the half angle) becomes octahedral: its corner texels would be far
/// coarser than its centre.
const WIDEST_TANGENT: f64 = 2.0;

/// Texels a side of maps that choose for themselves.
const LEAST_TEXELS: f64 = 64.0;
const MOST_TEXELS: f64 = 2048.0;
/// Pixels of the picture that a texel spans where voxels are seen larger than that, and texels across such a voxel at most:
/// the field between voxels is smooth.
const PIXELS_PER_TEXEL: f64 = 2.0;
const MOST_TEXELS_PER_VOXEL: f64 = 2.0;
/// A map that is this many times as large as what a view needs, or whose texels are as many times too wide, no longer
/// serves it.
const MOST_TOO_LARGE: f64 = 2.0;

/// A frame that follows the view is taken where what it covers is no more than this share.
const WORTH_TURNING: f64 = 0.8;
/// The view must not run along the light for that: sine of the angle between them.
const LEAST_ACROSS: f64 = 0.05;

impl LightSpace {
    /// Fits a map to the active bricks, or to those that a view may show; an empty texel lies around them all.
    pub fn fit(
        volume: &Volume,
        active: &ActiveBricks,
        light: Light,
        shape: MapShape,
        view: Option<&View>,
    ) -> Self {
        let plain = Self::framed(volume, active, light, shape, None);
        let all = active_rows(active, volume.dims(), |_| true);
        let whole = plain.region_of(volume, active, &all);
        let Some(view) = view.filter(|_| plain.can_fit_view()) else {
            return plain.laid_out(volume, whole, None);
        };
        let seen = plain.rows_seen(volume, active, view);
        // Where nothing shows, a map that is made all the same is of everything.
        if seen.is_empty() {
            return plain.laid_out(volume, whole, None);
        }
        let wanted = plain.texel_wanted(volume, &seen, view);
        // What is seen often is a long strip: a frame along it leaves less beside it.
        let turned = Self::framed(volume, active, light, shape, Some(view.forward()));
        let fitted = [plain, turned].map(|space| {
            let whole = space.region_of(volume, active, &all);
            let region = space.region_of(volume, active, &seen).grown(view.margin).within(whole);
            (space, region, whole)
        });
        let [plain, turned] = fitted;
        let turn = turned.1.area() < WORTH_TURNING * plain.1.area();
        let (mut space, region, whole) = if turn { turned } else { plain };
        space.region = (region != whole).then_some(region);
        space.laid_out(volume, region, Some(wanted))
    }

    /// The frame and the depths of a map, without texels; its `a` axis lies along some direction, as far as that runs
    /// across the light.
    fn framed(
        volume: &Volume,
        active: &ActiveBricks,
        light: Light,
        shape: MapShape,
        along: Option<DVec3>,
    ) -> Self {
        let grid_from_world = grid_from_world(volume);
        let world_from_grid = grid_from_world.inverse();
        let bounds = active_box(active, volume.dims());
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

    /// Lays the texels out over what is covered: as wide as is wanted (mm; `None`: a voxel) where the shape does not say.
    fn laid_out(mut self, volume: &Volume, covered: Region, wanted_mm: Option<f64>) -> Self {
        // Texels of a part are as wide as they are long; tiles beside it are not built.
        let region = if self.region.is_some() { covered.squared() } else { covered };
        if self.shape.texels.is_none() {
            let texel_mm = wanted_mm.unwrap_or(volume.min_spacing_mm());
            let across = self.mm_per_plane() * region.size().max_element() / texel_mm;
            let texels = across.ceil() + 2.0 * f64::from(self.shape.reach);
            self.map_size = texels.clamp(LEAST_TEXELS, MOST_TEXELS) as u32;
        }
        let size = f64::from(self.map_size);
        // A border of empty texels makes the map meet the full light around it without a seam; where more lies around
        // it, as many as lookups read.
        let border = match self.projection {
            Projection::Octahedral => 0.0,
            _ if self.map_size < MapShape::LEAST_WITH_BORDER => 0.0,
            _ if self.region.is_some() => f64::from(self.shape.reach),
            _ => 1.0,
        };
        self.texel_scale = DVec2::splat(size - 2.0 * border) / region.size();
        self.texel_offset = DVec2::splat(border - 0.5) - region.lo * self.texel_scale;
        self
    }

    /// Whether the map would do for another view of the same bricks under the same light (`None`: for every point): it covers
    /// what may be seen, no more than twice that, in texels no more than twice too wide.
    pub fn serves(&self, volume: &Volume, active: &ActiveBricks, light: Light, view: Option<&View>) -> bool {
        let Some(view) = view.filter(|_| self.can_fit_view()) else {
            return self.region.is_none();
        };
        let rows = self.rows_seen(volume, active, view);
        if rows.is_empty() {
            return true;
        }
        let region = self.region.unwrap_or_else(|| {
            let all = active_rows(active, volume.dims(), |_| true);
            self.region_of(volume, active, &all)
        });
        let seen = self.region_of(volume, active, &rows);
        // What lies beyond all that has extinction is nothing.
        let held = self.region.is_none() || region.holds(seen);
        let turned = Self::framed(volume, active, light, self.shape, Some(view.forward()));
        let least = seen.area().min(turned.region_of(volume, active, &rows).area());
        let wide = self.shape.texels.is_none() && {
            let most = self.mm_per_plane() * region.size().max_element() / MOST_TEXELS;
            self.texel_mm() > MOST_TOO_LARGE * self.texel_wanted(volume, &rows, view).max(most)
        };
        held && region.area() <= MOST_TOO_LARGE * least && !wide
    }

    /// Whether fitting anew to a view (`None`: to every point), of the same bricks under the same light, would lay out this
    /// very map.
    pub fn is_fitted_to(
        &self,
        volume: &Volume,
        active: &ActiveBricks,
        light: Light,
        view: Option<&View>,
    ) -> bool {
        Self::fit(volume, active, light, self.shape, view).is_laid_out_as(self)
    }

    /// Whether the map covers a part of the active bricks alone.
    pub fn is_of_view(&self) -> bool {
        self.region.is_some()
    }

    /// Whether the ray through texel coordinates lies in what the map covers: others may be left out.
    pub fn covers(&self, texel: DVec2) -> bool {
        let plane = (texel - self.texel_offset) / self.texel_scale;
        self.region.is_none_or(|region| region.holds(Region::EMPTY.with(plane)))
    }

    /// Whether both have the same rays through the same texels: of one scene, and fitted alike.
    pub fn is_laid_out_as(&self, other: &Self) -> bool {
        (self.map_size, self.world_from_frame, self.texel_scale, self.texel_offset, self.region)
            == (other.map_size, other.world_from_frame, other.texel_scale, other.texel_offset, other.region)
    }

    /// Texels that what is covered lies on, with those around it that lookups read; `None`: all of them.
    pub(super) fn texels_covered(&self) -> Option<[DVec2; 2]> {
        let reach = DVec2::splat(f64::from(self.shape.reach));
        self.region.map(|region| {
            let texel = |plane: DVec2| plane * self.texel_scale + self.texel_offset;
            [texel(region.lo) - reach, texel(region.hi) + reach]
        })
    }

    /// Whether the map may cover a part of the active bricks alone.
    fn can_fit_view(&self) -> bool {
        let has_border = self.shape.texels.is_none_or(|texels| texels >= MapShape::LEAST_WITH_BORDER);
        self.shape.fits_view && has_border && self.projection != Projection::Octahedral
    }

    /// The active bricks that a view may show, in rows.
    fn rows_seen(&self, volume: &Volume, active: &ActiveBricks, view: &View) -> Vec<GridBox> {
        let sides = view.sides(&self.grid_from_world.inverse());
        active_rows(active, volume.dims(), |b| sides.may_show(b.center, b.half))
    }

    /// What of the plane some boxes cover; all that active bricks may where there are none.
    fn region_of(&self, volume: &Volume, active: &ActiveBricks, rows: &[GridBox]) -> Region {
        if self.projection == Projection::Octahedral {
            return Region { lo: DVec2::NEG_ONE, hi: DVec2::ONE };
        }
        let frame_from_grid = self.frame_from_world * self.grid_from_world.inverse();
        let of_box = |b: &GridBox| {
            let plane = b.corners().map(|g| self.plane(frame_from_grid.transform_point3(g)));
            plane.into_iter().fold(Region::EMPTY, Region::with)
        };
        let own = |region: Region, b: &GridBox| {
            let own = of_box(b);
            region.with(own.lo).with(own.hi)
        };
        match rows {
            [] => of_box(&active_box(active, volume.dims())),
            rows => rows.iter().fold(Region::EMPTY, own),
        }
    }

    /// How wide texels should be that the scene chooses, mm: as a voxel, and finer where that shows.
    fn texel_wanted(&self, volume: &Volume, seen: &[GridBox], view: &View) -> f64 {
        let voxel = volume.min_spacing_mm();
        let weight = |b: &GridBox| b.half.element_product();
        let middle =
            seen.iter().map(|b| weight(b) * b.center).sum::<DVec3>() / seen.iter().map(weight).sum::<f64>();
        let middle = self.grid_from_world.inverse().transform_point3(middle);
        (PIXELS_PER_TEXEL * view.pixel_mm(middle)).clamp(voxel / MOST_TEXELS_PER_VOXEL, voxel)
    }
}
