//! Every shader composes and validates without a device; structs and constants are the same in WGSL and in Rust.

use std::mem::offset_of;
use umbravox::gpu::{ShaderVariant, compose, sources};
use umbravox::render::{FieldUniform, FrameUniform, IntervalTable};
use umbravox::shadow::{Counters, LightUniform, TILE};
use umbravox::transfer::{
    MAX_INTERVALS, PairTable, Quantity, TexelMapping, TransferFunction, TransferTables,
};
use umbravox::volume::BRICK_CELLS;
use wgpu::naga;

const COMMON: [&str; 3] = ["common/field.wgsl", "common/transfer.wgsl", "common/light.wgsl"];

/// Modules and definitions of every lookup: `rays`, `dsm` by both filters, and the layered maps by filter, packing
/// and split.
fn lookups() -> Vec<(&'static [&'static str], &'static [&'static str])> {
    const DEEP: &[&str] = &["shadow/deep_layout.wgsl", "shadow/deep.wgsl"];
    const OSM: &[&str] = &["shadow/layers_layout.wgsl", "shadow/layers_read.wgsl", "shadow/opacity.wgsl"];
    const DOM: &[&str] =
        &["shadow/layers_layout.wgsl", "shadow/layers_read.wgsl", "shadow/deep_opacity.wgsl"];
    vec![
        (&["shadow/total.wgsl", "common/march.wgsl", "shadow/rays.wgsl"], &[]),
        (DEEP, &[]),
        (DEEP, &["FILTER_BILINEAR"]),
        (OSM, &[]),
        (OSM, &["FILTER_BILINEAR", "BITS_8"]),
        (OSM, &["FILTER_BILINEAR", "BITS_16", "SPLIT_TABLE"]),
        (DOM, &["SPLIT_GROWING", "BITS_8"]),
        (DOM, &["SPLIT_GROWING", "FILTER_BILINEAR", "BITS_16"]),
        (DOM, &["ENDS"]),
        (DOM, &["ENDS", "SPLIT_TABLE", "SPLIT_ROWS", "FILTER_BILINEAR"]),
    ]
}

/// Definitions of the build of every layered map.
fn layered_builds() -> Vec<Vec<&'static str>> {
    let packings = [&["BITS_8", "WORDS_1"][..], &["BITS_8", "WORDS_2"], &["BITS_8"], &["BITS_16"], &[]];
    let places = [
        &[][..],
        &["SPLIT_TABLE"],
        &["STARTS", "SPLIT_GROWING"],
        &["STARTS", "ENDS"],
        &["STARTS", "ENDS", "SPLIT_TABLE"],
        &["STARTS", "ENDS", "SPLIT_TABLE", "SPLIT_ROWS"],
    ];
    packings.iter().flat_map(|p| places.map(|s| [p, s].concat())).collect()
}

