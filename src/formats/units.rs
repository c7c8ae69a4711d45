//! Units of length, as files name them.

/// A unit of length in mm.
pub(super) fn mm_of(unit: &str) -> Option<f64> {
    Some(match unit {
        "mm" | "millimeter" | "millimeters" => 1.0,
        "cm" | "centimeter" => 10.0,
        "decimeter" => 100.0,
        "m" | "meter" => 1000.0,
        "micron" | "microns" | "um" | "µm" | "μm" | "\\u00B5m" | "micrometer" => 1e-3,
        "nm" | "nanometer" => 1e-6,
        "angstrom" => 1e-7,
        "picometer" => 1e-9,
        "inch" | "in" => 25.4,
        "foot" => 304.8,
        _ => return None,
    })
}
