//! Formats numbers for tables and figures.

/// Formats a number with a given number of significant digits: in decimal notation from 0.001 to 100 000, otherwise
/// as `1.23e-5`.
pub fn significant(x: f64, digits: usize) -> String {
    if x == 0.0 {
        return "0".into();
    }
    if !x.is_finite() {
        return x.to_string();
    }
    // Rounding first puts 9.996 among the numbers with two digits before the point.
    let rounded = format!("{x:.*e}", digits.saturating_sub(1));
    let exponent: i32 = rounded.rsplit('e').next().and_then(|e| e.parse().ok()).unwrap_or(0);
    if !(-3..5).contains(&exponent) {
        return rounded;
    }
    let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
    format!("{x:.decimals$}")
}

/// Returns the text of a number without zeros at the end of its fraction.
pub fn trimmed(number: &str) -> String {
    let (mantissa, exponent) = number.find('e').map_or((number, ""), |at| number.split_at(at));
    let short =
        if mantissa.contains('.') { mantissa.trim_end_matches('0').trim_end_matches('.') } else { mantissa };
    format!("{short}{exponent}")
}

/// Formats a similarity index such as SSIM with enough decimals to show three significant digits of its distance from
/// 1.
pub fn near_one(x: f64) -> String {
    let missing = (1.0 - x).abs();
    if !missing.is_finite() {
        return x.to_string();
    }
    let digits = if missing > 0.0 { (2.0 - missing.log10().floor()).clamp(3.0, 9.0) as usize } else { 3 };
    format!("{x:.digits$}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn similarities_near_one_are_told_apart() {
        let shown = [0.5, 0.9951, 0.999_87, 0.999_861, 1.0, 0.999_999_999_999].map(near_one);
        assert_eq!(shown, ["0.500", "0.99510", "0.999870", "0.999861", "1.000", "1.000000000"]);
    }

    #[test]
    fn numbers_are_trimmed() {
        let shown = ["0.0500", "0.0375", "10.0", "100", "1.00e-6", "0"].map(trimmed);
        assert_eq!(shown, ["0.05", "0.0375", "10", "100", "1e-6", "0"]);
    }

    #[test]
    fn significant_digits() {
        for (x, expected) in [
            (0.0, "0"),
            (12.345, "12.3"),
            (9.996, "10.0"),
            (99_940.0, "99940"),
            (99_960.0, "1.00e5"),
            (123_456.0, "1.23e5"),
            (0.001_234_5, "0.00123"),
            (0.000_999_6, "0.00100"),
            (0.000_123_45, "1.23e-4"),
            (-0.5, "-0.500"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(significant(x, 3), expected, "{x}");
        }
    }
}
