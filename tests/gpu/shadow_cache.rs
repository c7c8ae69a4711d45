//! Stages that run after each edit, and the reuse of tables and shadow maps.

use super::*;
use umbravox::engine::{CachedSession, MapCoverage, ReusePolicy, ShadowCache, Work};
use umbravox::scene::{Camera, LightSource};

/// Edit of a scene between two pictures.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Edit {
    Volume,
    Opacity,
    UnusedValues,
    Color,
    Light,
    Method,
    Camera,
    View,
    Picture,
}

/// Stage that runs before the picture.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Stage {
    Upload,
    Tables,
    Colors,
    Shadows,
}

/// Stages that each edit makes necessary.
const NECESSARY: [(Edit, &[Stage]); 9] = [
    (Edit::Volume, &[Stage::Upload, Stage::Tables, Stage::Shadows]),
    (Edit::Opacity, &[Stage::Tables, Stage::Shadows]),
    (Edit::UnusedValues, &[]),
    (Edit::Color, &[Stage::Colors]),
    (Edit::Light, &[Stage::Shadows]),
    (Edit::Method, &[Stage::Shadows]),
    (Edit::Camera, &[]),
    (Edit::View, &[Stage::Shadows]),
    (Edit::Picture, &[]),
];

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

/// Renderer session under test.
struct Session {
    cached: CachedSession,
    volume: Arc<Volume>,
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
        Some(Self { cached, volume: Arc::clone(volume) })
    }

    /// Draws a state, and returns the stages that ran, and the picture.
    fn show(&mut self, state: &State) -> (Vec<Stage>, Array3<f32>) {
        let (mut work, mut made) = (Work::default(), Vec::new());
        if !Arc::ptr_eq(&self.volume, &state.volume) {
            *self = Self::open(&state.volume).unwrap();
            made.push(Stage::Upload);
        }
        self.cached.set_transfer(&state.tf, &mut work).unwrap();
        made.extend(work.classify_ms.map(|_| Stage::Tables));
        made.extend(work.table_ms.filter(|_| work.classify_ms.is_none()).map(|_| Stage::Colors));
        let method = shadow::parse(state.method).unwrap();
        let extent = (&state.scene, MapCoverage::Picture);
        let prepared = self.cached.prepare(method.as_ref(), extent, &mut work).unwrap();
        made.extend(work.build_ms.map(|_| Stage::Shadows));
        (made, prepared.render(&state.scene).unwrap().pixels)
    }
}

/// Transfer function with points far above the phantom's values, so that some values do not occur.
fn ramp() -> TransferFunction {
    opacity(&[(200.0, 0.0), (900.0, 0.3), (5000.0, 0.4), (6000.0, 0.8), (7000.0, 0.8)])
}

/// Applies an edit to a state.
fn apply(state: &mut State, edit: Edit) {
    match edit {
        Edit::Volume => state.volume = phantom("step:24"),
        Edit::Opacity => state.tf.points[1].amount = 0.2,
        Edit::UnusedValues => {
            state.tf.points[3].amount = 0.1;
            state.tf.points[4].color = [0.0, 1.0, 0.0];
        }
        Edit::Color => state.tf.points[1].color = [1.0, 0.0, 0.0],
        Edit::Light => {
            state.scene.lights = vec![Light::Directional { toward: DVec3::new(-0.3, 0.9, 0.1) }.into()]
        }
        Edit::Method => state.method = "dsm:map=64,epsilon=0.3",
        Edit::Camera => state.scene.camera.eye += DVec3::new(3.0, -5.0, 2.0),
        Edit::View => state.scene.camera.fov_deg = 5.0,
        Edit::Picture => state.scene.background = [0.3, 0.1, 0.2],
    }
}

#[track_caller]
fn same_as_from_nothing(state: &State, shown: &Array3<f32>, what: &str) {
    let (_, scratch) = Session::open(&state.volume).unwrap().show(state);
    let off = largest_difference(shown, &scratch);
    assert!(off <= tolerance::FORCED, "{what}: {off:e}");
}

