//! Passes with which a page builds the shadow maps of a method for another light or another extinction.

use super::contents::Contents;
use crate::error::Result;
use crate::field::RecordedBuild;
use crate::gpu::{Group, Resource, ShaderVariant};
use crate::render::Session;
use crate::scene::Scene;
use crate::shadow::{Method, ShadowMap};
use serde::Serialize;

/// Members of the uniform at binding 1 of bind group 1 that depend on the depth range of a map: name, and the power of
/// the depth range to which they are proportional.
const LENGTHS: [(&str, i32); 2] = [("depth_steps_per_mm", -1), ("reach_mm", 1)];
/// Name of the struct of that uniform.
const PARAMS: &str = "Params";
/// `@binding` number of that uniform.
const PARAMS_BINDING: u32 = 1;

/// Pass of a build: indices of its pipeline and of its bind groups.
#[derive(Debug, Serialize)]
struct PassRecord {
    pipeline: usize,
    groups: Vec<usize>,
    workgroups: [u32; 3],
}

/// Float in a uniform that is proportional to a power of the depth range of a map.
#[derive(Debug, PartialEq, Serialize)]
struct LengthRecord {
    resource: usize,
    offset: usize,
    power: i32,
}

/// Memory that may be too small: indices of counters in a buffer, and the largest value of `needed`.
#[derive(Debug, Serialize)]
struct LimitRecord {
    resource: usize,
    /// Counters that stay 0 in a complete build.
    missing: [usize; 2],
    needed: usize,
    most: u32,
}

/// Passes that build the shadow map of one light.
#[derive(Debug, Serialize)]
pub(super) struct BuildRecord {
    passes: Vec<PassRecord>,
    /// Indices of the buffers and textures that hold zeros before the first pass. Rays without matter write nothing.
    cleared: Vec<usize>,
    lengths: Vec<LengthRecord>,
    limit: Option<LimitRecord>,
}

/// Builds the shadow maps of a method, valid in all views. Also returns the passes of each build, if a page can build the
/// maps for other lights.
///
/// # Errors
/// The device cannot hold a shadow map, or is lost.
pub(super) fn recorded_maps(
    session: &Session,
    method: &dyn Method,
    scene: &Scene,
) -> Result<(Vec<ShadowMap>, Option<Vec<RecordedBuild>>)> {
    let Session { renderer, loaded, transfer } = session;
    if !method.builds_on_device() || session.needs_shadows(scene).is_err() {
        return Ok((renderer.shadows_in(loaded, transfer, method, scene, None)?, None));
    }
    let lights = scene.shining().into_iter();
    let recorded: Result<Vec<_>> =
        lights.map(|source| renderer.recorded_shadow(loaded, transfer, method, source.light)).collect();
    match recorded {
        Ok(made) => {
            let (maps, builds) = made.into_iter().unzip();
            Ok((maps, Some(builds)))
        }
        // A map with all tiles may be too large.
        Err(_) => Ok((renderer.shadows_in(loaded, transfer, method, scene, None)?, None)),
    }
}

fn written(build: &RecordedBuild) -> impl Iterator<Item = &Resource> {
    build.passes.iter().flat_map(|pass| &pass.groups).flat_map(Group::written)
}

/// Adds bind group 1 of passes that query a map with a recorded build to the contents of a page, and the passes of the
/// build. `lookup` is the shader of those passes. Returns the index of the bind group as well.
///
/// # Errors
/// The device is lost, or a shader does not compile.
pub(super) fn map_record(
    contents: &mut Contents<'_>,
    build: &RecordedBuild,
    (map, lookup): (&Group, &ShaderVariant),
) -> Result<(usize, BuildRecord)> {
    let has_contents = |resource: &Resource| map.entries().any(|(_, kept)| kept == resource);
    written(build).for_each(|resource| contents.add_written(resource, has_contents(resource)));
    let group = contents.group(map)?;
    let mut record =
        BuildRecord { passes: Vec::new(), cleared: Vec::new(), lengths: Vec::new(), limit: None };
    for pass in &build.passes {
        let groups = pass.groups.iter().map(|group| contents.group(group)).collect::<Result<_>>()?;
        let pipeline = contents.pipeline(&pass.shader, &pass.groups.iter().collect::<Vec<_>>())?;
        record.passes.push(PassRecord { pipeline, groups, workgroups: pass.workgroups });
        record.add_lengths(contents, &pass.groups[1], &pass.shader)?;
    }
    record.add_lengths(contents, map, lookup)?;
    for resource in written(build) {
        let at = contents.known(resource);
        record.cleared.extend(at.filter(|at| !record.cleared.contains(at)));
    }
    record.limit = build.limit.as_ref().and_then(|limit| {
        let whole = Resource::whole(&limit.counters);
        let (missing, needed, most) = (limit.missing, limit.needed, limit.most);
        Some(LimitRecord { resource: contents.known(&whole)?, missing, needed, most })
    });
    Ok((group, record))
}

impl BuildRecord {
    /// Adds the lengths in the uniform of a bind group.
    fn add_lengths(
        &mut self,
        contents: &mut Contents<'_>,
        group: &Group,
        shader: &ShaderVariant,
    ) -> Result<()> {
        let uniform = group.entries().find(|(entry, _)| entry.binding == PARAMS_BINDING);
        let Some(layout) = contents.uniform(shader, PARAMS)? else { return Ok(()) };
        let Some(resource) = uniform.and_then(|(_, resource)| contents.known(resource)) else {
            return Ok(());
        };
        for (name, power) in LENGTHS {
            let length = layout.offset(name).map(|offset| LengthRecord { resource, offset, power });
            self.lengths.extend(length.filter(|length| !self.lengths.contains(length)));
        }
        Ok(())
    }
}
