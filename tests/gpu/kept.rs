//! Stages that each edit invalidates, and the reuse of tables and shadow maps.

use super::*;
use umbravox::engine::{
    CachedSession, Change, INVALIDATES, MapCoverage, ReusePolicy, ShadowCache, Stage, Work,
};
use umbravox::scene::{Camera, LightSource};

/// State of a scene that is edited.
#[derive(Clone)]
struct State {
    volume: Arc<Volume>,
    tf: TransferFunction,
    method: &'static str,
    scene: Scene,
}

impl State {
    fn first() -> Self {
        let volume = phantom("shell:64");
        let scene = Scene { width: 49, height: 37, ambient: 0.15, ..Scene::framing(&volume) };
        Self { volume, tf: ramp(), method: "dsm:map=64", scene }
    }
}

/// Renderer session under test, with the last state shown.
struct Session {
    cached: CachedSession,
    volume: Arc<Volume>,
    shown: Option<State>,
}

impl Session {
    fn open(volume: &Arc<Volume>) -> Option<Self> {
        Self::with_reuse(volume, ReusePolicy::Covering)
    }

    /// Opens a session with a reuse policy; `None` and a printed line if there is no adapter.
    fn with_reuse(volume: &Arc<Volume>, reuse: ReusePolicy) -> Option<Self> {
        let renderer = renderer()?;
        let cache = ShadowCache::new(ShadowCache::INTERACTIVE, reuse);
        let mut cached = CachedSession::new(Arc::clone(renderer), DisabledOptimizations::NONE, cache);
        cached.load(Arc::clone(volume), None).unwrap();
        Some(Self { cached, volume: Arc::clone(volume), shown: None })
    }

    /// Shows a state, and returns the changes, the stages that ran, and the picture if it is new.
    fn show(&mut self, state: &State) -> (Vec<Change>, Vec<Stage>, Option<Array3<f32>>) {
        let (mut work, mut made, mut changes) = (Work::default(), Vec::new(), Vec::new());
        if !Arc::ptr_eq(&self.volume, &state.volume) {
            *self = Self::open(&state.volume).unwrap();
            changes.push(Change::Volume);
            made.push(Stage::Upload);
        }
        let change = self.cached.set_transfer(&state.tf, &mut work).unwrap();
        if let Some(shown) = &self.shown {
            changes.extend(change);
            changes.extend(Change::between_scenes(&shown.scene, &state.scene));
            changes.extend((shown.method != state.method).then_some(Change::Method));
        }
        made.extend(work.classify_ms.map(|_| Stage::Tables));
        made.extend(work.table_ms.filter(|_| work.classify_ms.is_none()).map(|_| Stage::Colors));
        let method = shadow::parse(state.method).unwrap();
        changes.extend(self.cached.change_of_view(method.as_ref(), &state.scene));
        let extent = (&state.scene, MapCoverage::Picture);
        let stale = self.shown.is_none() || changes.iter().any(|c| c.invalidates(Stage::Frame));
        self.shown = Some(state.clone());
        let prepared = self.cached.prepare(method.as_ref(), extent, &mut work).unwrap();
        made.extend(work.build_ms.map(|_| Stage::Shadows));
        (changes, made, stale.then(|| prepared.render(&state.scene).unwrap().pixels))
    }
}

/// Transfer function with points far above the phantom's values, so that some values do not occur.
fn ramp() -> TransferFunction {
    opacity(&[(200.0, 0.0), (900.0, 0.3), (5000.0, 0.4), (6000.0, 0.8), (7000.0, 0.8)])
}

/// Edits a scene state by a given kind of change.
fn edit(state: &mut State, change: Change) {
    match change {
        Change::Volume => state.volume = phantom("step:24"),
        Change::Opacity => state.tf.points[1].amount = 0.2,
        Change::UnusedValues => {
            state.tf.points[3].amount = 0.1;
            state.tf.points[4].color = [0.0, 1.0, 0.0];
        }
        Change::Color => state.tf.points[1].color = [1.0, 0.0, 0.0],
        Change::Light => {
            state.scene.lights = vec![Light::Directional { toward: DVec3::new(-0.3, 0.9, 0.1) }.into()]
        }
        Change::Method => state.method = "dsm:map=64,epsilon=0.3",
        Change::Camera => state.scene.camera.eye += DVec3::new(3.0, -5.0, 2.0),
        Change::View => state.scene.camera.fov_deg = 5.0,
        Change::Picture => state.scene.background = [0.3, 0.1, 0.2],
    }
}

