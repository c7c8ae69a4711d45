//! 3D Slicer's volume properties: `.vp`, nine lines of text (its developer guide, *Volume rendering*, names them), and
//! `.vp.json`, which also says over what length opacities are.
//!
//! The lines of a `.vp`: interpolation, shading, diffuse, ambient, specular, specular power, then scalar opacity, gradient
//! opacity and colour, each a count of numbers and the numbers: value and opacity, or value and red, green, blue.

use super::carried::{Carried, Parts, colors, opacities};
use super::curve::{Node, Ways, linear};
use super::numbers::{self, Object};
use serde_json::Value;

/// Whether a JSON value is a volume property.
pub fn is_json(value: &Value) -> bool {
    value.as_object().is_some_and(|map| map.contains_key("volumeProperties"))
}

/// Whether a text is a `.vp`: its first lines are numbers.
pub fn is_vp(text: &str) -> bool {
    let mut lines = text.lines().take(7).map(|line| first_number(line).is_some());
    lines.clone().count() == 7 && lines.all(|is_number| is_number)
}

fn first_number(line: &str) -> Option<f64> {
    line.split_whitespace().next()?.parse().ok()
}

/// Reads a `.vp`.
///
/// # Errors
/// A line is missing, or has fewer numbers than it says.
pub fn read_vp(text: &str) -> Result<Carried, String> {
    let lines: Vec<&str> = text.lines().collect();
    let single = |line: usize, what: &str| {
        let number = lines.get(line).and_then(|l| first_number(l)).filter(|x| x.is_finite());
        number.ok_or_else(|| format!("line {} is not a number, the {what}", line + 1))
    };
    let mut warnings = Vec::new();
    let interpolation = ["nearest", "linear", "cubic"];
    let kind = single(0, "interpolation")?;
    say_interpolation(interpolation.get(kind as usize).copied().unwrap_or("unknown"), &mut warnings);
    let shade = single(1, "shading")?;
    let [diffuse, ambient, specular, power] =
        [single(2, "diffuse")?, single(3, "ambient")?, single(4, "specular")?, single(5, "specular power")?];
    if shade != 0.0 {
        say_shading([diffuse, ambient, specular, power], &mut warnings);
    }
    let opacity = points::<2>(&lines, 6, "scalar opacity")?;
    let opacity = opacity.iter().map(|[v, o]| Node::straight(*v, [*o])).collect();
    let opacity = opacities(opacity, &mut warnings)?;
    let gradient = points::<2>(&lines, 7, "gradient opacity")?;
    say_gradient(gradient.iter().map(|p| p[1]), &mut warnings);
    let color = points::<4>(&lines, 8, "colour")?;
    let color = color.iter().map(|[v, r, g, b]| Node::straight(*v, [*r, *g, *b])).collect();
    let color = colors(color, linear, Ways::default(), &mut warnings)?;
    warnings.push(numbers::per_mm("the format"));
    let parts = Parts { name: String::new(), units: "", opacity, color, reference_length_mm: 1.0, warnings };
    parts.carry("vp")
}

/// The points of a line: a count of numbers, then the numbers; what follows behind them is a remark.
fn points<const N: usize>(lines: &[&str], line: usize, what: &str) -> Result<Vec<[f64; N]>, String> {
    let place = || format!("line {}, the {what}", line + 1);
    let mut words = lines.get(line).ok_or_else(|| format!("{} is missing", place()))?.split_whitespace();
    let count = words.next().and_then(|word| word.parse::<usize>().ok());
    let count = count.ok_or_else(|| format!("{}, does not begin with a count", place()))?;
    let mut numbers = Vec::new();
    for word in words.take(count) {
        let number = word.parse::<f64>().ok().filter(|x| x.is_finite());
        numbers.push(number.ok_or_else(|| format!("{}: `{word}` is not a number", place()))?);
    }
    if numbers.len() < count {
        return Err(format!("{}: {count} numbers are announced, {} are there", place(), numbers.len()));
    }
    numbers::groups(&numbers, what)
}

fn say_interpolation(name: &str, warnings: &mut Vec<String>) {
    if name != "linear" {
        warnings.push(format!("`{name}` interpolation of voxels was left out: values are trilinear here"));
    }
}

fn say_shading([diffuse, ambient, specular, power]: [f64; 4], warnings: &mut Vec<String>) {
    warnings.push(format!(
        "shading was left out (diffuse {diffuse}, ambient {ambient}, specular {specular}, power {power}): here it is the \
         scene's, --shading blinn-phong and --ambient"
    ));
}

