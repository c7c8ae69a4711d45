//! Part of a ray within a volume cell, where the value is trilinear.

use super::cubic::Cubic;

/// Part of a ray within a volume cell.
pub(super) struct CellChord<'a> {
    /// Values at the corners of the cell, `corner[x + 2 y + 4 z]`.
    pub corner: &'a [f64; 8],
    /// Start of the chord in the cell, in `[0, 1]` along each axis, and its end minus its start.
    pub start: [f64; 3],
    pub displacement: [f64; 3],
}

impl CellChord<'_> {
    /// Returns the trilinear value along the chord, as a cubic over `[0, 1]`.
    ///
    /// Only differences of corners are scaled, so that a constant cell gives exactly its value.
    #[inline]
    pub fn value(&self) -> Cubic {
        let ([x, y, z], [p, q, r]) = (self.start, self.displacement);
        let [v000, v100, v010, v110, v001, v101, v011, v111] = *self.corner;
        let (a, b, c) = (v100 - v000, v010 - v000, v001 - v000);
        let (ab, ac, bc) = ((v110 - v010) - a, (v101 - v001) - a, (v011 - v001) - b);
        let abc = ((v111 - v011) - (v101 - v001)) - ab;
        // Taylor expansion of the trilinear form about the start, along (p, q, r).
        let dx = a + ab * y + (ac + abc * y) * z;
        let dy = b + ab * x + (bc + abc * x) * z;
        let dz = c + ac * x + (bc + abc * x) * y;
        Cubic([
            v000 + (a + ab * y) * x + b * y + (c + ac * x + (bc + abc * x) * y) * z,
            dx * p + dy * q + dz * r,
            (ab + abc * z) * (p * q) + (ac + abc * y) * (p * r) + (bc + abc * x) * (q * r),
            abc * (p * q * r),
        ])
    }
}
