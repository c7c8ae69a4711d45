//! Optimizations that a plan applies where the scene allows them, and the set that the user disables.

use crate::error::Error;
use clap::ValueEnum;
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Work that the plan skips where a scene does not need it. Disabling an optimization changes times and bytes, and no
/// picture by more than rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Optimization {
    /// Colour in the integrals over the value, where all extinction has one colour.
    Colors,
    /// The pre-compressed table, where nothing marches cell by cell.
    MarchTable,
    /// The march's search for breakpoints, where the pre-compressed table holds all of them.
    BreakpointSearch,
    /// Bricks without extinction, on eye rays and light rays.
    Bricks,
    /// Tiles of the picture without active bricks, and eye rays before the first and behind the last active brick.
    EyeTiles,
    /// Tiles of a shadow map without active bricks.
    Tiles,
    /// The pass that finds where each light ray first meets extinction, before the layers are filled.
    DepthPass,
    /// The shadow structure and its lookups, where the visible points are fully lit.
    Shadows,
    /// Gradients, without shading.
    Gradients,
}

impl fmt::Display for Optimization {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_possible_value().map_or(Ok(()), |value| f.write_str(value.get_name()))
    }
}

/// Set of optimizations that are disabled (`--no-skip`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct DisabledOptimizations(u16);

impl DisabledOptimizations {
    /// The empty set: every optimization is applied.
    pub const NONE: Self = Self(0);

    /// The set of one optimization.
    pub fn only(one: Optimization) -> Self {
        Self(1 << one as u16)
    }

    /// Union of two sets.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether an optimization is disabled.
    pub fn has(self, one: Optimization) -> bool {
        self.0 & Self::only(one).0 != 0
    }
}

/// Writes the value that `--no-skip` takes.
impl Serialize for DisabledOptimizations {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let disabled = Optimization::value_variants().iter().filter(|one| self.has(**one));
        serializer.serialize_str(&disabled.map(ToString::to_string).collect::<Vec<_>>().join(","))
    }
}

impl FromStr for DisabledOptimizations {
    type Err = Error;

    /// Reads names separated by commas, or `all`.
    fn from_str(text: &str) -> Result<Self, Error> {
        let all = Optimization::value_variants();
        text.split(',').map(str::trim).try_fold(Self::NONE, |disabled, name| {
            if name == "all" {
                return Ok(all.iter().copied().map(Self::only).fold(disabled, Self::and));
            }
            let one = Optimization::from_str(name, false).map_err(|_| {
                let names = all.iter().map(ToString::to_string).collect::<Vec<_>>().join(", ");
                Error::input("unknown name", format!("`{name}`"), format!("there is: {names}, all"))
            })?;
            Ok(disabled.and(Self::only(one)))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_parsed_to_distinct_optimizations() {
        for one in Optimization::value_variants() {
            let disabled: DisabledOptimizations = one.to_string().parse().unwrap();
            assert_eq!(disabled, DisabledOptimizations::only(*one));
            assert_eq!(serde_json::to_string(&disabled).unwrap(), serde_json::to_string(one).unwrap());
        }
        let two: DisabledOptimizations = "tiles, bricks".parse().unwrap();
        let [tiles, bricks] = [Optimization::Tiles, Optimization::Bricks].map(DisabledOptimizations::only);
        assert_eq!(two, tiles.and(bricks));
        assert_eq!(serde_json::to_string(&two).unwrap(), "\"bricks,tiles\"");
        let all: DisabledOptimizations = "all".parse().unwrap();
        assert!(Optimization::value_variants().iter().all(|one| all.has(*one)));
        assert!("brick".parse::<DisabledOptimizations>().unwrap_err().why.contains("march-table"));
        assert!("".parse::<DisabledOptimizations>().is_err());
    }
}
