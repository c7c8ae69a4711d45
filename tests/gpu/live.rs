//! What an edit makes stale, row by row, and that what is kept is still right.

use super::*;
use umbravox::render::{Change, INVALIDATES, Live, Stage, Update, Wanted};
use umbravox::scene::Camera;

/// A scene that is edited.
#[derive(Clone)]
struct State {
    volume: Arc<Volume>,
    tf: TransferFunction,
    method: &'static str,
    scene: Scene,
}

impl State {
    fn first(volume: &Arc<Volume>, tf: &TransferFunction) -> Self {
        let scene = Scene { width: 49, height: 37, ambient: 0.15, ..Scene::framing(volume) };
        Self { volume: Arc::clone(volume), tf: tf.clone(), method: "dsm:map=64", scene }
    }

    fn show(&self, live: &mut Live) -> (Update, Option<Array3<f32>>) {
        let method = shadow::parse(self.method).unwrap();
        let wanted =
            Wanted { volume: &self.volume, tf: &self.tf, method: method.as_ref(), scene: &self.scene };
        let (update, picture) = live.picture(wanted).unwrap();
        (update, picture.map(|p| p.pixels))
    }
}

fn live() -> Option<Live> {
    let Some(renderer) = RENDERER.as_ref() else {
        println!("skipped: no graphics adapter");
        return None;
    };
    Some(Live::new(Arc::clone(renderer), Forced::NOTHING))
}

/// A ramp with points far above the values of the phantom, so that there are values that do not occur.
fn ramp() -> TransferFunction {
    opacity(&[(200.0, 0.0), (900.0, 0.3), (5000.0, 0.4), (6000.0, 0.8), (7000.0, 0.8)])
}

/// An edit for each row of the table.
fn edit(state: &mut State, change: Change) {
    match change {
        Change::Volume => state.volume = phantom("step:24"),
        Change::Opacity => state.tf.points[1].amount = 0.2,
        Change::UnusedValues => {
            state.tf.points[3].amount = 0.1;
            state.tf.points[4].color = [0.0, 1.0, 0.0];
        }
        Change::Color => state.tf.points[1].color = [1.0, 0.0, 0.0],
        Change::Light => state.scene.light = Light::Directional { toward: DVec3::new(-0.3, 0.9, 0.1) },
        Change::Method => state.method = "dsm:map=64,epsilon=0.3",
        Change::Camera => state.scene.camera.eye += DVec3::new(3.0, -5.0, 2.0),
        Change::Picture => state.scene.background = [0.3, 0.1, 0.2],
    }
}

#[test]
fn every_row_of_the_table() {
    let start = State::first(&phantom("shell:40"), &ramp());
    for (change, stages) in INVALIDATES {
        let Some(mut edited) = live() else { return };
        let (_, first) = start.show(&mut edited);
        let mut state = start.clone();
        edit(&mut state, change);
        let (update, picture) = state.show(&mut edited);
        assert_eq!(update.changes, [change]);
        let made: Vec<Stage> = update.made.iter().map(|m| m.stage).collect();
        let expected: Vec<Stage> = stages.iter().copied().filter(|s| *s != Stage::Frame).collect();
        assert_eq!(made, expected, "{change:?}");
        assert_eq!(update.frame_stale, stages.contains(&Stage::Frame), "{change:?}");
        // From nothing the same picture comes.
        let Some(mut fresh) = live() else { return };
        let (_, scratch) = state.show(&mut fresh);
        let shown = picture.or(first).unwrap();
        let off = largest_difference(&shown, &scratch.unwrap());
        assert!(off <= tolerance::FORCED, "{change:?}: {off:e}");
    }
}

#[test]
fn nothing_changes_nothing() {
    let Some(mut live) = live() else { return };
    let state = State::first(&phantom("shell:40"), &ramp());
    state.show(&mut live);
    let (update, picture) = state.clone().show(&mut live);
    assert!(update.changes.is_empty() && update.made.is_empty() && !update.frame_stale && picture.is_none());
}

#[test]
fn edits_that_follow_one_another() {
    // Colour after an edit of unused values, then opacity: tables of different states must not be mixed.
    let Some(mut edited) = live() else { return };
    let mut state = State::first(&phantom("shell:40"), &ramp());
    state.show(&mut edited);
    let mut shown = None;
    for change in [Change::UnusedValues, Change::Color, Change::Light, Change::Opacity, Change::Camera] {
        edit(&mut state, change);
        // A point between others moves the numbers of all intervals behind it.
        let unused = ControlPoint { value: 5500.0, amount: 0.5, color: [0.1, 0.9, 0.4] };
        if change == Change::Color {
            state.tf.points.insert(3, unused);
        }
        if let Some(picture) = state.show(&mut edited).1 {
            shown = Some(picture);
        }
        let Some(mut fresh) = live() else { return };
        let scratch = state.show(&mut fresh).1.unwrap();
        if let Some(shown) = &shown {
            let off = largest_difference(shown, &scratch);
            assert!(off <= tolerance::FORCED, "after {change:?}: {off:e}");
        }
    }
}

#[test]
fn shadows_wait_until_something_needs_them() {
    let Some(mut live) = live() else { return };
    let mut state = State::first(&phantom("shell:40"), &ramp());
    let made = |state: &State, live: &mut Live| -> Vec<Stage> {
        state.show(live).0.made.iter().map(|m| m.stage).collect()
    };
    let framed = state.scene.camera;
    let side = (framed.target - framed.eye).cross(framed.up);
    let away = Camera { target: framed.eye + side, ..framed };
    state.scene.camera = away;
    assert_eq!(made(&state, &mut live), [Stage::Upload, Stage::Tables, Stage::Shadows]);
    assert!(live.ready().unwrap().shadow.lookup.is_none(), "nothing is in view");
    state.scene.camera = framed;
    assert_eq!(made(&state, &mut live), [Stage::Shadows]);
    assert!(live.ready().unwrap().shadow.lookup.is_some());
    // Out of view the map stays for when it is seen again.
    for camera in [away, framed] {
        state.scene.camera = camera;
        assert_eq!(made(&state, &mut live), []);
    }
    state.scene.ambient = 1.0;
    assert_eq!(made(&state, &mut live), []);
    state.scene.light = Light::Directional { toward: DVec3::Z };
    assert_eq!(made(&state, &mut live), [Stage::Shadows]);
    assert!(live.ready().unwrap().shadow.lookup.is_none());
}

#[test]
fn what_fails_leaves_the_old_in_place() {
    let Some(mut live) = live() else { return };
    let state = State::first(&phantom("shell:40"), &ramp());
    let before = state.show(&mut live).1.unwrap();
    // More points than the device's tables hold.
    let mut points: Vec<_> = (0..3000).map(|i| (200.0 + f64::from(i), 0.1 * f64::from(i % 2))).collect();
    points.push((9000.0, 0.0));
    let refused = State { tf: opacity(&points), ..state.clone() };
    let method = shadow::parse(state.method).unwrap();
    let wanted =
        Wanted { volume: &refused.volume, tf: &refused.tf, method: method.as_ref(), scene: &refused.scene };
    assert!(live.picture(wanted).is_err());
    let (update, after) = state.show(&mut live);
    assert_eq!((update.changes, update.made), (vec![], vec![]));
    if let Some(after) = after {
        assert_eq!(largest_difference(&before, &after), 0.0);
    }
}
