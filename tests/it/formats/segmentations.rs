//! Segmentations of other programs: names and colours of segments, and segments that overlap.

use super::read;
use umbravox::open::{ReadFlags, VolumeSpec, load};
use umbravox::volume::{ByteCount, Volume};

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

/// Writes a segmentation of two voxels as 3D Slicer does, and reads it. `values` has the layers of the first voxel, then
/// those of the second.
fn slicer(axes: &str, segments: &str, values: &[u8], flags: ReadFlags) -> umbravox::Result<Volume> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("parts.seg.nrrd");
    let head = format!(
        "NRRD0004\ntype: unsigned char\n{axes}\nspace: left-posterior-superior\nencoding: raw\n\
         space origin: (0,0,0)\n{segments}\nSegmentation_MasterRepresentation:=Binary labelmap\n\n"
    );
    std::fs::write(&path, [head.as_bytes(), values].concat()).unwrap();
    load(&VolumeSpec { source: path.to_string_lossy().into_owned(), flags })
}

const ONE_LAYER: &str = "dimension: 3\nsizes: 2 1 1\nkinds: domain domain domain\n\
    space directions: (1,0,0) (0,1,0) (0,0,1)";
const TWO_LAYERS: &str = "dimension: 4\nsizes: 2 2 1 1\nkinds: list domain domain domain\n\
    space directions: none (1,0,0) (0,1,0) (0,0,1)";

#[test]
fn slicer_segments_have_names_and_colours() {
    let described = "Segment0_Color:=1 0.501961 0\nSegment0_LabelValue:=3\nSegment0_Layer:=0\nSegment0_Name:=liver\n\
        Segment1_Color:=red\nSegment1_LabelValue:=7\nSegment1_Layer:=0\nSegment1_Name:=left lung";
    let volume = slicer(ONE_LAYER, described, &[3, 7], ReadFlags::default()).unwrap();
    assert_eq!(segments(&volume), [(3, "liver", Some([255, 128, 0])), (7, "left lung", None)]);
    assert_eq!([volume.value(0, 0, 0), volume.value(1, 0, 0)], [3.0, 7.0]);
}

#[test]
fn overlapping_slicer_segments_are_merged_into_labels() {
    let described = "Segment0_LabelValue:=1\nSegment0_Layer:=0\nSegment0_Name:=liver\n\
        Segment1_LabelValue:=2\nSegment1_Layer:=0\nSegment1_Name:=rib\n\
        Segment2_Color:=0 0 1\nSegment2_LabelValue:=1\nSegment2_Layer:=1\nSegment2_Name:=tumour";
    // The last layer wins; a value that another layer uses becomes the next unused label.
    let volume = slicer(TWO_LAYERS, described, &[1, 1, 2, 0], ReadFlags::default()).unwrap();
    assert_eq!((volume.dims(), volume.value(0, 0, 0), volume.value(1, 0, 0)), ([2, 1, 1], 3.0, 2.0));
    assert_eq!(segments(&volume), [(1, "liver", None), (2, "rib", None), (3, "tumour", Some([0, 0, 255]))]);
    let warnings = volume.provenance.warnings.join("; ");
    assert!(
        warnings.contains("1 voxels belong to several segments: they have that of the last layer"),
        "{warnings}"
    );
    // A number that no segment has is reported.
    let volume = slicer(TWO_LAYERS, described, &[1, 9, 2, 0], ReadFlags::default()).unwrap();
    assert_eq!([volume.value(0, 0, 0), volume.value(1, 0, 0)], [1.0, 2.0]);
    let warnings = volume.provenance.warnings.join("; ");
    assert!(warnings.contains("1 numbers of voxels belong to no segment"), "{warnings}");
    // Slicer 4 wrote one layer for each segment, without values and layers.
    let old = "Segment0_ID:=a\nSegment0_Name:=liver\nSegment1_ID:=b\nSegment1_Name:=rib";
    let volume = slicer(TWO_LAYERS, old, &[1, 0, 0, 1], ReadFlags::default()).unwrap();
    assert_eq!([volume.value(0, 0, 0), volume.value(1, 0, 0)], [1.0, 2.0]);
    assert_eq!(segments(&volume), [(1, "liver", None), (2, "rib", None)]);
}

#[test]
fn numbers_of_a_voxel_that_are_no_layers_are_refused() {
    let refusal =
        |described, flags| slicer(TWO_LAYERS, described, &[1, 1, 2, 0], flags).err().unwrap().to_string();
    let error = refusal("DWMRI_b-value:=0", ReadFlags::default());
    assert!(error.contains("2 numbers at each voxel"), "{error}");
    let in_parts = ReadFlags { host_memory: Some(ByteCount(1)), ..ReadFlags::default() };
    let error = refusal("Segment0_LabelValue:=1\nSegment0_Name:=liver", in_parts);
    assert!(error.contains("segments overlap (layers)"), "{error}");
}
