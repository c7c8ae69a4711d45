//! Reader of 3D Slicer's volume properties (transfer functions with shading): `.vp`, nine lines of text, and
//! `.vp.json`, which also gives the reference length of opacities.
//!
//! The lines of a `.vp` are: interpolation, shading, diffuse, ambient, specular, specular power, scalar opacity,
//! gradient opacity and colour. Each of the last three is a count of numbers, then the numbers: value and opacity, or
//! value and red, green, blue. 3D Slicer's developer guide, *Volume rendering*, names the lines. Gradients are value units
//! per mean voxel spacing, as in VTK.

use super::curve::{CurveNode, Interpolation};
use super::import::{Foreign, Imported};
use super::json::{self, Object};
use serde_json::Value;

/// Whether a JSON value is a 3D Slicer volume property (`.vp.json` file).
pub fn is_json(value: &Value) -> bool {
    value.get("volumeProperties").is_some()
}

/// Whether a text is a 3D Slicer `.vp` file: its first seven lines begin with numbers.
pub fn is_vp(text: &str) -> bool {
    text.lines().take(7).filter(|line| first_number(line).is_some()).count() == 7
}

fn first_number(line: &str) -> Option<f64> {
    line.split_whitespace().next()?.parse().ok()
}

/// Reads a transfer function from the text of a 3D Slicer `.vp` file.
///
/// # Errors
/// A line is missing, or has fewer numbers than its count says.
pub fn read_vp(text: &str) -> Result<Imported, String> {
    let lines: Vec<&str> = text.lines().collect();
    let single = |line: usize, what: &str| {
        let number = lines.get(line).and_then(|l| first_number(l)).filter(|x| x.is_finite());
        number.ok_or_else(|| format!("line {} is not a number, the {what}", line + 1))
    };
    let mut warnings = Vec::new();
    let kind = single(0, "interpolation")? as usize;
    warn_of_interpolation(["nearest", "linear", "cubic"].get(kind).unwrap_or(&"unknown"), &mut warnings);
    let is_shaded = single(1, "shading")? != 0.0;
    let lighting =
        [single(2, "diffuse")?, single(3, "ambient")?, single(4, "specular")?, single(5, "specular power")?];
    if is_shaded {
        warn_of_shading(lighting, &mut warnings);
    }
    let opacity = points::<2>(&lines, 6, "scalar opacity")?;
    let opacity = opacity.iter().map(|[v, o]| CurveNode::straight(*v, [*o])).collect();
    let gradient = points::<2>(&lines, 7, "gradient opacity")?;
    let gradient = gradient.iter().map(|[g, o]| CurveNode::straight(*g, [*o])).collect();
    let color = points::<4>(&lines, 8, "colour")?;
    let color = color.iter().map(|[v, r, g, b]| CurveNode::straight(*v, [*r, *g, *b])).collect();
    Foreign { warnings, gradient, ..Foreign::new("vp", opacity, color) }.convert()
}

/// Reads the curve points in a line of a 3D Slicer `.vp` file: a count of numbers, then the numbers. Text after them
/// is a comment.
fn points<const N: usize>(lines: &[&str], line: usize, what: &str) -> Result<Vec<[f64; N]>, String> {
    let place = format!("line {}, the {what}", line + 1);
    let mut words = lines.get(line).ok_or_else(|| format!("{place} is missing"))?.split_whitespace();
    let count = words.next().and_then(|word| word.parse::<usize>().ok());
    let count = count.ok_or_else(|| format!("{place}, does not begin with a count"))?;
    let number = |word: &str| {
        let number = word.parse::<f64>().ok().filter(|x| x.is_finite());
        number.ok_or_else(|| format!("{place}: `{word}` is not a number"))
    };
    let numbers = words.take(count).map(number).collect::<Result<Vec<_>, _>>()?;
    if numbers.len() < count {
        return Err(format!("{place}: {count} numbers are announced, {} are there", numbers.len()));
    }
    json::groups(&numbers, what)
}

fn warn_of_interpolation(name: &str, warnings: &mut Vec<String>) {
    if name != "linear" {
        warnings.push(format!("`{name}` interpolation of voxels was skipped: values are trilinear here"));
    }
}

