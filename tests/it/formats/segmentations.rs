//! Segmentations of other programs: names and colours of segments.

use super::read;
use umbravox::open::ReadFlags;
use umbravox::volume::Volume;

/// Labels, names and colours of the segments of a volume, the colours in 8 bits.
fn segments(volume: &Volume) -> Vec<(u32, &str, Option<[u8; 3]>)> {
    let code = |c: f32| (255.0 * c).round() as u8;
    let all = volume.provenance.segments.iter();
    all.map(|s| (s.label, s.name.as_str(), s.color.map(|color| color.map(code)))).collect()
}

#[test]
fn dicom_segments_have_their_recommended_colours() {
    let volume = read("dicom_segments.dcm", ReadFlags::default()).unwrap();
    let colors = [(1, "Left lung", Some([255, 0, 0])), (2, "Rib", Some([0, 0, 255]))];
    assert_eq!(segments(&volume), colors);
    let volume = read("dicom_labelmap.dcm", ReadFlags::default()).unwrap();
    assert_eq!(segments(&volume), [(1, "Left lung", Some([255, 0, 0])), (300, "Rib", None)]);
    assert_eq!(volume.value_range(), [0.0, 300.0]);
}
