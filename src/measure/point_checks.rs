//! Tests of error bounds at points between the light rays of texels, with as many points as a measurement asks for.

use super::enclosure_check::EnclosureTest;
use super::errors::{VisiblePointsByLight, texels_to_test};
use super::job::{Checked, Job, name_of};
use super::point_bound::PointTest;
use super::point_report::PointReport;
use super::table::Row;
use crate::error::Result;
use crate::exact::ExactField;
use crate::scene::Light;
use crate::shadow::{Method, ShadowMap};

/// Number of tested light rays for each cell between texel centres in which points are tested.
const RAYS_PER_CELL: usize = 20;
/// Number of cells and of points in them that are tested if points are to be checked thoroughly.
const CHECKED_CELLS: usize = 4096;
const CHECKED_POINTS: usize = 1 << 20;
/// Scene whose shadow maps are tested at points.
pub struct PointChecks<'a> {
    pub job: &'a Job<'a>,
    pub field: &'a ExactField<'a>,
}

impl PointChecks<'_> {
    /// Tests the error bound of the shadow map of one of `lights` lights at points between its light rays.
    pub fn of(
        &self,
        method: &dyn Method,
        (light, shadow): (Light, &ShadowMap),
        lights: usize,
    ) -> Result<PointReport> {
        if shadow.bound.is_none() {
            return Ok(PointReport::default());
        }
        let (cells, points_a_cell) = self.cells_to_test(light, shadow, lights);
        let test = PointTest { cells: &cells, points_a_cell, taps: method.taps() };
        test.run(self.field, light, self.job.session, shadow)
    }

    /// Measures the enclosures of the shadow maps (one per light, in order), and writes them to the comparison table
    /// row. Returns a note if one does not contain the exact transmittance.
    pub fn enclosures(
        &self,
        method: &dyn Method,
        visible: &VisiblePointsByLight,
        shadows: &[ShadowMap],
        row: &mut Row,
    ) -> Result<Option<String>> {
        let session = self.job.session;
        let Some(widths) = visible.enclosure_widths(session, shadows)? else { return Ok(None) };
        let mut all = PointReport::default();
        for (source, shadow) in self.job.scene.shining().iter().zip(shadows) {
            let (texels, points_a_texel) = self.cells_to_test(source.light, shadow, shadows.len());
            let test = EnclosureTest { texels: &texels, points_a_texel };
            all = all.merge(test.run(self.field, source.light, session, shadow)?);
        }
        row.set_enclosure(&widths, &all);
        Ok(all.note(&format!("{}: the enclosure", name_of(method))))
    }

    /// Returns the texels whose cells or prisms are tested at points in the shadow map of one of `lights` lights, and
    /// the number of points in each.
    fn cells_to_test(&self, light: Light, shadow: &ShadowMap, lights: usize) -> (Vec<[u32; 2]>, usize) {
        let effort = self.job.effort;
        let count = match effort.check {
            Checked::Points => CHECKED_CELLS,
            _ => effort.rays.div_ceil(RAYS_PER_CELL),
        };
        let cells = texels_to_test(self.field, light, &shadow.light_space, count.div_ceil(lights));
        let points = match effort.check {
            Checked::Points => CHECKED_POINTS.div_ceil(cells.len().max(1) * lights),
            _ => 4 * effort.depths,
        };
        (cells, points)
    }
}
