//! Cost of a shadow method on the horizontal axis of the error plots: time or memory.

use crate::measure::table::Row;

/// Cost of a shadow method that an error plot shows on its horizontal axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Cost {
    /// Time to build the shadow map and draw one picture, `build_ms + frame_ms`, ms.
    Time,
    /// Memory of the shadow map, MiB. Shadow methods that store no shadow map are not drawn, since the axis is
    /// logarithmic.
    Memory,
}

impl Cost {
    pub fn name(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::Memory => "memory",
        }
    }

    pub fn axis_title(self) -> &'static str {
        match self {
            Self::Time => "shadow build + frame, median [ms]",
            Self::Memory => "memory of the shadow structure [MiB]",
        }
    }

    /// Median, smallest and largest cost of a comparison-table row: time in ms or memory in MiB. Returns `None` if
    /// the cost is unknown or not positive.
    pub fn of(self, row: &Row) -> Option<[f64; 3]> {
        let positive = |x: f64| x.is_finite() && x > 0.0;
        if self == Self::Memory {
            return row.bytes.map(|b| [b as f64 / f64::from(1 << 20); 3]).filter(|[mib, ..]| positive(*mib));
        }
        let ms = row.moving_ms().filter(|ms| positive(*ms))?;
        let extreme = |build: Option<f64>, frame: Option<f64>| {
            frame.map(|f| f + build.unwrap_or(0.0)).filter(|ms| positive(*ms)).unwrap_or(ms)
        };
        Some([ms, extreme(row.build_ms_min, row.frame_ms_min), extreme(row.build_ms_max, row.frame_ms_max)])
    }
}
