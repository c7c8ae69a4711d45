//! Settings of shadow methods as their own papers describe them.

/// Settings of a shadow method as its own paper describes them.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Published {
    /// Authors and year of the paper.
    pub paper: &'static str,
    /// Shadow method with the settings of the paper, in command-line syntax.
    pub settings: &'static str,
}
