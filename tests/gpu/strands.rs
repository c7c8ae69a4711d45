//! Strands from a file on the device: pictures with their default transfer function against the exact ones.

use super::*;
use umbravox::open::presets;
use umbravox::strands::{StrandSet, write_hair};

#[test]
fn a_hair_file_is_drawn_like_any_volume() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.hair");
    write_hair(&StrandSet::Curly.build(4000).unwrap(), &path).unwrap();
    let mut spec = VolumeSpec::new(path.to_string_lossy());
    spec.flags.strands.resolution = Some(48);
    let volume = Arc::new(load(&spec).unwrap());
    let name = presets::default_name(&volume);
    assert_eq!(name, "hair");
    let tf = presets::resolve(name, &volume).unwrap().tf;
    let Some(setup) = Setup::open(&volume, &tf) else { return };
    let scene = setup.scene(40, 32);
    let exact = setup.exact().picture(&scene);
    assert!(exact.iter().any(|v| *v > 0.3), "nothing is seen");
    for (method, most) in
        [("rays", tolerance::RAYS_PICTURE_RMS), ("dsm:epsilon=0.005,map=256", tolerance::DSM_PICTURE_RMS)]
    {
        let rms = rms_difference(&setup.picture(method, &scene), &exact);
        assert!(rms < most, "{method}: {rms}");
    }
}