fn variant(entry: &'static str, modules: &[&[&'static str]], defs: &[&[&'static str]]) -> ShaderVariant {
    ShaderVariant { entry, modules: modules.concat(), defs: defs.concat() }
}

/// Everything that a flag, a method or an adapter can ask for.
fn variants() -> Vec<ShaderVariant> {
    let mut list = vec![variant("display.wgsl", &[], &[]), variant("display.wgsl", &[], &[&["LIVE"]])];
    for adapter in [&[][..], &["MANUAL_TRILINEAR"], &["MANY_BREAKPOINTS"], &["LIVE"]] {
        for (modules, defs) in lookups() {
            list.push(variant("query.wgsl", &[&COMMON, modules], &[defs, adapter]));
        }
        for skip in [&[][..], &["SKIP_BRICKS"]] {
            for shading in [&[][..], &["SHADING"], &["SHADING", "BLINN_PHONG"]] {
                list.push(variant("raycast.wgsl", &[&COMMON], &[shading, skip, adapter]));
                list.push(variant("raycast.wgsl", &[&COMMON], &[shading, skip, &["ONE_COLOR"], adapter]));
                for (modules, defs) in lookups() {
                    for whole in [&["SHADOWS"][..], &["SHADOWS", "RESUMABLE"]] {
                        let defs = [shading, skip, defs, whole, adapter];
                        list.push(variant("raycast.wgsl", &[&COMMON, modules], &defs));
                    }
                }
            }
        }
        const NODES: &[&str] = &["shadow/deep_layout.wgsl", "shadow/deep_nodes.wgsl"];
        let build = |modules: &[&'static str], defs: &[&'static str]| {
            variant("shadow/deep_build.wgsl", &[&COMMON, NODES, modules], &[defs, adapter])
        };
        list.push(build(&["shadow/deep_sink.wgsl", "common/march.wgsl"], &["WHOLE_CURVE", "MARCH_CELLS"]));
        list.push(build(&["shadow/total.wgsl", "common/march.wgsl"], &["MARCH_CELLS", "PREFILTER"]));
        list.push(build(&["shadow/total.wgsl"], &[]));
        list.push(build(&["shadow/total.wgsl"], &["PREFILTER"]));
        for defs in layered_builds() {
            let modules = ["shadow/layers_layout.wgsl", "shadow/layers_sink.wgsl", "common/march.wgsl"];
            list.push(variant("shadow/layers_build.wgsl", &[&COMMON, &modules], &[&defs, adapter]));
        }
        let modules = ["shadow/mass_sink.wgsl", "common/march.wgsl"];
        list.push(variant("shadow/layers_mass.wgsl", &[&COMMON, &modules], &[adapter]));
        let modules = ["shadow/start_sink.wgsl", "common/march.wgsl"];
        list.push(variant("shadow/layers_start.wgsl", &[&COMMON, &modules], &[adapter]));
    }
    let count = ["common/field.wgsl", "common/light.wgsl", "shadow/deep_layout.wgsl"];
    list.push(variant("shadow/deep_count.wgsl", &[&count], &[]));
    for def in [&[][..], &["PER_REGION"], &["LIVE"]] {
        let modules = ["common/field.wgsl", "common/light.wgsl"];
        let layers = ["shadow/layers_layout.wgsl", "shadow/layers_read.wgsl"];
        let defs = [&["ENDS", "SPLIT_TABLE", "BITS_16"], def];
        list.push(variant("shadow/layers_ratio.wgsl", &[&modules, &layers], &defs));
    }
    list
}

#[test]
fn every_variant_composes_and_validates() {
    for variant in variants() {
        let module = compose(&variant).unwrap_or_else(|e| panic!("{variant:?}: {e}"));
        let mut validator = naga::valid::Validator::new(
            naga::valid::ValidationFlags::all(),
            // Half floats packed in words, which every adapter but OpenGL's older ones has.
            naga::valid::Capabilities::SHADER_FLOAT16_IN_FLOAT32,
        );
        if let Err(e) = validator.validate(&module) {
            panic!("{variant:?}: {}", e.emit_to_string(""));
        }
        assert_eq!(module.entry_points.len(), 1, "{variant:?}");
    }
}

#[test]
fn every_file_is_part_of_a_variant() {
    let variants = variants();
    for (path, _) in sources() {
        assert!(variants.iter().any(|v| v.entry == *path || v.modules.contains(path)), "{path}");
    }
}

/// Size of a WGSL struct and its members' names and offsets, without paddings.
fn layout(variant: &ShaderVariant, name: &str) -> (usize, Vec<(String, usize)>) {
    let module = compose(variant).unwrap();
    let found = module.types.iter().find_map(|(_, ty)| match (&ty.name, &ty.inner) {
        // Composed modules mangle the names of what they import.
        (Some(n), naga::TypeInner::Struct { members, span })
            if n == name || n.starts_with(&format!("{name}X_naga_oil")) =>
        {
            let members = members
                .iter()
                .map(|m| (m.name.clone().unwrap(), m.offset as usize))
                .filter(|m| !m.0.starts_with("padding"));
            Some((*span as usize, members.collect()))
        }
        _ => None,
    });
    found.unwrap_or_else(|| panic!("{name} is not in {}", variant.entry))
}

/// `(name, offset)` of fields of a Rust struct.
macro_rules! fields {
    ($ty:ty: $($field:ident),* $(,)?) => {
        (size_of::<$ty>(), vec![$((stringify!($field).to_string(), offset_of!($ty, $field))),*])
    };
}

#[test]
fn uniforms_have_one_layout() {
    let picture = variant("raycast.wgsl", &[&COMMON, lookups()[2].0], &[&["SHADOWS", "FILTER_BILINEAR"]]);
    assert_eq!(
        layout(&picture, "Field"),
        fields!(FieldUniform: size, min_spacing_mm, inv_size, intervals, active_lo, first_value, active_hi, last_value,
            bin_origin, bins_per_value, table_origin, table_per_value, inv_reference_length, color_r, color_g, color_b)
    );
    assert_eq!(
        layout(&picture, "Frame"),
        fields!(FrameUniform: plane_center, plane_distance_mm, grid_forward, step_mm, grid_right, ambient, grid_up,
            first_row, background, rows, half_extent, size, world_x, shading_weight, world_y, first_column, world_z)
    );
    // The rows of the affine are an array in Rust and three vectors in WGSL.
    let (size, mut members) = layout(&picture, "LightSpace");
    let rows: Vec<_> = members.drain(..3).collect();
    for (row, axis) in ["a", "b", "h"].iter().enumerate() {
        let at = offset_of!(LightUniform, frame_from_grid) + row * size_of::<[f32; 4]>();
        assert_eq!(rows[row], (format!("frame_from_grid_{axis}"), at));
    }
    assert_eq!(
        (size, members),
        fields!(LightUniform: grid_per_a, light_distance, grid_per_b, projection, grid_per_h, map_size, grid_origin,
            tiles_across, texel_scale, texel_offset, epsilon, chord_tolerance, step_mm, tile_rows, pool_rows, taps,
            depth_offset_mm, depth_start_mm, depth_steps_per_mm, same_surface_steps, layers, first_slot, record_blocks,
            block_mask, block_slot_shift, header_bits, planes_passed, split_row, split_choice, split_exponent, reach_mm,
            depth_range_mm, kappa, longest_depth, same_surface_mm, kernel, filter_side)
    );
}

#[test]
fn what_the_host_reads_and_writes_has_the_layout_of_the_shaders() {
    let build = variants().into_iter().find(|v| v.entry == "shadow/deep_build.wgsl").unwrap();
    let names = ["overflow_rows", "nodes_total", "nodes_max", "texels_hit", "texels_cut"];
    let expected = names.iter().enumerate().map(|(i, n)| (n.to_string(), 4 * i)).collect::<Vec<_>>();
    assert_eq!(layout(&build, "Counters"), (size_of::<Counters>(), expected));
    let (size, members) = layout(&build, "IntervalTable");
    assert_eq!(size, size_of::<IntervalTable>());
    assert_eq!(members[0], ("intervals".into(), offset_of!(IntervalTable, intervals)));
    assert_eq!(members[1], ("of_bin".into(), offset_of!(IntervalTable, of_bin)));
}

/// The text of a constant's value, wherever it is defined; the same everywhere.
#[track_caller]
fn constant(name: &str) -> String {
    let found: Vec<_> = sources()
        .iter()
        .flat_map(|(_, text)| text.lines())
        .filter_map(|line| line.trim().strip_prefix("const ")?.strip_prefix(name)?.strip_prefix(':'))
        .filter_map(|rest| Some(rest.split_once('=')?.1.trim().trim_end_matches(';').to_string()))
        .collect();
    assert!(!found.is_empty(), "no constant {name}");
    assert!(found.iter().all(|v| *v == found[0]), "{name} is defined differently: {found:?}");
    found[0].clone()
}

fn number(name: &str) -> usize {
    let text = constant(name);
    let text = text.trim_end_matches('u');
    let parsed = match text.strip_prefix("0x") {
        Some(hex) => usize::from_str_radix(hex, 16),
        None => text.parse(),
    };
    parsed.unwrap_or_else(|_| panic!("{name} = {text}"))
}

fn tables(points: &[(f64, f64)]) -> (TransferTables, PairTable) {
    let tf = TransferFunction::new(Quantity::Extinction, points);
    let mapping = TexelMapping { scale: 1.0, offset: 0.0 };
    (TransferTables::build(&tf, mapping, [0.0, 100.0]), PairTable::build(&tf, mapping, 1.0))
}

#[test]
fn shared_constants_are_equal() {
    assert_eq!(number("TILE"), TILE as usize);
    assert_eq!(number("BRICK_CELLS"), BRICK_CELLS);
    let (one_node, pairs) = tables(&[(0.0, 0.0), (50.0, 0.0), (50.0, 1.0), (100.0, 1.0)]);
    assert_eq!(number("VALUE_BINS"), one_node.interval_of_bin.len());
    assert_eq!(number("TABLE_BINS") + 1, one_node.integrals.len());
    assert_eq!(number("PAIR_BINS").pow(2), pairs.nodes.len());
    let no_node = number("NO_NODE") as u32;
    let across = pairs.nodes[number("PAIR_BINS") - 1];
    assert_eq!(across[1], no_node << 16 | no_node, "the last two of an entry with few nodes");
    let comb: Vec<_> = (0..40).map(|k| (f64::from(k) * 2.5, f64::from(k % 2))).collect();
    let across = tables(&comb).1.nodes[number("PAIR_BINS") - 1];
    assert_eq!(across[1] >> 16, number("MORE_NODES") as u32);
    assert_eq!(number("MAX_INTERVALS"), MAX_INTERVALS);
    // One value wherever it stands.
    for name in
        ["NO_ROW", "NO_TILE", "OPAQUE_DEPTH", "DEPTH_STEPS", "NODE_TEXTURE_WIDTH", "RECORD_TEXTURE_WIDTH"]
    {
        constant(name);
    }
}
