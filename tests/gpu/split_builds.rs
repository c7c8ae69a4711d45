//! Shadow maps built in several submissions, as in the window, equal those built at once.

use super::*;

#[test]
fn a_map_built_in_several_submissions_is_the_same() {
    let volume = phantom("thorax:72");
    let [_, jumps, _] = transfer_functions([-900.0, 1200.0]);
    let Some(whole) = Setup::open(&volume, &jumps) else { return };
    let parts = Arc::new(Renderer::live(Gpu::open(None).unwrap(), 1.0));
    let session = Session::on(&parts, Arc::clone(&volume), &jumps, DisabledOptimizations::NONE).unwrap();
    let parts = Setup { session, tf: jumps };
    let scene = whole.scene(57, 41);
    // 256 tiles, built in submissions of about a millisecond; with epsilon 0 the pool runs out and the build is
    // repeated.
    for method in
        ["dsm:map=256,epsilon=0", "osm:map=256,layers=8", "dom:map=256,layers=7", "bom:map=256,layers=7"]
    {
        let [a, b] = [&whole, &parts].map(|setup| setup.shadow(method, scene.light()));
        assert!(a.report.tiles - a.report.tiles_left_out > 64, "{method}: more than one part");
        let counts = |map: &ShadowMap| {
            (map.report.nodes_total, map.report.nodes_max, map.report.texels_hit, map.report.pool_growths)
        };
        assert_eq!(counts(&a), counts(&b), "{method}");
        if method.starts_with("dsm") {
            assert!(a.report.pool_growths > 0, "the pool runs out");
        }
        let off = largest_difference(&whole.picture_of(&a, &scene), &parts.picture_of(&b, &scene));
        assert!(off <= tolerance::FORCED, "{method}: {off:e}");
    }
}