#[track_caller]
fn same_as_from_nothing(state: &State, shown: &Array3<f32>, what: &str) {
    let scratch = Session::open(&state.volume).unwrap().show(state).2.unwrap();
    let off = largest_difference(shown, &scratch);
    assert!(off <= tolerance::FORCED, "{what}: {off:e}");
}

#[test]
fn every_row_of_the_table() {
    let start = State::first();
    for (change, stages) in INVALIDATES {
        let Some(mut session) = Session::open(&start.volume) else { return };
        let first = session.show(&start).2;
        let mut state = start.clone();
        edit(&mut state, change);
        let (changes, made, picture) = session.show(&state);
        // The view changes with the camera.
        let camera = (change == Change::View).then_some(Change::Camera);
        assert_eq!(changes, camera.into_iter().chain([change]).collect::<Vec<_>>());
        let expected: Vec<Stage> = stages.iter().copied().filter(|s| *s != Stage::Frame).collect();
        assert_eq!(made, expected, "{change:?}");
        assert_eq!(picture.is_some(), stages.contains(&Stage::Frame), "{change:?}");
        same_as_from_nothing(&state, &picture.or(first).unwrap(), &format!("{change:?}"));
    }
}

#[test]
fn nothing_changes_nothing() {
    let state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    session.show(&state);
    assert_eq!(session.show(&state), (vec![], vec![], None));
}

#[test]
fn edits_that_follow_one_another() {
    // Colour after an edit of unused values, then opacity: tables of different states must not be mixed.
    let mut state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    let mut shown = session.show(&state).2.unwrap();
    for change in [Change::UnusedValues, Change::Color, Change::Light, Change::Opacity, Change::Camera] {
        edit(&mut state, change);
        if change == Change::Color {
            // A point between others moves the numbers of all intervals behind it.
            let unused =
                umbravox::transfer::ControlPoint { value: 5500.0, amount: 0.5, color: [0.1, 0.9, 0.4] };
            state.tf.points.insert(3, unused);
        }
        if let Some(picture) = session.show(&state).2 {
            shown = picture;
        }
        same_as_from_nothing(&state, &shown, &format!("after {change:?}"));
    }
}

#[test]
fn a_light_that_goes_back_finds_its_map() {
    let mut state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    let first = session.show(&state).2.unwrap();
    let light = state.scene.light();
    edit(&mut state, Change::Light);
    assert_eq!(session.show(&state).1, [Stage::Shadows]);
    state.scene.lights = vec![light.into()];
    let (_, made, picture) = session.show(&state);
    assert_eq!((made, picture), (vec![], Some(first)));
}

#[test]
fn only_the_moved_light_is_built_again() {
    let mut state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    let light = |x, y, z| LightSource::from(Light::Directional { toward: DVec3::new(x, y, z) });
    state.scene.lights = (0..6).map(|i| light(1.0, f64::from(i), 0.5)).collect();
    session.show(&state);
    let method = shadow::parse(state.method).unwrap();
    let built = |session: &Session, state: &State| session.cached.missing(method.as_ref(), &state.scene);
    assert_eq!(built(&session, &state), 0, "six are kept at once");
    for i in 0..12 {
        state.scene.lights[3] = light(-1.0, 0.5, 0.1 * f64::from(i));
        assert_eq!(built(&session, &state), 1);
        session.show(&state);
        assert_eq!(built(&session, &state), 0);
    }
    // A change of colour, and lights without intensity, build nothing.
    state.scene.lights[3].color = [1.0, 0.5, 0.0];
    state.scene.lights[0].intensity = 0.0;
    assert_eq!(built(&session, &state), 0);
    let (_, made, picture) = session.show(&state);
    assert_eq!(made, []);
    same_as_from_nothing(&state, &picture.unwrap(), "other colours");
}

