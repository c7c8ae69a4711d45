//! Replays input in the real window, with frame times and screenshots: `window_shots SCRIPT [view flags]`.
//!
//! A script has one step per line:
//!
//! ```text
//! window WIDTH HEIGHT                       points; the first step, where the size matters
//! resize WIDTH HEIGHT                       points
//! silent                                   fail where an error message is on screen
//! settle                                   wait for the final picture
//! compared                                 wait for the end of the comparison
//! drag NAME X0 Y0 X1 Y1 SECONDS [shift|ctrl] [screen]   shares of the view (or of the whole window), there and back
//! click X Y [screen]
//! double X Y [screen]
//! move X Y [screen]                         pointer movement
//! press NAME                               click on the widget with this accessible name; scrolls to it
//! type TEXT                                text for the focused field
//! key NAME [shift|ctrl]
//! pause SECONDS
//! open PATH
//! shot FILE.png
//! times FILE.tsv                            measurements of the drags so far
//! lose                                     device loss
//! ```
//! `#` starts a comment.

mod steps;

use clap::Parser;
use eframe::egui::accesskit::{Action, ActionRequest, TreeId};
use eframe::egui::{self, Event, Id, Modifiers, PointerButton, Pos2, Rect, pos2};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use steps::{Step, WHAT, read_steps};
use umbravox::app::{App, FrameHook, Start, run};
use umbravox::cli::view::ViewArgs;
use umbravox::error::{Error, Result};
use umbravox::files::output::write_whole;

/// Maximum duration of a step.
const MAX_STEP: Duration = Duration::from_secs(120);

/// Measurements of a drag.
#[derive(Debug, Clone)]
struct Measured {
    name: String,
    seconds: f64,
    /// Milliseconds between one interface frame and the next.
    interface_ms: Vec<f64>,
    pictures: u64,
    /// Time from the input to each picture, ms.
    latency_ms: Vec<f64>,
}

/// Finished screenshot.
type Shot = Arc<Mutex<Option<Arc<egui::ColorImage>>>>;

/// Replay a script in the window
#[derive(Debug, Parser)]
struct Args {
    script: PathBuf,
    #[command(flatten)]
    view: ViewArgs,
}

fn main() -> ExitCode {
    match replay(Args::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::from(e.exit_status())
        }
    }
}

fn replay(args: Args) -> Result<()> {
    let script = Script { steps: read_steps(&args.script)?, ..Script::default() };
    let request = args.view.scene.into_request()?;
    let clean = args.view.clean;
    run(Start { scene: Some(request.settings), run: request.run, clean, hook: Some(Box::new(script)) })
}

/// Running script.
#[derive(Debug, Default)]
struct Script {
    steps: VecDeque<Step>,
    /// Frames and time since the start of the step.
    frame: u32,
    since: Option<Instant>,
    last_frame: Option<Instant>,
    running: Option<Measured>,
    pictures_before: u64,
    measured: Vec<Measured>,
    failed: Option<Error>,
    shot: Shot,
    /// Widget to be pressed, its place, and the frame since which it is visible.
    target: Option<(Id, Rect, Option<u32>)>,
}

impl FrameHook for Script {
    fn window_size(&self) -> Option<[f32; 2]> {
        match self.steps.front() {
            Some(Step::Window { size }) => Some(*size),
            _ => None,
        }
    }