fn warn_of_shading([diffuse, ambient, specular, power]: [f64; 4], warnings: &mut Vec<String>) {
    warnings.push(format!(
        "shading was skipped (diffuse {diffuse}, ambient {ambient}, specular {specular}, power {power}): here it is the \
         scene's, --shading blinn-phong and --ambient"
    ));
}

/// Reads a transfer function from a 3D Slicer `.vp.json` file.
///
/// # Errors
/// A key is missing or no number.
pub fn read_json(value: &Value) -> Result<Imported, String> {
    let mut warnings = Vec::new();
    let mut first = |list: Option<&'_ Value>, key: &str, what: &str| {
        let all = list.and_then(Value::as_array).ok_or_else(|| format!("`{key}` is missing"))?;
        if all.len() > 1 {
            warnings.push(format!("it holds {} {what}: the first one was taken", all.len()));
        }
        all.first().and_then(Value::as_object).cloned().ok_or_else(|| format!("`{key}` is empty"))
    };
    let property = first(value.get("volumeProperties"), "volumeProperties", "volume properties")?;
    let component = &first(property.get("components"), "components", "components")?;
    let interpolation = property.get("interpolationType").and_then(Value::as_str).unwrap_or("linear");
    warn_of_interpolation(interpolation, &mut warnings);
    if json::is_set(component, "shade")
        && let Some(lighting) = component.get("lighting").and_then(Value::as_object)
    {
        let lit = |key: &str| json::number(lighting, key).map(|x| x.unwrap_or(f64::NAN));
        warn_of_shading(
            [lit("diffuse")?, lit("ambient")?, lit("specular")?, lit("specularPower")?],
            &mut warnings,
        );
    }
    let opacity = function(component, "scalarOpacity")?.ok_or("`scalarOpacity` is missing")?;
    let opacity = opacity.iter().map(|point| node(point, [number(point, "y")?])).collect::<Result<_, _>>()?;
    let gradient = match json::is_set(component, "disableGradientOpacity") {
        true => Vec::new(),
        false => function(component, "gradientOpacity")?.unwrap_or_default(),
    };
    let gradient =
        gradient.iter().map(|point| node(point, [number(point, "y")?])).collect::<Result<_, _>>()?;
    let color = function(component, "rgbTransferFunction")?.ok_or("`rgbTransferFunction` is missing")?;
    let rgb = |point: &Object| {
        let color = json::list(point, "color")?.and_then(|c| <[f64; 3]>::try_from(c).ok());
        node(point, color.ok_or("a point's `color` is not three numbers")?)
    };
    let color = color.into_iter().map(rgb).collect::<Result<_, String>>()?;
    let foreign = Foreign {
        color_interpolation: Interpolation { has_steps: true, ..Interpolation::LINEAR },
        gradient,
        reference_length_mm: json::length_mm(component, "scalarOpacityUnitDistance")?,
        warnings,
        ..Foreign::new("vp.json", opacity, color)
    };
    foreign.convert()
}

/// Returns the points of one curve in a 3D Slicer `.vp.json` file, such as the scalar opacity; `None` if the file
/// does not contain it.
fn function<'a>(component: &'a Object, key: &str) -> Result<Option<Vec<&'a Object>>, String> {
    let Some(function) = component.get(key) else { return Ok(None) };
    let points = function.get("points").and_then(Value::as_array);
    let points = points.map(|all| all.iter().map(Value::as_object).collect::<Option<Vec<_>>>());
    points.flatten().map(Some).ok_or_else(|| format!("`{key}` has no `points`"))
}

fn number(point: &Object, key: &str) -> Result<f64, String> {
    json::number(point, key)?.ok_or_else(|| format!("a point has no `{key}`"))
}

fn node<const N: usize>(point: &Object, amounts: [f64; N]) -> Result<CurveNode<N>, String> {
    let [midpoint, sharpness] = [("midpoint", 0.5), ("sharpness", 0.0)]
        .map(|(key, default)| json::number(point, key).map(|x| x.unwrap_or(default)));
    Ok(CurveNode { value: number(point, "x")?, amounts, midpoint: midpoint?, sharpness: sharpness? })
}
