//! Colours and markers of shadow methods in figures.

/// Colour and marker of a shadow method in figures. Colours come from the palette of Okabe and Ito (2008), without
/// its pale yellow, and from Tol's muted palette (2021).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Style {
    /// Colour of the shadow method in figures, sRGB.
    pub color: [u8; 3],
    /// Shape of the points of the shadow method in plots.
    pub marker: Marker,
}

/// Shape of the markers of a shadow method in a plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names say it")]
pub enum Marker {
    Circle,
    Square,
    Diamond,
    Up,
    Down,
    Left,
    Right,
    Pentagon,
    Hexagon,
    Spark,
    Triad,
    Cross,
    Plus,
    Star,
}
