//! Built-in strand sets (hair and fur).

use umbravox::files::loading::Loading;
use umbravox::strands::{StrandSet, StrandVolume};

#[test]
fn every_set_is_reproducible_with_the_requested_segments() {
    for set in StrandSet::ALL {
        for segments in [1, 2, 11, 128, 129, 5000, 40_001] {
            let strands = set.build(segments).unwrap();
            assert_eq!(strands.segment_count(), segments, "{set}");
            assert_eq!(strands, set.build(segments).unwrap());
            assert!(strands.has_thickness());
            let [low, high] = strands.bounds_mm().unwrap();
            assert!((high - low).max_element() < 600.0, "{set}: {low} {high}");
        }
        assert!(set.build(0).is_err() && set.build(StrandSet::MAX_SEGMENTS + 1).is_err());
    }
}

#[test]
fn the_area_does_not_depend_on_the_number_of_segments() {
    for set in StrandSet::ALL {
        let area = |n: usize| {
            let strands = set.build(n).unwrap();
            (0..n).map(|i| strands.segment(i).area_mm2()).sum::<f64>()
        };
        let (few, many) = (area(150_000), area(300_000));
        assert!((few / many - 1.0).abs() < 1e-4, "{set}: {few} {many}");
    }
}

#[test]
fn strands_have_no_long_jumps() {
    for set in StrandSet::ALL {
        let strands = set.build(20_000).unwrap();
        let longest = (0..strands.segment_count())
            .map(|i| strands.segment(i).ends)
            .map(|[a, b]| a.distance(b))
            .fold(0.0, f64::max);
        assert!(longest < 8.0, "{set}: {longest} mm");
    }
}

#[test]
fn names_are_read_and_others_refused() {
    assert_eq!(StrandSet::parse("hair-fur").unwrap(), (StrandSet::Fur, 100_000));
    assert_eq!(StrandSet::parse("hair-curly:7").unwrap(), (StrandSet::Curly, 7));
    for bad in
        ["hair-", "hair-bald", "hair-fur:", "hair-fur:0", "hair-fur:-1", "hair-fur:1e6", "hair-fur:33554433"]
    {
        let e = StrandSet::parse(bad).unwrap_err();
        assert!(e.exit_status() == 2 && e.place.contains(bad), "{e}");
    }
    assert!(StrandSet::parse("hair-bald").unwrap_err().hint.unwrap().contains("hair-curly"));
}

#[test]
fn every_set_is_conserved() {
    for set in StrandSet::ALL {
        for kernel in ["box", "tent"] {
            let kernel = clap::ValueEnum::from_str(kernel, false).unwrap();
            let made =
                StrandVolume::of(&set.build(30_000).unwrap(), 96, kernel, &Loading::default()).unwrap();
            let c = made.conservation;
            assert!(c.relative_error < 1e-6 && c.area_mm2 > 1000.0, "{set} {kernel:?}: {c:?}");
            assert_eq!(c.area_mm2, c.area_inside_mm2, "{set} {kernel:?}: something was clipped");
        }
    }
}
