//! Conversion between sRGB and linear RGB. The program computes in linear RGB; files, flags and PNGs use sRGB.

/// Converts an sRGB-encoded value in `[0, 1]` to linear light (IEC 61966-2-1).
pub fn linear_from_srgb(encoded: f64) -> f64 {
    if encoded <= 0.04045 { encoded / 12.92 } else { ((encoded + 0.055) / 1.055).powf(2.4) }
}

/// Converts linear light to an sRGB-encoded value, clamped to `[0, 1]`.
pub fn srgb_from_linear(linear: f64) -> f64 {
    let x = linear.clamp(0.0, 1.0);
    if x <= 0.003_130_8 { 12.92 * x } else { 1.055 * x.powf(1.0 / 2.4) - 0.055 }
}

/// Converts linear light to the nearest 8-bit sRGB value; NaN gives 0.
pub fn srgb8_from_linear(linear: f64) -> u8 {
    (srgb_from_linear(linear) * 255.0).round() as u8
}

/// Converts an sRGB colour in the form `#rrggbb`, or a colour name of SVG such as `white`, to linear RGB.
///
/// # Errors
/// The text is neither.
pub fn parse(text: &str) -> Result<[f64; 3], String> {
    if let Some(named) = palette::named::from_str(&text.to_ascii_lowercase()) {
        return Ok([named.red, named.green, named.blue].map(|code| linear_from_srgb(f64::from(code) / 255.0)));
    }
    parse_hex(text).map_err(|why| format!("{why} or a name such as white"))
}

/// Converts an sRGB colour in the form `#rrggbb` to linear RGB.
///
/// # Errors
/// The text does not have the form `#rrggbb`.
pub fn parse_hex(text: &str) -> Result<[f64; 3], String> {
    let refuse = || format!("`{text}` is not a colour of the form #rrggbb");
    let digits = text.strip_prefix('#').ok_or_else(refuse)?;
    if digits.len() != 6 || !digits.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(refuse());
    }
    let rgb = u32::from_str_radix(digits, 16).map_err(|_| refuse())?;
    Ok([16, 8, 0].map(|shift| linear_from_srgb(f64::from(rgb >> shift & 0xff) / 255.0)))
}

/// Converts a linear RGB colour to sRGB in the form `#rrggbb`; the inverse of [`parse_hex`].
pub fn to_hex(linear: [f64; 3]) -> String {
    let [r, g, b] = linear.map(srgb8_from_linear);
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_survives_linear_light() {
        for code in 0..=255_u8 {
            assert_eq!(srgb8_from_linear(linear_from_srgb(f64::from(code) / 255.0)), code);
        }
    }

    #[test]
    fn hex_is_srgb() {
        assert_eq!(parse_hex("#ff0000"), Ok([1.0, 0.0, 0.0]));
        // The standard's mid grey: code 188 is 50.3 % of linear light.
        assert!((parse_hex("#bcbcbc").unwrap()[1] - 0.502_886).abs() < 1e-6);
        assert_eq!(to_hex(parse_hex("#d0B090").unwrap()), "#d0b090");
    }

    #[test]
    fn names_are_those_of_svg() {
        assert_eq!((parse("White"), parse("teal")), (parse_hex("#ffffff"), parse_hex("#008080")));
        assert_eq!(parse("#102030"), parse_hex("#102030"));
        assert!(parse("whitish").unwrap_err().contains("#rrggbb or a name"));
    }

    #[test]
    fn other_texts_are_refused() {
        for text in ["", "#", "ff0000", "#ff00", "#ff00000", "#gg0000", "#+f0000", "red", "#ffé00"] {
            assert!(parse_hex(text).unwrap_err().contains("#rrggbb"), "{text}");
        }
    }
}
