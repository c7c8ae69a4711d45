//! The work that a plan may leave out, by name, and which of it is forced back on.

use crate::error::Error;
use serde::{Deserialize, Serialize, Serializer};
use std::fmt;
use std::str::FromStr;

/// Something that a scene may not need. Forcing it changes times and bytes, and no picture by more than rounding.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Omittable {
    /// Bricks without extinction, on eye rays and light rays.
    Bricks,
    /// Tiles of the picture in which no active brick may show, and eye rays before the first and behind the last one.
    EyeTiles,
    /// Tiles of a shadow map without active bricks.
    Tiles,
    /// The shadow structure and its lookups, where no light can be kept from what is seen.
    Shadows,
    /// The pre-compressed table, where nothing marches cell by cell.
    MarchTable,
    /// The march's search for breakpoints, where no entry of that table has more than it holds.
    BreakpointSearch,
    /// Colour in the integrals over the value, where everything with extinction has one colour.
    Colors,
    /// Gradients, without shading.
    Gradients,
    /// The pass that finds where each light ray first meets extinction, before the layers are filled.
    DepthPass,
}

impl Omittable {
    /// All, in the order of the pipeline.
    pub const ALL: [Self; 9] = [
        Self::Colors,
        Self::MarchTable,
        Self::BreakpointSearch,
        Self::Bricks,
        Self::EyeTiles,
        Self::Tiles,
        Self::DepthPass,
        Self::Shadows,
        Self::Gradients,
    ];

    /// Its name on the command line (`--force`) and in tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::Bricks => "bricks",
            Self::EyeTiles => "eye-tiles",
            Self::Tiles => "tiles",
            Self::Shadows => "shadows",
            Self::MarchTable => "march-table",
            Self::BreakpointSearch => "breakpoint-search",
            Self::Colors => "colors",
            Self::Gradients => "gradients",
            Self::DepthPass => "depth-pass",
        }
    }
}

impl fmt::Display for Omittable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What is forced back on although the scene does not need it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub struct Forced(u16);

impl Forced {
    /// All is left out that a scene does not need.
    pub const NOTHING: Self = Self(0);

    /// One thing is forced.
    pub fn only(one: Omittable) -> Self {
        Self(1 << one as u16)
    }

    /// Both are forced.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }

    /// Whether a thing is forced.
    pub fn has(self, one: Omittable) -> bool {
        self.0 & Self::only(one).0 != 0
    }
}

/// As `--force` takes it.
impl Serialize for Forced {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let names = Omittable::ALL.into_iter().filter(|one| self.has(*one)).map(Omittable::name);
        serializer.serialize_str(&names.collect::<Vec<_>>().join(","))
    }
}

impl FromStr for Forced {
    type Err = Error;

    /// Names separated by commas, or `all`.
    fn from_str(text: &str) -> Result<Self, Error> {
        text.split(',').map(str::trim).try_fold(Self::NOTHING, |forced, name| {
            let all = (name == "all").then_some(Self((1 << Omittable::ALL.len()) - 1));
            let one = || Omittable::ALL.into_iter().find(|o| o.name() == name).map(Self::only);
            all.or_else(one).map(|more| forced.and(more)).ok_or_else(|| {
                let names = Omittable::ALL.map(Omittable::name).join(", ");
                Error::input("unknown name", format!("`{name}`"), format!("there is: {names}, all"))
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_read_back_and_told_apart() {
        for one in Omittable::ALL {
            let forced: Forced = one.name().parse().unwrap();
            let on: Vec<_> = Omittable::ALL.into_iter().filter(|o| forced.has(*o)).collect();
            assert_eq!(on, [one]);
        }
        let two: Forced = "tiles, bricks".parse().unwrap();
        assert!(two.has(Omittable::Tiles) && two.has(Omittable::Bricks) && !two.has(Omittable::Colors));
        let all: Forced = "all".parse().unwrap();
        assert!(Omittable::ALL.into_iter().all(|o| all.has(o)));
        assert!("brick".parse::<Forced>().unwrap_err().why.contains("march-table"));
        assert!("".parse::<Forced>().is_err());
    }
}
