//! Optimizations, which skip work that a scene does not need, and the set of optimizations that the user disables.

use crate::error::Error;
use clap::ValueEnum;
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Optimization that skips work where a scene does not need it. Disabling an optimization changes times and bytes,
/// and changes no picture by more than rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize, ValueEnum)]
#[serde(rename_all = "kebab-case")]
pub enum Optimization {
    /// Stores no colour in the lookup tables of the transfer function, if all extinction has one colour.
    Colors,
    /// Does not compute the table of transfer-function breakpoints between two voxel values, if no light ray is
    /// marched cell by cell.
    MarchTable,
    /// Does not search for transfer-function breakpoints during the light march, if the breakpoint table holds all of
    /// them.
    BreakpointSearch,
    /// Skips bricks (blocks of voxel cells) without extinction, on eye rays and light rays.
    Bricks,
    /// Skips tiles of the picture without bricks with extinction. Eye rays start at the first and end behind the last
    /// such brick in their tile.
    EyeTiles,
    /// Skips tiles of a shadow map without active bricks (blocks of cells with extinction).
    Tiles,
    /// Skips the build pass of a layered shadow map that finds the depth at which each light ray first meets
    /// extinction.
    DepthPass,
    /// Skips the shadow map and its queries, if all visible points are fully lit.
    Shadows,
    /// Skips gradients of the volume, if the picture has no shading.
    Gradients,
}

impl fmt::Display for Optimization {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.to_possible_value().map_or(Ok(()), |value| f.write_str(value.get_name()))
    }
}

/// Set of optimizations that the user disables (`--no-skip`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct DisabledOptimizations(u16);

impl DisabledOptimizations {
    /// Empty set of disabled optimizations: every optimization is applied.
    pub const NONE: Self = Self(0);

    /// Returns the set of disabled optimizations that holds only the given one.
    pub fn only(one: Optimization) -> Self {
        Self(1 << one as u16)
    }

    /// Returns the union of two sets of disabled optimizations.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether the set of disabled optimizations contains the given one.
    pub fn has(self, one: Optimization) -> bool {
        self.0 & Self::only(one).0 != 0
    }
}

/// Writes the disabled optimizations as a text that `--no-skip` accepts: names, separated by commas.
impl Serialize for DisabledOptimizations {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let disabled = Optimization::value_variants().iter().filter(|one| self.has(**one));
        serializer.serialize_str(&disabled.map(ToString::to_string).collect::<Vec<_>>().join(","))
    }
}

impl FromStr for DisabledOptimizations {
    type Err = Error;

    /// Parses the value of `--no-skip`: names of optimizations, separated by commas, or `all`.
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
