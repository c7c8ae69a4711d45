//! Positions of the planes between the layers of a shadow map, as shares of the layers' total depth range.

/// Number of depth bins of a table that divides a depth range into the layers of a shadow map.
pub const SPLIT_BINS: usize = 1024;

/// Rule that divides a depth range into the layers of a shadow map: a formula or tables.
#[derive(Debug, Clone, PartialEq)]
pub enum Split {
    /// Places plane `k` between `K` layers of the shadow map at the share `(k / K)^exponent` of the depth range.
    Power(f64),
    /// Makes the k-th layer of the shadow map k times as thick as the first.
    Growing,
    /// Tables of layer positions over depth. A shadow map uses one table, or each of its texels selects one.
    Tables(Vec<SplitTable>),
}

impl Split {
    /// Returns the shader preprocessor definition that selects this rule of dividing depth into layers; `None` for
    /// the shaders' default rule.
    pub fn def(&self) -> Option<&'static str> {
        match self {
            Self::Power(_) => None,
            Self::Growing => Some("SPLIT_GROWING"),
            Self::Tables(_) => Some("SPLIT_TABLE"),
        }
    }
}

/// Table that divides a depth range into the layers of a shadow map: the share of the layers in front of each of
/// `SPLIT_BINS + 1` evenly spaced depths.
#[derive(Debug, Clone, PartialEq)]
pub struct SplitTable(Vec<f64>);

impl SplitTable {
    /// Tabulates a division of depth into layers from a function of depth. The function is the share of the layers in
    /// front of a depth; it rises from 0 at depth 0 to 1 at depth 1.
    pub fn of(share_of_layers: impl Fn(f64) -> f64) -> Self {
        Self((0..=SPLIT_BINS).map(|i| share_of_layers(i as f64 / SPLIT_BINS as f64)).collect())
    }

    /// Divides a depth range into layers with equal shares of the optical mass that `mass` holds for each depth bin.
    /// Layers are equally thick if all mass is 0.
    pub fn of_mass(mass: &[u32]) -> Self {
        let total: f64 = mass.iter().map(|m| f64::from(*m)).sum();
        if total == 0.0 || mass.len() != SPLIT_BINS {
            return Self::of(|x| x);
        }
        let mut sum = 0.0;
        let mut shares = vec![0.0];
        for m in mass {
            sum += f64::from(*m);
            shares.push((sum / total).min(1.0));
        }
        Self(shares)
    }

    /// Returns two texture rows for shaders: the fractional layer index at each edge of a depth bin, and the depth of
    /// each plane between layers.
    pub fn rows(&self, layers: u32) -> [Vec<f32>; 2] {
        let count = f64::from(layers);
        let coordinates = self.0.iter().map(|s| (s * count) as f32).collect();
        [coordinates, (0..=layers).map(|k| self.plane(f64::from(k) / count) as f32).collect()]
    }

    /// Returns the depth in front of which the given share of the shadow map's layers lies, as a share of their depth
    /// range.
    fn plane(&self, share: f64) -> f64 {
        let bins = SPLIT_BINS as f64;
        if share <= 0.0 {
            let first = self.0.iter().position(|s| *s > 0.0).unwrap_or(1);
            return (first - 1) as f64 / bins;
        }
        let after = self.0.partition_point(|s| *s < share).clamp(1, SPLIT_BINS);
        let (a, b) = (self.0[after - 1], self.0[after]);
        (after as f64 - 1.0 + ((share - a) / (b - a).max(1e-300)).clamp(0.0, 1.0)) / bins
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_are_the_inverse_of_the_table() {
        let table = SplitTable::of(|x| x.sqrt());
        let [coordinates, planes] = table.rows(8);
        assert_eq!((planes.len(), coordinates.len()), (9, SPLIT_BINS + 1));
        for (k, plane) in planes.iter().enumerate() {
            assert!((f64::from(*plane) - (k as f64 / 8.0).powi(2)).abs() < 1e-4, "{k}: {plane}");
        }
        assert_eq!((coordinates[0], coordinates[SPLIT_BINS]), (0.0, 8.0));
    }

    #[test]
    fn mass_is_divided_evenly() {
        // No mass in the first half of the depth range, three times as much in the third quarter as in the last.
        let mass: Vec<u32> = (0..SPLIT_BINS).map(|i| [0, 0, 3, 1][i / (SPLIT_BINS / 4)]).collect();
        let [_, planes] = SplitTable::of_mass(&mass).rows(4);
        let expected = [0.5, 0.5 + 1.0 / 12.0, 0.5 + 2.0 / 12.0, 0.75, 1.0];
        assert!(planes.iter().zip(expected).all(|(p, e)| (p - e as f32).abs() < 1e-6), "{planes:?}");
        assert_eq!(SplitTable::of_mass(&vec![0; SPLIT_BINS]), SplitTable::of(|x| x));
    }
}