    fn input(&mut self, app: &App, context: &egui::Context, input: &mut egui::RawInput) {
        context.request_repaint();
        let now = Instant::now();
        let since = *self.since.get_or_insert(now);
        let whole = input.screen_rect.unwrap_or(context.content_rect());
        let view = app.model.view.unwrap_or(whole);
        let place = |[x, y]: [f32; 2], screen: bool| -> Pos2 {
            let rect = if screen { whole } else { view };
            pos2(rect.left() + x * rect.width(), rect.top() + y * rect.height())
        };
        let button = |pos: Pos2, pressed: bool, modifiers: Modifiers| Event::PointerButton {
            pos,
            button: PointerButton::Primary,
            pressed,
            modifiers,
        };
        let frame = self.frame;
        let Some(step) = self.steps.front() else { return };
        let events = &mut input.events;
        match step {
            Step::Drag { from, to, seconds, modifiers, screen, .. } => {
                let turn = since.elapsed().as_secs_f32() / seconds.max(0.01);
                // There and back, so that the pointer ends at its start.
                let there = 1.0 - (2.0 * turn.min(1.0) - 1.0).abs();
                let at = [from[0] + there * (to[0] - from[0]), from[1] + there * (to[1] - from[1])];
                let at = place(at, *screen);
                if frame == 0 {
                    events.push(Event::ModifiersChanged(*modifiers));
                    events.push(Event::PointerMoved(at));
                    events.push(button(at, true, *modifiers));
                } else {
                    events.push(Event::PointerMoved(at));
                }
                if turn >= 1.0 {
                    events.push(button(at, false, *modifiers));
                    events.push(Event::ModifiersChanged(Modifiers::NONE));
                }
            }
            Step::Click { at, screen, double } if frame == 0 => {
                let at = place(*at, *screen);
                events.push(Event::PointerMoved(at));
                for _ in 0..if *double { 2 } else { 1 } {
                    events.push(button(at, true, Modifiers::NONE));
                    events.push(button(at, false, Modifiers::NONE));
                }
            }
            Step::Move { at, screen } if frame == 0 => events.push(Event::PointerMoved(place(*at, *screen))),
            Step::Key { key, modifiers } if frame == 0 => {
                for pressed in [true, false] {
                    let (key, modifiers) = (*key, *modifiers);
                    events.push(Event::Key { key, physical_key: None, pressed, repeat: false, modifiers });
                }
            }
            Step::Resize { size } if frame == 0 => {
                context.send_viewport_cmd(egui::ViewportCommand::InnerSize((*size).into()));
            }
            Step::Press { .. } => {
                context.enable_accesskit();
                match self.target {
                    Some((_, rect, Some(seen))) if seen == frame => {
                        let at = rect.center();
                        events.push(Event::PointerMoved(at));
                        events.push(button(at, true, Modifiers::NONE));
                        events.push(button(at, false, Modifiers::NONE));
                    }
                    Some((id, _, None)) => events.push(Event::AccessKitActionRequest(ActionRequest {
                        action: Action::ScrollIntoView,
                        target_tree: TreeId::ROOT,
                        target_node: id.accesskit_id(),
                        data: None,
                    })),
                    _ => {}
                }
            }
            Step::Type { text } if frame == 0 => events.push(Event::Text(text.clone())),
            Step::Shot { .. } if frame == 0 => {
                let shot = Arc::clone(&self.shot);
                context.request_screenshot(move |image| {
                    *shot.lock().unwrap_or_else(PoisonError::into_inner) = Some(image);
                });
            }
            _ => {}
        }
    }

    fn after_frame(&mut self, context: &egui::Context) {
        let Some(Step::Press { name }) = self.steps.front() else { return };
        if matches!(self.target, Some((.., Some(_)))) {
            return;
        }
        self.target = context.viewport(|viewport| {
            let pass = &viewport.this_pass;
            let nodes = &pass.accesskit_state.as_ref()?.nodes;
            let mut named =
                nodes.iter().filter(|(_, n)| [n.label(), n.value()].contains(&Some(name.as_str())));
            let widget = named.find_map(|(id, _)| pass.widgets.get(*id))?;
            let seen = widget.interact_rect.is_positive()
                && widget.interact_rect.height() > 0.6 * widget.rect.height();
            Some((widget.id, widget.interact_rect, seen.then_some(self.frame + 1)))
        });
    }

