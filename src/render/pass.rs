//! Passes that draw or query a scene section by section: bind groups, and the order of passes.

use crate::gpu::{DevicePass, Group, ShaderVariant};
use crate::shadow::{Section, SectionPass, Sections};

/// Rendering pass over a picture that adds one light, or several at once, with its shader and shadow map.
pub(super) struct Pass<'a> {
    /// Bind group 1: the light space and the shadow map.
    pub group: Group,
    pub radiance: Option<[f64; 3]>,
    /// Whether the pass adds occluded ambient light.
    pub is_ambient: bool,
    pub shader: ShaderVariant,
    pub resumable: bool,
    /// Sections of the volume that are drawn one after the other; `None` for the whole volume at once.
    pub sections: Option<&'a Sections>,
}

/// Returns each section that is drawn by itself, or one `None` for the whole volume.
pub(super) fn each_section(sections: Option<&Sections>) -> impl Iterator<Item = Option<&Section>> {
    let list = sections.map_or(&[][..], |sections| &sections.list);
    list.iter().map(Some).chain(sections.is_none().then_some(None))
}

/// Bind groups of the passes of one section.
pub(super) struct SectionGroups<'g> {
    /// Pass that prepares the section, if there is one.
    advance: Option<(&'g SectionPass, [&'g Group; 3])>,
    /// Bind groups of the pass that draws or queries the section.
    pub groups: Vec<&'g Group>,
}

/// Returns the bind groups of the passes of all sections, or of one pass for the whole volume, whose group 1 is `whole`.
/// `field` is group 0, `stages` are the groups 2 of the sections, and `last` is group 3.
pub(super) fn section_groups<'g>(
    sections: Option<&'g Sections>,
    [field, whole]: [&'g Group; 2],
    stages: &'g [Group],
    last: Option<&'g Group>,
) -> Vec<SectionGroups<'g>> {
    let of_section = |(section, stage): (Option<&'g Section>, &'g Group)| {
        let advance = section.map(|section| &section.advance);
        let advance = advance.map(|advance| (advance, [field, &advance.groups[0], &advance.groups[1]]));
        let shadow = section.map_or(whole, |section| &section.group);
        SectionGroups { advance, groups: [field, shadow, stage].into_iter().chain(last).collect() }
    };
    each_section(sections).zip(stages).map(of_section).collect()
}

/// Returns the passes of all sections in their order: each section is prepared, and then drawn or queried by `variant`.
pub(super) fn section_passes<'g>(
    groups: &'g [SectionGroups<'g>],
    variant: &'g ShaderVariant,
    workgroups: [u32; 3],
) -> Vec<DevicePass<'g>> {
    let passes = groups.iter().flat_map(|section| {
        let advance = section.advance.as_ref().map(|(pass, groups)| DevicePass {
            variant: &pass.variant,
            groups,
            workgroups: pass.workgroups,
        });
        advance.into_iter().chain([DevicePass { variant, groups: &section.groups, workgroups }])
    });
    passes.collect()
}
