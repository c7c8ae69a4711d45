//! External programs in the benchmark: a command reads the visible points of a cell and writes their transmittances, or
//! a picture.
//!
//! The command runs in a shell, in the working folder of this program. Environment variables name its files by absolute
//! paths, and [`EXCHANGE`] describes them.

use super::answer::Answer;
use super::measure::{CellJob, Errors};
use crate::error::{Error, Result};
use crate::files::output::write_whole;
use crate::files::picture::read_exr;
use crate::formats::write_nifti;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::str::FromStr;
use std::time::Instant;

const WHAT: &str = "cannot run external program";
/// Largest number of characters of a program's output in a message.
const MOST_QUOTED: usize = 120;

/// Environment variables of an external program: name, file and contents.
pub const EXCHANGE: [(&str, &str, &str); 7] = [
    ("UMBRAVOX_SCENE", "scene.toml", "scene file: camera, light, picture size and background"),
    ("UMBRAVOX_VOLUME", "volume.nii", "volume as NIfTI, with its affine (world coordinates in mm)"),
    ("UMBRAVOX_FUNCTION", "function.json", "transfer function"),
    ("UMBRAVOX_POINTS", "points.txt", "visible points, a line `x y z` each, world mm"),
    (
        "UMBRAVOX_TRANSMITTANCES",
        "transmittances.txt",
        "to be written: a transmittance for each line of the points",
    ),
    ("UMBRAVOX_PICTURE_SCENE", "picture.toml", "scene file of a small picture"),
    ("UMBRAVOX_PICTURE", "picture.exr", "may be written: linear RGBA of the small picture"),
];

/// External program that answers the points of a cell.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct External {
    /// Name of the external program in tables.
    pub name: String,
    /// Command of the external program, for the shell.
    pub command: String,
}

impl FromStr for External {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let (name, command) = text.split_once('=').ok_or("expected NAME=COMMAND")?;
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.".contains(c);
        if name.is_empty() || !name.chars().all(is_plain) || command.trim().is_empty() {
            return Err("expected NAME=COMMAND, with letters, digits, `-`, `_` and `.` in NAME".into());
        }
        if crate::shadow::entry(name).is_some() {
            return Err(format!("`{name}` is the name of a shadow method"));
        }
        Ok(Self { name: name.into(), command: command.into() })
    }
}

impl External {
    /// Runs the program for a cell and compares its answers with the exact ones. A failure of the program is noted in the
    /// answer. `scenes` are the texts of the scene files of the cell and of its small picture.
    ///
    /// # Errors
    /// A file for the program cannot be written, or a weight of the points is not valid.
    pub fn answer(&self, cell: &CellJob, scenes: [&str; 2], folder: &Path) -> Result<(Answer, Errors)> {
        let mut answer =
            Answer { method: self.name.clone(), settings: self.command.clone(), ..Answer::default() };
        let files = Files(folder);
        files.write_inputs(cell, scenes)?;
        let start = Instant::now();
        let ran = self.run(&files);
        answer.frame_ms = Some(start.elapsed().as_secs_f64() * 1e3);
        if let Err(e) = ran {
            return Ok((Answer { note: e.to_string(), ..answer }, Errors::new()));
        }
        let (errors, picture) = (files.read_transmittances(cell), files.picture_error(cell));
        let failures = [errors.as_ref().err(), picture.as_ref().err()].into_iter().flatten();
        let note = failures.map(Error::to_string).collect::<Vec<_>>().join("; ");
        let (errors, picture) = (errors.unwrap_or_default(), picture.unwrap_or_default());
        answer.set_errors(&errors)?;
        answer.image_rmse = picture;
        if !note.is_empty() {
            answer.note = note;
        } else if errors.is_empty() && picture.is_none() {
            answer.note = "it wrote neither transmittances nor a picture".into();
        }
        Ok((answer, errors))
    }

