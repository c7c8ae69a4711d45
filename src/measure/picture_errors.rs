//! Errors of shadow methods in one picture, without times, exact picture and tests of error bounds: at points visible to the
//! camera, and of the picture against one by shadow rays.

use super::comparison::Compared;
use super::errors::VisiblePointsByLight;
use super::facts::Facts;
use super::job::{Job, name_of};
use super::progress::{Progress, Step, StepKind};
use super::shadow_error::ShadowReferences;
use super::table::Row;
use crate::error::Result;
use crate::exact::ExactField;
use crate::render::Picture;
use crate::shadow::{BuildReport, Method, ShadowRays};

/// Builds the shadow maps of every method, renders a picture with them, and measures the columns `bytes`, `point_err_*`,
/// `shadow_*` and `flip`. `job.effort` gives the number of points.
///
/// # Errors
/// A method fails, or the user cancelled the measurement.
pub fn picture_errors(
    job: &Job,
    methods: &[Box<dyn Method>],
    progress: &mut Progress,
) -> Result<Vec<Compared>> {
    let step = |method: &dyn Method| Step::new(StepKind::Draw, &name_of(method));
    let points = Step::new(StepKind::Points, "");
    progress.expect(points.clone(), 1);
    methods.iter().for_each(|method| progress.expect(step(method.as_ref()), 1));
    progress.begin(points, "exact transmittance at points")?;
    let facts = Facts::of(job.session.renderer.gpu());
    let field = ExactField::new(job.volume, job.tf).with_directions(job.directions()?);
    let visible = VisiblePointsByLight::new(&field, job.scene, job.effort.points);
    let mut references = ShadowReferences::default();
    let mut rows = Vec::new();
    for method in methods.iter().map(Box::as_ref) {
        let name = name_of(method);
        progress.begin(step(method), &format!("{name}: picture and errors"))?;
        rows.push(row(job, &facts, method, (&visible, &mut references), progress).map_err(|e| e.at(name))?);
    }
    progress.end();
    job.volume.check_reads()?;
    Ok(rows)
}

fn row(
    job: &Job,
    facts: &Facts,
    method: &dyn Method,
    (visible, references): (&VisiblePointsByLight, &mut ShadowReferences),
    progress: &mut Progress,
) -> Result<Compared> {
    let shadows = job.session.shadows_of(method, job.scene)?;
    let needs_shadows = job.session.needs_shadows(job.scene).is_ok();
    let is_default_rays = method.spec() == ShadowRays::default().spec();
    // The picture by rays takes longest, and the errors of the others need it too.
    let (pixels, left_out) = if is_default_rays && needs_shadows {
        let Picture { pixels, plan, .. } = references.picture_by_rays(job, visible)?;
        (pixels.clone(), plan.left_out.clone())
    } else {
        let Picture { pixels, plan, .. } = job.session.render(&shadows, job.scene)?;
        (pixels, plan.left_out)
    };
    let mut row = Row {
        bytes: Some(BuildReport::of_all(&shadows).bytes),
        ..facts.row(&job.scene_name, [job.scene.width, job.scene.height], method)
    };
    // Where the scene has no shadows, no map is built, and there are no errors.
    if needs_shadows {
        if let Some(stats) = visible.errors(job.session, &shadows)? {
            row.set_point_errors(&stats);
        }
        if let Some(error) = references.measure(job, visible, (&shadows, pixels.view()), progress)? {
            row.set_shadow_error(&error);
        }
    }
    Ok(Compared {
        row,
        method: method.spec().to_string(),
        slug: String::new(),
        picture: Some(pixels),
        left_out,
        difference: None,
        nodes: None,
    })
}
