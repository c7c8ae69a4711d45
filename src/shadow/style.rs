//! How a method looks in every figure.

/// Colour and marker. Colours are of the Okabe-Ito palette (Okabe and Ito 2008), whose yellow is too pale on white, and,
/// where it ends, of Tol's muted one (Tol 2021).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Style {
    /// sRGB.
    pub color: [u8; 3],
    /// Shape of a point.
    pub marker: Marker,
}

/// Shape of a point in a plot.
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
    Spark,
    Triad,
    Cross,
    Plus,
    Star,
}
