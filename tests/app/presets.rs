//! The list of presets with its pictures.

use super::Bench;
use umbravox::transfer::presets::PRESETS;

#[test]
fn presets_are_shown_on_this_volume_and_chosen_by_a_click() {
    let Some(mut bench) = Bench::open(&["phantom:thorax:32", "--tf=bone", "--shadow=none"]) else { return };
    let (work, picture) = (bench.app().model.frames, bench.pixels());
    bench.click("preset");
    bench.wait_for("all pictures", |app| {
        app.presets.thumbnails.iter().filter(|t| t.is_some()).count() == PRESETS.len()
    });
    assert_eq!(bench.app().model.frames, work, "the view is not drawn again for them");
    let pixels = |bench: &mut Bench, name: &str| {
        let index = PRESETS.iter().position(|p| p.name == name).unwrap();
        let texture = bench.app().presets.thumbnails[index].as_ref().unwrap().texture.clone();
        bench.read(&texture)
    };
    let [bone, skin, lung] = ["bone", "skin", "lung"].map(|name| pixels(&mut bench, name));
    assert!(bone != skin && skin != lung && bone != lung);
    let lit = bone.chunks(4).filter(|p| p[..3].iter().any(|c| *c > 40)).count();
    assert!(lit > 100, "there is bone to be seen: {lit} pixels");
    bench.click("skin");
    bench.settle();
    assert_eq!(bench.app().model.document.as_ref().unwrap().tf_source.0, "skin");
    assert_ne!(bench.pixels(), picture);
}
