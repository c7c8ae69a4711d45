//! `compare` of random methods, and `compare --flicker`.

use super::*;

fn number(row: &HashMap<String, String>, column: &str) -> f64 {
    row[column]
        .parse()
        .unwrap_or_else(|_| panic!("{column} of {} {}: `{}`", row["method"], row["params"], row[column]))
}

#[test]
fn coarse_maps_flicker_and_shadow_rays_do_not() {
    if !common::has_adapter() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let methods = "rays;dsm:map=24,near=0,filter=nearest,bilinear,fit=volume;dsm:map=24,near=0,fit=view";
    let size = ["--size", "48x48", "--zoom", "6", "--points", "400", "--rays", "20", "--repeats", "1"];
    let command = [
        "compare",
        "phantom:thorax:32",
        "--tf",
        "bone",
        "--methods",
        methods,
        "--flicker",
        "6",
        "-o",
        "table",
    ];
    run(folder.path(), &[&command[..], &size].concat());
    let rows = read_csv(&folder.path().join("table/compare.csv"));
    let [rays, nearest, bilinear, fits_view] = [0, 1, 2, 3].map(|i| &rows[i]);
    let [of_rays, of_nearest, of_bilinear] = [rays, nearest, bilinear].map(|row| number(row, "flicker_rms"));
    println!("{of_rays} {of_nearest} {of_bilinear}");
    assert!(of_rays < 1e-5 && of_bilinear > 1e-3 && of_nearest > 1.1 * of_bilinear);
    // A map that does not fit the view does not depend on the camera.
    for row in [rays, nearest, bilinear] {
        assert!(number(row, "flicker_camera_rms") < 1e-6);
    }
    assert!(number(fits_view, "flicker_camera_rms") > 1e-4);
    for row in &rows {
        // The percentile is rounded up by at most 1 %.
        assert!(number(row, "ray_err_p999") <= 1.01 * number(row, "ray_err_max"));
        assert!(number(row, "point_err_p99") <= number(row, "point_err_max"));
        assert!(number(row, "point_err_rms") <= number(row, "point_err_max"));
    }
}

#[test]
fn random_methods_have_bias_and_variance() {
    if !common::has_adapter() {
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let methods = "rays;rays:estimator=ratio,samples=2,8;rays:estimator=jackknife,samples=1";
    let size = ["--size", "48x48", "--points", "600", "--rays", "20", "--repeats", "2", "-o", "table"];
    let command = ["compare", "phantom:cloud:32", "--tf", "tf.json", "--methods", methods];
    run(folder.path(), &[&command[..], &size].concat());
    let rows = read_csv(&folder.path().join("table/compare.csv"));
    let [rays, two, eight, jackknife] = [0, 1, 2, 3].map(|i| &rows[i]);
    assert!(
        ["point_bias", "point_bias_se", "point_variance", "efficiency"]
            .iter()
            .all(|column| rays[*column].is_empty())
    );
    for row in [two, eight] {
        assert!(number(row, "point_bias").abs() < 4.0 * number(row, "point_bias_se") + 1e-6);
        let efficiency = 1000.0 / (number(row, "point_variance") * number(row, "frame_ms"));
        assert!((number(row, "efficiency") / efficiency - 1.0).abs() < 1e-6);
    }
    // Eight walks have a quarter of the variance of two.
    let ratio = number(two, "point_variance") / number(eight, "point_variance");
    assert!((3.5..4.6).contains(&ratio), "{ratio}");
    // Two samples of a cloud are not normally distributed.
    let (bias, se) = (number(jackknife, "point_bias"), number(jackknife, "point_bias_se"));
    println!("jackknife: {bias} {se}");
    assert!(bias.abs() > 4.0 * se);
}
