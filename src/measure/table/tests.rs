//! Tests of the rows and columns of the comparison table, and sample rows for tests of what shows them.

use super::*;
use crate::measure::bound_check::BoundReport;
use crate::measure::defaults::{settings, settings_of};
use crate::measure::pareto::mark_pareto;
use crate::measure::stats::Spread;
use crate::measure::timing::Timing;
use crate::shadow::{Bound, METHODS, parse, parse_list};

/// Returns sample rows of the comparison table, with every kind of cell, for tests.
pub(crate) fn sample_rows() -> Vec<Row> {
    let row = |method: &str, params: &str, build: f64, frame: f64, error: f64| {
        let mut row = Row {
            scene: "CT_AVM vessels".into(),
            adapter: "llvmpipe (LLVM 19.1, 256 bits)".into(),
            method: method.into(),
            params: params.into(),
            settings: settings_of(method, params),
            width: 512,
            height: 512,
            ..Row::default()
        };
        let spread = |ms: f64| Spread { median: ms, min: 0.9 * ms, max: 1.25 * ms };
        let timing = Timing {
            build_ms: spread(build),
            frame_ms: spread(frame),
            intervals_ms: [None; 2],
            clock: Clock::Wall,
            tables_ms: None,
            build_host_ms: 0.5 * build,
            frame_host_ms: 0.25 * frame,
            build_gpu_ms: None,
            build_wall_ms: build,
            frame_gpu_ms: None,
            frame_wall_ms: frame,
            gpu_mhz: None,
            unsteady: 0,
            repeats: 5,
        };
        row.set_timing(&timing);
        row.point_err_rms = Some(error);
        row
    };
    let mut rows = vec![
        row("none", "", 0.0, 80.0, 0.5),
        row("rays", "", 0.0, 1500.0, 0.0),
        row("dsm", "epsilon=0.06 prefilter=1", 60.0, 85.0, 0.01),
        row("dsm", "epsilon=0.005 prefilter=1", 70.0, 90.0, 0.001),
        row("osm", "layers=8 slicing=uniform", 70.0, 90.0, 0.05),
    ];
    rows[1].image_psnr = Some(f64::INFINITY);
    rows[2].set_ray_errors(
        &BoundReport::of_ray(
            0,
            &|_: f64| 1.0,
            &[0.0],
            &[0.95],
            Some(Bound { transmittance: 0.06, depth_mm: 0.1, ..Bound::default() }),
            |_| None,
        ),
        Some(Bound { transmittance: 0.06, depth_mm: 0.1, ..Bound::default() }),
    );
    rows[2].map = Some(512);
    rows[2].bytes = Some(3_355_443);
    rows[2].nodes_total = Some(1_234_567);
    rows[2].left_out = "gradients, \"shading none\"; 12 bricks | 3 MiB".into();
    mark_pareto(&mut rows);
    rows
}

#[test]
fn columns_are_those_of_the_contract_in_its_order() {
    let contract = "scene, adapter, method, params, map, width, height, build_ms, frame_ms, fps_static, \
        fps_moving, bytes, nodes_total, nodes_max, ray_err_max, point_err_max, point_err_rms, point_err_p99, \
        image_rmse, image_psnr, bound, bound_depth_mm, bound_held, pareto, left_out";
    let contract: Vec<&str> = contract.split(", ").collect();
    let names: Vec<&str> = COLUMNS.iter().map(|c| c.name).collect();
    let without: Vec<&str> = names.iter().copied().filter(|c| contract.contains(c)).collect();
    assert_eq!(without, contract);
    let distinct: std::collections::HashSet<_> = names.iter().collect();
    assert_eq!(distinct.len(), names.len());
    assert!(COLUMNS.iter().all(|c| c.about.ends_with('.') && !c.about.contains('\n')));
    assert_eq!(
        names[8..15],
        ["build_ms", "build_ms_min", "build_ms_max", "frame_ms", "frame_ms_min", "frame_ms_max", "clock"]
    );
}

#[test]
fn rows_read_back_from_their_texts() {
    let mut rows = sample_rows();
    rows[0].point_err_max = Some(0.1 + 0.2);
    rows[0].point_err_p99 = Some(f64::NEG_INFINITY);
    rows[2].set_failed(&"lost, \"planted\"");
    for row in &rows {
        assert_eq!(Row::from_texts(&row.texts()).unwrap(), *row);
    }
    let mut texts = rows[0].texts();
    texts.insert("clock".into(), "sundial".into());
    assert_eq!(Row::from_texts(&texts), Err("clock"));
}

#[test]
fn a_row_names_its_method() {
    let methods = "none;rays;dsm;dsm:epsilon=0.005,prefilter=5,precompress=off,filter=nearest,step=0.25,offset=-1,map=64;\
        osm:layers=8,slicing=gamma,bits=8,map=32;dom:layers=5,beyond=cover,filter=nearest;bom:split=log,layers=3";
    for method in parse_list(methods).unwrap() {
        let row = Row {
            method: method.name().into(),
            params: method.params(),
            map: method.map_size(),
            settings: settings(method.as_ref()),
            ..Row::default()
        };
        for key in
            METHODS.iter().find(|e| e.name == row.method).unwrap().keys.iter().filter(|k| k.name != "map")
        {
            assert_ne!(row.setting(key.name), Cell::Empty, "{} has a column of its own", key.name);
        }
        assert_eq!(parse(&row.spec()).unwrap().spec(), method.spec());
    }
}

#[test]
fn rates_follow_from_the_times() {
    let rows = sample_rows();
    assert_eq!((rows[2].fps_static, rows[2].fps_moving), (Some(1000.0 / 85.0), Some(1000.0 / 145.0)));
    assert_eq!((rows[2].frame_ms_min, rows[2].frame_ms_max), (Some(76.5), Some(106.25)));
    assert_eq!(rows[2].moving_ms(), Some(145.0));
}
