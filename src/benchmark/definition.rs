//! Definition of the frozen benchmark: volumes, transfer functions, lights and views, whose combinations are its cells.

use crate::error::{Error, Result};
use crate::open::{Layer, SceneRequest, SceneSettings};
use crate::scene::{Light, LightSource};
use crate::transfer::{Quantity, TransferFunction};
use crate::volume::Volume;
use glam::DVec3;
use glob::Pattern;
use serde::Deserialize;
use std::path::Path;
use toml::Table;

const WHAT: &str = "bad benchmark";

/// Names of the transfer functions of every volume.
pub const FUNCTIONS: [&str; 3] = ["thin", "dense", "surface"];
/// Name of the transfer function of cells under a light with a size.
const SOFT_FUNCTION: &str = FUNCTIONS[1];

/// Definition of a benchmark, from `cells.toml`.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Definition {
    /// Version of the benchmark: results of different versions cannot be compared.
    pub version: u32,
    /// Number of visible points in each cell at which transmittance is compared.
    pub points: usize,
    /// Number of visible points in each cell under a light with a size.
    soft_points: usize,
    /// Keys of the scene file that all cells share.
    scene: Table,
    light: Vec<NamedLight>,
    view: Vec<NamedView>,
    /// Volumes of the benchmark, each with its transfer functions.
    pub volume: Vec<NamedVolume>,
}

/// Light of a benchmark: either in world coordinates, or a point light beside the volume.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct NamedLight {
    name: String,
    /// Light source in the syntax of `--light`.
    light: Option<String>,
    /// Position of a point light from the centre of the volume's box, in units of half its diagonal.
    offset: Option<DVec3>,
    /// Whether the light has a size.
    #[serde(default)]
    soft: bool,
}

#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
struct NamedView {
    name: String,
    scene: Table,
}

/// Volume of a benchmark, with its transfer functions as pairs of value and opacity per mm or extinction (1/mm).
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedVolume {
    /// Name of the volume in names of cells.
    pub name: String,
    /// Description of the volume.
    pub about: String,
    scene: Table,
    #[serde(default)]
    quantity: Amount,
    thin: Vec<(f64, f64)>,
    dense: Vec<(f64, f64)>,
    surface: Vec<(f64, f64)>,
}

/// Quantity that the transfer functions of a volume of the benchmark give.
#[derive(Debug, Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Amount {
    #[default]
    Opacity,
    Extinction,
}

impl NamedVolume {
    /// Returns the transfer function of this volume with one of the names in [`FUNCTIONS`].
    pub fn function(&self, name: &str) -> TransferFunction {
        let points = match name {
            "thin" => &self.thin,
            "dense" => &self.dense,
            _ => &self.surface,
        };
        let quantity = match self.quantity {
            Amount::Opacity => Quantity::Opacity,
            Amount::Extinction => Quantity::Extinction,
        };
        TransferFunction { name: format!("{} {name}", self.name), ..TransferFunction::new(quantity, points) }
    }
}

/// Cell of the benchmark: a volume, a transfer function, a light and a view.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Cell {
    /// Index of the volume of this cell in the definition of the benchmark.
    pub volume: usize,
    /// Name of the transfer function of this cell.
    pub function: &'static str,
    light: usize,
    view: usize,
    /// Whether the light of this cell has a size.
    pub is_soft: bool,
    /// Name of the cell, `VOLUME-FUNCTION-LIGHT-VIEW`.
    pub name: String,
}

/// Where the settings of the methods in a cell come from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Source<T> {
    /// A full search.
    Full,
    /// A short search that starts from the settings of another cell.
    Nearby(T),
    /// The settings of another cell.
    Known(T),
}

impl<T> Source<T> {
    /// Returns the other cell, if any.
    pub fn cell(&self) -> Option<&T> {
        match self {
            Self::Full => None,
            Self::Nearby(cell) | Self::Known(cell) => Some(cell),
        }
    }

    /// Replaces the other cell, if any.
    ///
    /// # Errors
    /// `change` fails.
    pub fn try_map<U>(self, change: impl FnOnce(T) -> Result<U>) -> Result<Source<U>> {
        Ok(match self {
            Self::Full => Source::Full,
            Self::Nearby(cell) => Source::Nearby(change(cell)?),
            Self::Known(cell) => Source::Known(change(cell)?),
        })
    }
}

