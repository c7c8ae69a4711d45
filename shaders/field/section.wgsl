// Section of the volume between two planes, for which a shadow structure answers alone (src/shadow/sections.rs).
#define_import_path umbravox::section

struct Section {
    // A grid-space point g has the coordinate dot(plane, (g, 1)), which rises along light rays.
    plane: vec4<f32>,
    // Coordinates of the two planes.
    start: f32,
    end: f32,
    // 1 for the first and for the last section, which have no limit before the first plane and behind the last.
    is_first: u32,
    is_last: u32,
}

// A storage buffer: Mesa 22.3 crashes where bounds of loops come from uniforms and from other numbers.
@group(2) @binding(7) var<storage, read> section: Section;

fn section_coordinate(g: vec3<f32>) -> f32 {
    return dot(section.plane, vec4<f32>(g, 1.0));
}

fn section_contains(g: vec3<f32>) -> bool {
    let coordinate = section_coordinate(g);
    return (section.is_first == 1u || coordinate >= section.start) && (section.is_last == 1u || coordinate < section.end);
}
