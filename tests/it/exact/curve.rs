//! Transmittance curve along a ray: optical depth, its inverse and its jumps.

use super::*;
use umbravox::exact::ExactField;

#[test]
fn curve_is_the_optical_depth_of_every_prefix() {
    let volume = rough_volume(oblique());
    let mut random = Rng::with_seed(17);
    let ray = (DVec3::new(-21.45, 29.35, 5.275), DVec3::new(-13.15, 40.4, 21.95));
    let inside = (DVec3::new(-17.47, 33.2, 9.975), DVec3::new(-16.2, 35.93, 16.3));
    for tf in transfer_functions() {
        let field = ExactField::new(&volume, &tf);
        for (a, b) in [ray, (ray.1, ray.0), inside] {
            let curve = field.curve(a, b);
            let length_mm = a.distance(b);
            assert_eq!(curve.total(), field.optical_depth(a, b));
            assert_eq!(curve.optical_depth_at(length_mm * (1.0 + 1e-12)), curve.total());
            assert_eq!((curve.optical_depth_at(0.0), curve.optical_depth_at(-1.0)), (0.0, 0.0));
            let mut depths: Vec<_> = (0..500).map(|_| length_mm * random.f64()).collect();
            depths.extend(curve.jumps());
            depths.sort_by(f64::total_cmp);
            let mut before = 0.0;
            for t in depths {
                let got = curve.optical_depth_at(t);
                assert_close(got, field.optical_depth(a, a.lerp(b, t / length_mm)), 1e-11);
                assert_close(curve.transmittance_at(t), (-got).exp(), EXACT);
                assert!(got >= before, "{got} after {before}");
                before = got;
            }
        }
    }
}

#[test]
fn inverse() {
    let volume = rough_volume(oblique());
    let (a, b) = (DVec3::new(-21.45, 29.35, 5.275), DVec3::new(-13.15, 40.4, 21.95));
    for tf in transfer_functions() {
        let field = ExactField::new(&volume, &tf);
        let curve = field.curve(a, b);
        let mut last = 0.0;
        for step in 1..=1000 {
            let tau = (curve.total() * f64::from(step) / 1000.0).min(curve.total());
            let t = curve.depth_of_optical_depth(tau).unwrap();
            assert!(t > last && t <= a.distance(b));
            assert_close(curve.optical_depth_at(t), tau, 1e-12);
            last = t;
        }
        assert_eq!(curve.depth_of_optical_depth(0.0), Some(0.0));
        assert_eq!(curve.depth_of_optical_depth(curve.total() * 1.000_001), None);
        assert_eq!(curve.depth_of_optical_depth(f64::NAN), None);
    }
}

#[test]
fn inverse_stops_at_the_first_depth() {
    // Two walls with nothing between.
    let volume = volume([10, 3, 3], DAffine3::IDENTITY, |i, _, _| i);
    let tf = extinction(&[
        (2.0, 0.0),
        (2.0, 1.0),
        (3.0, 1.0),
        (3.0, 0.0),
        (7.0, 0.0),
        (7.0, 1.0),
        (8.0, 1.0),
        (8.0, 0.0),
    ]);
    let field = ExactField::new(&volume, &tf);
    let curve = field.curve(DVec3::new(-5.0, 1.0, 1.0), DVec3::new(20.0, 1.0, 1.0));
    assert_close(curve.total(), 2.0, EXACT);
    assert_close(curve.depth_of_optical_depth(1.0).unwrap(), 8.0, EXACT);
    assert_close(curve.depth_of_optical_depth(1.5).unwrap(), 12.5, EXACT);
    assert_close(curve.depth_of_optical_depth(2.0).unwrap(), 13.0, EXACT);
    assert_eq!(curve.jumps(), [7.0, 8.0, 12.0, 13.0]);
}

#[test]
fn jumps_are_where_the_value_passes_a_point() {
    let volume = volume([12, 4, 4], DAffine3::from_scale(DVec3::splat(0.5)), |i, _, _| i);
    let tf = extinction(&[(2.5, 0.1), (2.5, 0.3), (6.25, 0.0), (8.0, 0.0), (9.75, 1.0)]);
    let field = ExactField::new(&volume, &tf);
    let jumps =
        |from: f64, to: f64| field.curve(DVec3::new(from, 0.6, 0.6), DVec3::new(to, 0.6, 0.6)).jumps();
    let want = [0.75, 2.25, 4.125, 5.0, 5.875, 6.75];
    let check = |got: Vec<f64>, want: &[f64]| {
        assert_eq!(got.len(), want.len(), "{got:?}");
        got.iter().zip(want).for_each(|(g, w)| assert_close(*g, *w, EXACT));
    };
    check(jumps(-1.0, 9.0), &want);
    check(jumps(9.0, -1.0), &want.map(|t| 10.0 - t).into_iter().rev().collect::<Vec<_>>());
    // A segment inside the volume: its own ends are no jumps.
    check(jumps(0.0, 5.5), &[1.25, 3.125, 4.0, 4.875]);
    check(jumps(0.0, 1.0), &[]);
    check(field.curve(DVec3::NAN, DVec3::ZERO).jumps(), &[]);
}