    fn run(&self, files: &Files) -> Result<()> {
        let failed = |why: String| Error::runtime(WHAT, &self.name, why);
        let mut command = Command::new("sh");
        command.arg("-c").arg(&self.command).stdin(Stdio::null()).stdout(Stdio::null());
        command.envs(EXCHANGE.map(|(variable, file, _)| (variable, files.path(file))));
        let output = command.output().map_err(|e| failed(e.to_string()))?;
        if output.status.success() {
            return Ok(());
        }
        let said = String::from_utf8_lossy(&output.stderr);
        Err(failed(format!("{}: {}", output.status, shortened(said.lines().last().unwrap_or_default()))))
    }
}

/// Returns the beginning of a text that a program wrote, for a message in one line.
fn shortened(text: &str) -> String {
    text.chars().filter(|c| !c.is_control()).take(MOST_QUOTED).collect()
}

/// Files that an external program reads and writes, in one folder.
struct Files<'a>(&'a Path);

impl Files<'_> {
    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    fn write_inputs(&self, cell: &CellJob, [scene, picture]: [&str; 2]) -> Result<()> {
        self.write_cell(cell, scene)?;
        self.write("picture.toml", picture)?;
        write_nifti(cell.job().volume, &self.path("volume.nii"))
    }

    fn write_cell(&self, cell: &CellJob, scene: &str) -> Result<()> {
        let points = cell.visible().points_mm();
        let points: String = points.iter().map(|p| format!("{} {} {}\n", p.x, p.y, p.z)).collect();
        self.write("scene.toml", scene)?;
        self.write("function.json", &cell.job().tf.to_json())?;
        self.write("points.txt", &points)
    }

    fn write(&self, name: &str, text: &str) -> Result<()> {
        write_whole(&self.path(name), |file| file.write_all(text.as_bytes()))
    }

    /// Reads the transmittances of the program, and returns their errors with the weights of the points. It returns no
    /// errors where the program wrote no file.
    fn read_transmittances(&self, cell: &CellJob) -> Result<Errors> {
        let path = self.path("transmittances.txt");
        if !path.exists() {
            return Ok(Errors::new());
        }
        let refuse = |why: String| Error::runtime(WHAT, "transmittances.txt", why);
        let text = fs::read_to_string(&path).map_err(|e| refuse(e.to_string()))?;
        let parse = |(line, text): (usize, &str)| {
            let value = text.trim().parse::<f64>().ok().filter(|value| value.is_finite());
            value.ok_or_else(|| refuse(format!("line {}: `{}` is not a number", line + 1, shortened(text))))
        };
        let values = text.lines().enumerate().map(parse).collect::<Result<Vec<_>>>()?;
        let visible = cell.visible();
        if values.len() != visible.len() {
            return Err(refuse(format!("{} lines for {} points", values.len(), visible.len())));
        }
        let errors = values.iter().zip(visible.exact()).map(|(value, exact)| value - exact);
        Ok(errors.zip(visible.weights().iter().copied()).collect())
    }

    /// Returns the rms difference of the program's picture from the exact one; `None` where it drew no picture.
    fn picture_error(&self, cell: &CellJob) -> Result<Option<f64>> {
        let path = self.path("picture.exr");
        if !path.exists() {
            return Ok(None);
        }
        cell.picture_error(read_exr(&path)?.view()).map(Some)
    }
}

/// Writes scene file, transfer function, visible points and exact transmittances of a cell into an existing folder. A line
/// of `exact.txt` has the transmittance of the point in the same line of `points.txt`, and its weight in `point_err_rms`.
///
/// # Errors
/// A file cannot be written.
pub fn export_cell(cell: &CellJob, scene: &str, folder: &Path) -> Result<()> {
    let (files, visible) = (Files(folder), cell.visible());
    files.write_cell(cell, scene)?;
    let lines = visible.exact().iter().zip(visible.weights());
    files.write("exact.txt", &lines.map(|(exact, weight)| format!("{exact} {weight}\n")).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_methods_are_not_names_of_programs() {
        let vtk: External = "vtk=python3 a.py --x=1".parse().unwrap();
        assert_eq!((&*vtk.name, &*vtk.command), ("vtk", "python3 a.py --x=1"));
        for bad in ["", "vtk", "vtk=", "=x", "dsm=x", " dsm=x", "a|b=x"] {
            assert!(bad.parse::<External>().is_err(), "{bad}");
        }
    }
}