#[test]
fn each_edit_runs_its_stages() {
    let start = State::first();
    for (edit, stages) in NECESSARY {
        let Some(mut session) = Session::open(&start.volume) else { return };
        let (_, first) = session.show(&start);
        let mut state = start.clone();
        apply(&mut state, edit);
        let (made, picture) = session.show(&state);
        assert_eq!(made, stages, "{edit:?}");
        assert_eq!(picture == first, edit == Edit::UnusedValues, "{edit:?}");
        same_as_from_nothing(&state, &picture, &format!("{edit:?}"));
    }
}

#[test]
fn unchanged_scene_runs_no_stage() {
    let state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    let (_, first) = session.show(&state);
    assert_eq!(session.show(&state), (vec![], first));
}

#[test]
fn edits_that_follow_one_another() {
    // Colour after an edit of unused values, then opacity: tables of different states must not be mixed.
    let mut state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    session.show(&state);
    for edit in [Edit::UnusedValues, Edit::Color, Edit::Light, Edit::Opacity, Edit::Camera] {
        apply(&mut state, edit);
        if edit == Edit::Color {
            // A point between others moves the numbers of all intervals behind it.
            let unused =
                umbravox::transfer::ControlPoint { value: 5500.0, amount: 0.5, color: [0.1, 0.9, 0.4] };
            state.tf.points.insert(3, unused);
        }
        let (_, picture) = session.show(&state);
        same_as_from_nothing(&state, &picture, &format!("after {edit:?}"));
    }
}

#[test]
fn a_light_that_goes_back_finds_its_map() {
    let mut state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    let (_, first) = session.show(&state);
    let light = state.scene.light();
    apply(&mut state, Edit::Light);
    assert_eq!(session.show(&state).0, [Stage::Shadows]);
    state.scene.lights = vec![light.into()];
    assert_eq!(session.show(&state), (vec![], first));
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
    state.scene.lights[1].intensity = 3.0;
    state.scene.lights.truncate(5);
    state.scene.lights[0].intensity = 0.0;
    assert_eq!(built(&session, &state), 0);
    let (made, picture) = session.show(&state);
    assert_eq!(made, []);
    same_as_from_nothing(&state, &picture, "other colours");
}

#[test]
fn a_map_serves_the_views_that_it_covers() {
    let mut state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    session.show(&state);
    let framed = state.scene.camera;
    let zoomed = Camera { fov_deg: 5.0, ..framed };
    state.scene.camera = zoomed;
    assert_eq!(session.show(&state).0, [Stage::Shadows], "half of it is not needed");
    // A view a little to the side is covered by the map, one far to the side is not.
    let aside = |share: f64| Camera { target: framed.target + share * framed.up * 10.0, ..zoomed };
    for (camera, made) in [(aside(0.02), vec![]), (aside(1.0), vec![Stage::Shadows]), (framed, vec![])] {
        state.scene.camera = camera;
        let shown = session.show(&state);
        assert_eq!(shown.0, made, "{camera:?}");
        same_as_from_nothing(&state, &shown.1, "another view");
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
    assert_eq!(session.show(&state).0, [Stage::Tables], "nothing is in view");
    state.scene.camera = framed;
    let (made, picture) = session.show(&state);
    assert_eq!(made, [Stage::Shadows]);
    same_as_from_nothing(&state, &picture, "seen again");
    // While the volume is out of view the map is stored for later.
    for camera in [away, framed] {
        state.scene.camera = camera;
        assert_eq!(session.show(&state).0, []);
    }
    state.scene.ambient = 1.0;
    assert_eq!(session.show(&state).0, []);
    state.scene.lights = vec![Light::Directional { toward: DVec3::Z }.into()];
    assert_eq!(session.show(&state).0, []);
    state.scene.ambient = 0.2;
    let (made, picture) = session.show(&state);
    assert_eq!(made, [Stage::Shadows]);
    same_as_from_nothing(&state, &picture, "no longer ambient alone");
}

#[test]
fn a_failed_update_keeps_the_old_state() {
    let state = State::first();
    let Some(mut session) = Session::open(&state.volume) else { return };
    let (_, first) = session.show(&state);
    // More points than the device's tables hold.
    let points: Vec<_> = (0..3000).map(|i| (200.0 + f64::from(i), 0.1 * f64::from(i % 2))).collect();
    let mut work = Work::default();
    let refused = session.cached.set_transfer(&opacity(&points), &mut work);
    assert!(refused.is_err() && work == Work::default());
    assert_eq!(session.show(&state), (vec![], first));
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