impl Cell {
    /// Whether two cells differ at most in light and view.
    pub fn is_beside(&self, other: &Self) -> bool {
        (self.volume, self.function) == (other.volume, other.function)
    }

    /// Returns where this cell takes its settings from, with the cell among `cells` that gives them.
    ///
    /// The first cell of a volume and transfer function has a full search. Other cells of the first view start their
    /// search from it. The other views take the settings found under the same light in the first view: their points are
    /// others than those that the settings were searched at.
    pub fn source<'a>(&self, cells: &'a [Self]) -> Source<&'a Self> {
        let first = cells.iter().find(|cell| self.is_beside(cell));
        let of_light = cells.iter().find(|cell| self.is_beside(cell) && cell.light == self.light);
        match (first, of_light) {
            (_, Some(other)) if other != self => Source::Known(other),
            (Some(first), _) if first != self => Source::Nearby(first),
            _ => Source::Full,
        }
    }
}

impl Definition {
    /// Reads the frozen benchmark, which is part of the program.
    ///
    /// # Errors
    /// The definition is not valid.
    pub fn frozen() -> Result<Self> {
        toml::from_str(include_str!("cells.toml"))
            .map_err(|e| Error::runtime(WHAT, "cells.toml", e.message()))
    }

    /// Returns all cells of the benchmark: all combinations of volumes, transfer functions, lights and views. Lights with
    /// a size have one transfer function and the first view alone, since exact means over them take minutes.
    pub fn cells(&self) -> Vec<Cell> {
        let mut cells = Vec::new();
        for (volume, named) in self.volume.iter().enumerate() {
            for function in FUNCTIONS {
                for (light, of_light) in self.light.iter().enumerate() {
                    let is_soft = of_light.soft;
                    let views = match is_soft {
                        true if function == SOFT_FUNCTION => &self.view[..1],
                        true => &[],
                        false => &self.view[..],
                    };
                    for (view, of_view) in views.iter().enumerate() {
                        let name = format!("{}-{function}-{}-{}", named.name, of_light.name, of_view.name);
                        cells.push(Cell { volume, function, light, view, is_soft, name });
                    }
                }
            }
        }
        cells
    }

    /// Returns the number of visible points of a cell.
    pub fn points_of(&self, cell: &Cell) -> usize {
        if cell.is_soft { self.soft_points } else { self.points }
    }

    /// Returns the cells whose names match one of the patterns: `*` stands for any text, and commas separate patterns.
    ///
    /// # Errors
    /// A pattern is not valid, or no cell matches it.
    pub fn cells_like(&self, patterns: &str) -> Result<Vec<Cell>> {
        let all = self.cells();
        let refuse = |text: &str, why: &str| Err(Error::input(WHAT, format!("--cells {text}"), why));
        let mut parsed = Vec::new();
        for text in patterns.split(',').map(str::trim) {
            if text.contains(['?', '[']) || text.contains("**") {
                return refuse(text, "only * stands for other text");
            }
            match Pattern::new(text) {
                Ok(pattern) if all.iter().any(|cell| pattern.matches(&cell.name)) => parsed.push(pattern),
                Ok(_) => {
                    return refuse(text, "no cell has such a name")
                        .map_err(|e| e.hint("names are VOLUME-FUNCTION-LIGHT-VIEW; --list shows all"));
                }
                Err(e) => return refuse(text, e.msg),
            }
        }
        Ok(all.into_iter().filter(|cell| parsed.iter().any(|pattern| pattern.matches(&cell.name))).collect())
    }

    /// Returns the settings of a volume's scene, without light, view and transfer function. A file is in the folder
    /// `data`.
    ///
    /// # Errors
    /// The definition has a key that no scene file has.
    pub fn volume_settings(&self, volume: &NamedVolume, data: &Path) -> Result<SceneSettings> {
        let table: Table = self.scene.clone().into_iter().chain(volume.scene.clone()).collect();
        let mut settings = SceneRequest::from_table(&table)?.settings;
        if let Some(source) = settings.volume.as_mut().filter(|source| !source.starts_with("phantom:")) {
            let path = data.join(&*source);
            if !path.exists() {
                let hint = "--data names the folder of the scans; --cells can leave them out";
                let why = "there is no such file";
                return Err(Error::input("cannot read volume", path.display(), why).hint(hint));
            }
            *source = path.display().to_string();
        }
        Ok(settings)
    }

