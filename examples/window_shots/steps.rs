//! Steps of a script, as `main.rs` describes them.

use eframe::egui::{Key, Modifiers};
use std::collections::VecDeque;
use std::path::{Path, PathBuf};
use umbravox::error::{Error, Result};
use umbravox::files::input::read_text;

/// Action that failed, for errors.
pub const WHAT: &str = "cannot replay script";

/// Step of a script.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    Window { size: [f32; 2] },
    Resize { size: [f32; 2] },
    Silent,
    Settle,
    Compared,
    Drag { name: String, from: [f32; 2], to: [f32; 2], seconds: f32, modifiers: Modifiers, screen: bool },
    Click { at: [f32; 2], screen: bool, double: bool },
    Move { at: [f32; 2], screen: bool },
    Press { name: String },
    Type { text: String },
    Key { key: Key, modifiers: Modifiers },
    Pause { seconds: f32 },
    Open { source: String },
    Shot { path: PathBuf },
    Times { path: PathBuf },
    Lose,
}

/// Reads a script.
///
/// # Errors
/// The file cannot be read, or a line is none of the steps.
pub fn read_steps(path: &Path) -> Result<VecDeque<Step>> {
    let mut steps = VecDeque::new();
    for (line, text) in (1..).zip(read_text(path, WHAT)?.lines()) {
        let words: Vec<&str> = text.split('#').next().unwrap_or_default().split_whitespace().collect();
        if words.is_empty() {
            continue;
        }
        let place = format!("{}: line {line}", path.display());
        steps.push_back(parse(&words).ok_or_else(|| Error::input(WHAT, place, "this is no step"))?);
    }
    Ok(steps)
}

fn parse(words: &[&str]) -> Option<Step> {
    let number = |i: usize| words.get(i).and_then(|w| w.parse::<f32>().ok()).filter(|x| x.is_finite());
    let has = |word: &str| words.contains(&word);
    let modifiers = if has("shift") {
        Modifiers::SHIFT
    } else if has("ctrl") {
        Modifiers::COMMAND | Modifiers::CTRL
    } else {
        Modifiers::NONE
    };
    let rest = || words.get(1..).map(|w| w.join(" ")).filter(|w| !w.is_empty());
    let screen = has("screen");
    Some(match words[0] {
        "window" => Step::Window { size: [number(1)?, number(2)?] },
        "resize" => Step::Resize { size: [number(1)?, number(2)?] },
        "silent" => Step::Silent,
        "settle" => Step::Settle,
        "compared" => Step::Compared,
        "drag" => Step::Drag {
            name: (*words.get(1)?).to_owned(),
            from: [number(2)?, number(3)?],
            to: [number(4)?, number(5)?],
            seconds: number(6)?,
            modifiers,
            screen,
        },
        "click" | "double" => {
            Step::Click { at: [number(1)?, number(2)?], screen, double: words[0] == "double" }
        }
        "move" => Step::Move { at: [number(1)?, number(2)?], screen },
        "key" => Step::Key { key: Key::from_name(words.get(1)?)?, modifiers },
        "press" => Step::Press { name: rest()? },
        "type" => Step::Type { text: rest()? },
        "pause" => Step::Pause { seconds: number(1)? },
        "open" => Step::Open { source: rest()? },
        "shot" => Step::Shot { path: rest()?.into() },
        "lose" => Step::Lose,
        "times" => Step::Times { path: rest()?.into() },
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_are_read_and_slips_refused_by_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.txt");
        std::fs::write(&path, "settle # first\n\ndrag light 0.1 0.2 0.3 0.4 2 shift\nkey C\nshot a b.png\n")
            .unwrap();
        let steps = read_steps(&path).unwrap();
        assert_eq!(steps.len(), 4);
        assert_eq!(steps[3], Step::Shot { path: "a b.png".into() });
        assert!(matches!(&steps[1], Step::Drag { modifiers, .. } if modifiers.shift));
        for bad in ["drag x 1 2", "click 1", "key Nope", "jump 3", "shot", "resize 3", "press"] {
            std::fs::write(&path, format!("settle\n{bad}\n")).unwrap();
            let error = read_steps(&path).unwrap_err();
            assert!(error.place.contains("line 2") && error.exit_status() == 2, "{bad}: {error}");
        }
    }
}