    fn before_frame(&mut self, app: &mut App, frame: &eframe::Frame) -> Option<Result<()>> {
        let now = Instant::now();
        let interval_ms = self.last_frame.map(|last| now.duration_since(last).as_secs_f64() * 1e3);
        self.last_frame = Some(now);
        let elapsed = self.since.map_or(Duration::ZERO, |s| s.elapsed());
        let Some(step) = self.steps.front().cloned() else { return Some(self.end()) };
        if elapsed > MAX_STEP {
            return Some(Err(Error::runtime(WHAT, format!("{step:?}"), "it took too long")));
        }
        let done = match step {
            Step::Window { .. } => true,
            Step::Resize { .. } => self.frame > 1,
            Step::Silent => {
                if let Some(message) = app.model.messages.iter().find(|m| m.is_error) {
                    let said = Error::runtime(WHAT, "silent", &message.text);
                    self.failed.get_or_insert(said);
                }
                true
            }
            Step::Compared => app.windows.comparison.outcome().is_some(),
            Step::Settle => app.model.is_settled() && app.model.frame.is_some() && self.frame > 2,
            Step::Drag { name, seconds, .. } => {
                let empty = || Measured {
                    name,
                    seconds: 0.0,
                    interface_ms: Vec::new(),
                    pictures: 0,
                    latency_ms: Vec::new(),
                };
                if self.frame == 0 {
                    self.pictures_before = app.model.frames;
                }
                let running = self.running.get_or_insert_with(empty);
                if self.frame > 0 {
                    running.interface_ms.extend(interval_ms);
                }
                let pictures = app.model.frames - self.pictures_before;
                if pictures > running.pictures
                    && let Some(frame) = &app.model.frame
                {
                    running.latency_ms.push(frame.latency_ms);
                }
                running.pictures = pictures;
                running.seconds = elapsed.as_secs_f64();
                let done = elapsed.as_secs_f32() >= seconds && self.frame > 1;
                if done {
                    self.measured.extend(self.running.take());
                }
                done
            }
            Step::Pause { seconds } => elapsed.as_secs_f32() >= seconds,
            Step::Open { source } => {
                if self.frame == 0 {
                    app.model.open_source(&source);
                }
                self.frame > 0
            }
            Step::Shot { path } => {
                let shot = self.shot.lock().unwrap_or_else(PoisonError::into_inner).take();
                if let Some(image) = &shot
                    && let Err(e) = write_png(&path, image)
                {
                    self.failed.get_or_insert(e);
                }
                shot.is_some()
            }
            Step::Times { path } => {
                let text = self.table();
                if let Err(e) = write_whole(&path, |file| file.write_all(text.as_bytes())) {
                    self.failed.get_or_insert(e);
                }
                true
            }
            Step::Press { .. } => {
                matches!(self.target, Some((.., Some(seen))) if self.frame > seen + 1)
            }
            Step::Click { .. } | Step::Move { .. } | Step::Key { .. } | Step::Type { .. } => self.frame > 1,
            Step::Lose => {
                if let Some(state) = frame.wgpu_render_state() {
                    state.device.destroy();
                    // A destroyed device reports the loss when it is polled.
                    let _ = state.device.poll(eframe::wgpu::PollType::wait_indefinitely());
                }
                true
            }
        };
        self.frame += 1;
        if done {
            self.steps.pop_front();
            self.target = None;
            self.frame = 0;
            self.since = None;
        }
        None
    }
}

impl Script {
    fn end(&mut self) -> Result<()> {
        self.failed.take().map_or(Ok(()), Err)
    }

    fn table(&self) -> String {
        let median = |values: &[f64]| {
            let mut sorted = values.to_vec();
            sorted.sort_by(f64::total_cmp);
            sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
        };
        let mut text = String::from(
            "drag\tseconds\tinterface_frames\tinterface_ms_median\tinterface_ms_max\tpictures\tpictures_per_s\t\
             latency_ms_median\tlatency_ms_max\n",
        );
        for m in &self.measured {
            let largest = |values: &[f64]| values.iter().copied().fold(0.0, f64::max);
            text += &format!(
                "{}\t{:.2}\t{}\t{:.1}\t{:.1}\t{}\t{:.2}\t{:.1}\t{:.1}\n",
                m.name,
                m.seconds,
                m.interface_ms.len(),
                median(&m.interface_ms),
                largest(&m.interface_ms),
                m.pictures,
                m.pictures as f64 / m.seconds.max(1e-3),
                median(&m.latency_ms),
                largest(&m.latency_ms),
            );
        }
        text
    }
}

fn write_png(path: &Path, image: &egui::ColorImage) -> Result<()> {
    use image::ImageEncoder;
    use image::codecs::png::{CompressionType, FilterType, PngEncoder};
    let rgb: Vec<u8> = image.pixels.iter().flat_map(|p| [p.r(), p.g(), p.b()]).collect();
    let mut bytes = Vec::new();
    // The files are stored in docs/, so size matters more than time.
    PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive)
        .write_image(&rgb, image.width() as u32, image.height() as u32, image::ExtendedColorType::Rgb8)
        .map_err(|e| Error::runtime("cannot encode picture", path.display(), e))?;
    write_whole(path, |file| file.write_all(&bytes))
}