#[test]
fn a_map_serves_the_views_that_it_covers() {
    let mut state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    session.show(&state);
    let framed = state.scene.camera;
    let zoomed = Camera { fov_deg: 5.0, ..framed };
    state.scene.camera = zoomed;
    assert_eq!(session.show(&state).1, [Stage::Shadows], "half of it is not needed");
    // A view a little to the side is covered by the map, one far to the side is not.
    let aside = |share: f64| Camera { target: framed.target + share * framed.up * 10.0, ..zoomed };
    for (camera, made) in [(aside(0.02), vec![]), (aside(1.0), vec![Stage::Shadows]), (framed, vec![])] {
        state.scene.camera = camera;
        let shown = session.show(&state);
        assert_eq!(shown.1, made, "{camera:?}");
        same_as_from_nothing(&state, &shown.2.unwrap(), "another view");
    }
    // A map fitted to the picture does not serve all points; a map of all points serves a picture of the whole
    // volume.
    state.scene.camera = zoomed;
    session.show(&state);
    for (spec, coverage, built) in [
        ("dsm:map=64,epsilon=0.1", MapCoverage::AnyPoint, true),
        ("dsm:map=64,epsilon=0.1", MapCoverage::Picture, true),
        ("dsm:map=64,epsilon=0.1,fit=volume", MapCoverage::Picture, true),
        ("dsm:map=64,epsilon=0.1,fit=volume", MapCoverage::AnyPoint, false),
    ] {
        let method = shadow::parse(spec).unwrap();
        let mut work = Work::default();
        session.cached.prepare(method.as_ref(), (&state.scene, coverage), &mut work).unwrap();
        assert_eq!(work.build_ms.is_some(), built, "{spec} {coverage:?}");
    }
}

#[test]
fn shadows_wait_until_something_needs_them() {
    let mut state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    let framed = state.scene.camera;
    let side = (framed.target - framed.eye).cross(framed.up);
    let away = Camera { target: framed.eye + side, ..framed };
    state.scene.camera = away;
    assert_eq!(session.show(&state).1, [Stage::Tables], "nothing is in view");
    state.scene.camera = framed;
    let (_, made, picture) = session.show(&state);
    assert_eq!(made, [Stage::Shadows]);
    same_as_from_nothing(&state, &picture.unwrap(), "seen again");
    // While the volume is out of view the map is stored for later.
    for camera in [away, framed] {
        state.scene.camera = camera;
        assert_eq!(session.show(&state).1, []);
    }
    state.scene.ambient = 1.0;
    assert_eq!(session.show(&state).1, []);
    state.scene.lights = vec![Light::Directional { toward: DVec3::Z }.into()];
    assert_eq!(session.show(&state).1, []);
    state.scene.ambient = 0.2;
    let (_, made, picture) = session.show(&state);
    assert_eq!(made, [Stage::Shadows]);
    same_as_from_nothing(&state, &picture.unwrap(), "no longer ambient alone");
}

#[test]
fn a_failed_update_keeps_the_old_state() {
    let state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    session.show(&state);
    // More points than the device's tables hold.
    let points: Vec<_> = (0..3000).map(|i| (200.0 + f64::from(i), 0.1 * f64::from(i % 2))).collect();
    let mut work = Work::default();
    let refused = session.cached.set_transfer(&opacity(&points), &mut work);
    assert!(refused.is_err() && work == Work::default());
    assert_eq!(session.show(&state), (vec![], vec![], None));
}

/// With exact reuse every picture equals one drawn alone, bit by bit.
#[test]
fn no_picture_depends_on_those_before() {
    let state = State::first();
    let Some(mut session) = Session::with_reuse(&state.volume, ReusePolicy::Exact) else { return };
    let plain = Setup::open(&state.volume, &state.tf).unwrap();
    let Camera { eye, target, .. } = state.scene.camera;
    let nearer = |share: f64| Camera { eye: target + share * (eye - target), ..state.scene.camera };
    let mut work = Work::default();
    session.cached.set_transfer(&state.tf, &mut work).unwrap();
    for (method, share, builds) in [
        ("dsm:map=64", 1.0, true),
        // A camera inside sees a part: the old map would cover it, but its own is finer.
        ("dsm:map=64", 0.1, true),
        ("dsm:map=64", 1.0, false),
        ("dsm:fit=volume,map=64", 1.0, true),
        ("dsm:fit=volume,map=64", 0.1, false),
    ] {
        let scene = Scene { camera: nearer(share), ..state.scene.clone() };
        let parsed = shadow::parse(method).unwrap();
        let mut work = Work::default();
        let extent = (&scene, MapCoverage::Picture);
        let prepared = session.cached.prepare(parsed.as_ref(), extent, &mut work).unwrap();
        let picture = prepared.render(&scene).unwrap().pixels;
        assert_eq!(work.build_ms.is_some(), builds, "{method} {share}");
        let map = plain.session.shadow_of(parsed.as_ref(), &scene, scene.light()).unwrap();
        assert_eq!(picture, plain.picture_of(&map, &scene), "{method} {share}");
    }
}