    /// Adds light and view of a cell to the settings of its volume.
    ///
    /// # Errors
    /// The definition has a key that no scene file has.
    pub fn cell_settings(
        &self,
        cell: &Cell,
        settings: &SceneSettings,
        volume: &Volume,
    ) -> Result<SceneSettings> {
        let light = &self.light[cell.light];
        let mut table = self.view[cell.view].scene.clone();
        if let Some(text) = &light.light {
            table.insert("light".into(), text.clone().into());
        }
        let of_cell = SceneRequest::from_table(&table)?.settings;
        let mut settings = of_cell.over(settings);
        if let Some(offset) = light.offset {
            let (centre, radius) = volume.bounding_sphere_mm();
            let position = (centre + offset * radius).round();
            settings.light = Some(vec![LightSource::from(Light::Point { position })]);
        }
        settings.name = Some(cell.name.clone());
        Ok(settings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::HashSet;

    #[test]
    fn the_frozen_benchmark_has_a_cell_for_every_combination() {
        let definition = Definition::frozen().unwrap();
        let cells = definition.cells();
        assert!(definition.volume.len() >= 12);
        assert_eq!(cells.len(), definition.volume.len() * (3 * 4 * 3 + 2));
        let names: HashSet<_> = cells.iter().map(|cell| &cell.name).collect();
        assert_eq!(names.len(), cells.len());
        let count = |is: fn(&Source<&Cell>) -> bool| cells.iter().filter(|c| is(&c.source(&cells))).count();
        assert_eq!(count(|source| *source == Source::Full), definition.volume.len() * 3);
        assert_eq!(count(|source| matches!(source, Source::Known(_))), definition.volume.len() * 3 * 4 * 2);
    }

    #[test]
    fn settings_come_from_the_first_view_or_the_first_cell() {
        let cells = Definition::frozen().unwrap().cells();
        let source = |name: &str| {
            let cell = cells.iter().find(|cell| cell.name == name).unwrap();
            cell.source(&cells).try_map(|other| Ok(&*other.name)).unwrap()
        };
        assert_eq!(source("foam-dense-front-front"), Source::Full);
        assert_eq!(source("foam-dense-lamp-front"), Source::Nearby("foam-dense-front-front"));
        assert_eq!(source("foam-dense-lamp-close"), Source::Known("foam-dense-lamp-front"));
        assert_eq!(source("foam-dense-front-above"), Source::Known("foam-dense-front-front"));
        assert_eq!(source("foam-dense-sky-front"), Source::Nearby("foam-dense-front-front"));
    }

    #[test]
    fn patterns_select_cells_by_name() {
        let definition = Definition::frozen().unwrap();
        let count = |patterns: &str| definition.cells_like(patterns).map(|cells| cells.len());
        assert_eq!(count("*").unwrap(), definition.cells().len());
        assert_eq!(count("cloud-*,smoke-thin-*").unwrap(), 38 + 12);
        assert_eq!(count("cloud-thin-front-close,cloud-*").unwrap(), 38);
        for bad in ["", "clouds-*", "cloud-[", "cloud-*,x"] {
            assert_eq!(count(bad).unwrap_err().exit_status(), 2, "{bad}");
        }
    }

    #[test]
    fn lights_beside_a_volume_are_outside_of_it() {
        let definition = Definition::frozen().unwrap();
        let cell = definition.cells_like("cloud-dense-lamp-close").unwrap().remove(0);
        let volume = crate::phantom::Phantom::Cloud.build(4).unwrap();
        let settings = definition.volume_settings(&definition.volume[cell.volume], Path::new("")).unwrap();
        let settings = definition.cell_settings(&cell, &settings, &volume).unwrap();
        assert_eq!(settings.zoom, Some(2.5));
        let position = DVec3::new(44.0, 28.0, 33.0);
        assert_eq!(settings.light, Some(vec![Light::Point { position }.into()]));
    }

    #[test]
    fn lights_with_a_size_are_marked() {
        let definition = Definition::frozen().unwrap();
        for light in &definition.light {
            let source = light.light.as_ref().map(|text| crate::open::values::light(text).unwrap());
            assert_eq!(light.soft, source.is_some_and(|source| source.is_soft()), "{}", light.name);
        }
    }
}