fn say_gradient(mut opacities: impl Iterator<Item = f64>, warnings: &mut Vec<String>) {
    if opacities.any(|o| o != 1.0) {
        warnings.push(
            "gradient opacity was left out: what is uniform is denser here than there, next to its surfaces"
                .into(),
        );
    }
}

/// Reads a `.vp.json`.
///
/// # Errors
/// Something is missing or no number.
pub fn read_json(value: &Value) -> Result<Carried, String> {
    fn first<'a>(of: Option<&'a Value>, what: &str) -> Result<(&'a Object, usize), String> {
        let all = of.and_then(Value::as_array).ok_or_else(|| format!("`{what}` is missing"))?;
        let object = all.first().and_then(Value::as_object);
        object.map(|o| (o, all.len())).ok_or_else(|| format!("`{what}` is empty"))
    }
    let mut warnings = Vec::new();
    let (property, properties) = first(value.get("volumeProperties"), "volumeProperties")?;
    let (component, components) = first(property.get("components"), "components")?;
    for (what, count) in [("volume properties", properties), ("components", components)] {
        if count > 1 {
            warnings.push(format!("it holds {count} {what}: the first one was taken"));
        }
    }
    let interpolation = property.get("interpolationType").and_then(Value::as_str).unwrap_or("linear");
    say_interpolation(interpolation, &mut warnings);
    if numbers::is_set(component, "shade")
        && let Some(lighting) = component.get("lighting").and_then(Value::as_object)
    {
        let lit = |key: &str| numbers::one(lighting, key).map(|x| x.unwrap_or(f64::NAN));
        let lit = [lit("diffuse")?, lit("ambient")?, lit("specular")?, lit("specularPower")?];
        say_shading(lit, &mut warnings);
    }
    let reference_length_mm = numbers::unit_distance(component, "scalarOpacityUnitDistance", &mut warnings)?;
    let nodes = function(component, "scalarOpacity")?.ok_or("`scalarOpacity` is missing")?;
    let opacity = nodes.iter().map(|point| node(point, [number(point, "y")?])).collect::<Result<_, _>>()?;
    let opacity = opacities(opacity, &mut warnings)?;
    if opacity.is_bent() {
        warnings.push("midpoints and sharpness of opacities became points on their curve".into());
    }
    if !numbers::is_set(component, "disableGradientOpacity") {
        let nodes = function(component, "gradientOpacity")?.unwrap_or_default();
        let all = nodes.iter().map(|point| number(point, "y")).collect::<Result<Vec<_>, _>>()?;
        say_gradient(all.into_iter(), &mut warnings);
    }
    let nodes = function(component, "rgbTransferFunction")?.ok_or("`rgbTransferFunction` is missing")?;
    let color = nodes.iter().map(|point| node(point, color(point)?)).collect::<Result<_, _>>()?;
    let color = colors(color, linear, Ways { may_be_steps: true, ..Ways::default() }, &mut warnings)?;
    Parts { name: String::new(), units: "", opacity, color, reference_length_mm, warnings }.carry("vp.json")
}

/// The points of a function, where there is one.
fn function<'a>(component: &'a Object, key: &str) -> Result<Option<Vec<&'a Object>>, String> {
    let Some(function) = component.get(key) else { return Ok(None) };
    let points = function.get("points").and_then(Value::as_array);
    let points = points.map(|all| all.iter().map(Value::as_object).collect::<Option<Vec<_>>>());
    points.flatten().map(Some).ok_or_else(|| format!("`{key}` has no `points`"))
}

fn number(point: &Object, key: &str) -> Result<f64, String> {
    numbers::one(point, key)?.ok_or_else(|| format!("a point has no `{key}`"))
}

fn color(point: &Object) -> Result<[f64; 3], String> {
    let color = numbers::list(point, "color")?.and_then(|c| <[f64; 3]>::try_from(c).ok());
    color.ok_or_else(|| "a point's `color` is not three numbers".into())
}

fn node<const N: usize>(point: &Object, amounts: [f64; N]) -> Result<Node<N>, String> {
    let (midpoint, sharpness) = (numbers::one(point, "midpoint")?, numbers::one(point, "sharpness")?);
    Ok(Node {
        value: number(point, "x")?,
        amounts,
        midpoint: midpoint.unwrap_or(0.5),
        sharpness: sharpness.unwrap_or(0.0),
    })
}
