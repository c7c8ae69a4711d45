//! Formulas that give the verdicts on claims of papers: arithmetic on lists of measured numbers.
//!
//! Every value is a list. A list of one number combines with a list of any length; comparisons give 1 or 0.
//! `name[i]` and `name[i:j]` pick entries of a column, `name@1` is the column of a claim's second need.

use super::rules::{self, Holds};
use serde::Deserialize;

/// Formula in a file of a paper's claims, parsed into an expression tree.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(try_from = "String")]
pub enum Formula {
    /// Numeric constant in the formula of a paper's claim.
    Number(f64),
    /// Reference to a list of measured values by name, in the formula of a paper's claim: all of its entries, one, or
    /// a range.
    Name {
        /// Name of the list of measured values: a comparison table column, another quantity, or a variable of the
        /// formula.
        name: String,
        /// Index, from 0, of the method list of the paper's claim whose measured values are meant.
        need: usize,
        /// Index of the first entry to pick from the list of measured values, and the end of the range if there is
        /// one.
        entries: Option<(Box<Formula>, Option<Box<Formula>>)>,
    },
    /// Concatenation of several lists of numbers in the formula of a paper's claim.
    List(Vec<Formula>),
    /// Function or operator in the formula of a paper's claim, with its arguments.
    Call(String, Vec<Formula>),
}

impl Default for Formula {
    fn default() -> Self {
        Self::Number(0.0)
    }
}

impl TryFrom<String> for Formula {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        Self::parse(&text)
    }
}

/// Function that supplies measured values to a formula, by name, index of the claim's method list, and range of
/// entries. Without a range it returns all entries.
pub type Lookup<'a> = dyn Fn(&str, usize, Option<(usize, usize)>) -> Result<Vec<f64>, String> + 'a;

/// Operators in the formulas of papers' claims, from lowest to highest precedence. All are left-associative.
const LEVELS: [&[&str]; 5] = [&["||"], &["&&"], &["<=", ">=", "==", "<", ">"], &["+", "-"], &["*", "/"]];

impl Formula {
    /// Parses a formula in a file of a paper's claims.
    ///
    /// # Errors
    /// The text is not a valid formula; the error states where parsing stopped.
    pub fn parse(text: &str) -> Result<Self, String> {
        let mut rest = text;
        let formula = Self::level(&mut rest, 0)?;
        if rest.trim().is_empty() { Ok(formula) } else { Err(format!("unexpected `{}`", rest.trim())) }
    }

    fn level(rest: &mut &str, level: usize) -> Result<Self, String> {
        let Some(operators) = LEVELS.get(level) else { return Self::atom(rest) };
        let mut left = Self::level(rest, level + 1)?;
        while let Some(operator) = operators.iter().find(|o| take(rest, o)) {
            let right = Self::level(rest, level + 1)?;
            left = Self::Call((*operator).into(), vec![left, right]);
        }
        Ok(left)
    }

    fn atom(rest: &mut &str) -> Result<Self, String> {
        if take(rest, "-") {
            return Ok(Self::Call("neg".into(), vec![Self::atom(rest)?]));
        }
        if take(rest, "(") {
            let inner = Self::level(rest, 0)?;
            return if take(rest, ")") { Ok(inner) } else { Err(format!("expected `)` before `{rest}`")) };
        }
        if take(rest, "[") {
            return Self::arguments(rest, "]").map(Self::List);
        }
        let word = |c: char| c.is_alphanumeric() || "_.".contains(c);
        let end = rest.find(|c| !word(c)).unwrap_or(rest.len());
        let (name, tail) = rest.split_at(end);
        *rest = tail;
        if name.is_empty() {
            return Err(format!("expected a number or a name before `{rest}`"));
        }
        if let Ok(number) = name.parse() {
            return Ok(Self::Number(number));
        }
        if take(rest, "(") {
            return Ok(Self::Call(name.into(), Self::arguments(rest, ")")?));
        }
        let mut need = 0;
        if take(rest, "@") {
            let end = rest.find(|c: char| !c.is_ascii_digit()).unwrap_or(rest.len());
            need = rest[..end].parse().map_err(|_| format!("expected a number after `{name}@`"))?;
            *rest = &rest[end..];
        }
        let mut entries = None;
        if take(rest, "[") {
            let first = Box::new(Self::level(rest, 0)?);
            let end = if take(rest, ":") { Some(Box::new(Self::level(rest, 0)?)) } else { None };
            entries = Some((first, end));
            if !take(rest, "]") {
                return Err(format!("expected `]` before `{rest}`"));
            }
        }
        Ok(Self::Name { name: name.into(), need, entries })
    }

    fn arguments(rest: &mut &str, close: &str) -> Result<Vec<Self>, String> {
        let mut list = Vec::new();
        while !take(rest, close) {
            list.push(Self::level(rest, 0)?);
            if !take(rest, ",") && !rest.trim_start().starts_with(close) {
                return Err(format!("expected `,` or `{close}` before `{rest}`"));
            }
        }
        Ok(list)
    }

    /// Evaluates the formula of a paper's claim to a list of numbers. `lookup` supplies the measured values.
    ///
    /// # Errors
    /// `lookup` does not know a name, a function is unknown, or lists differ in length.
    pub fn list(&self, lookup: &Lookup) -> Result<Vec<f64>, String> {
        match self {
            Self::Number(x) => Ok(vec![*x]),
            Self::List(items) => {
                Ok(items.iter().map(|i| i.list(lookup)).collect::<Result<Vec<_>, _>>()?.concat())
            }
            Self::Name { name, need, entries } => {
                let place = |f: &Self| f.number(lookup).map(|x| x as usize);
                let range = match entries {
                    None => None,
                    Some((first, None)) => Some(place(first)?).map(|i| (i, i + 1)),
                    Some((first, Some(end))) => Some((place(first)?, place(end)?)),
                };
                lookup(name, *need, range)
            }
            // Only the branch taken is evaluated; the other may need values that were not measured.
            Self::Call(name, arguments) if name == "if" && arguments.len() == 3 => {
                let taken = if arguments[0].number(lookup)? != 0.0 { 1 } else { 2 };
                arguments[taken].list(lookup)
            }
            Self::Call(name, arguments) => {
                let lists = arguments.iter().map(|a| a.list(lookup)).collect::<Result<Vec<_>, _>>()?;
                apply(name, &lists)
            }
        }
    }

    /// Evaluates the formula of a paper's claim to a single number.
    ///
    /// # Errors
    /// The errors of [`Self::list`], or the list does not have exactly one entry.
    pub fn number(&self, lookup: &Lookup) -> Result<f64, String> {
        match *self.list(lookup)? {
            [x] => Ok(x),
            ref list => Err(format!("a list of {} where one number is wanted", list.len())),
        }
    }

    /// Calls `visit` for every name of measured values in the formula, with the index of the method list that it
    /// refers to.
    pub fn names(&self, visit: &mut dyn FnMut(&str, usize)) {
        match self {
            Self::Number(_) => {}
            Self::List(items) | Self::Call(_, items) => items.iter().for_each(|i| i.names(visit)),
            Self::Name { name, need, entries } => {
                visit(name, *need);
                if let Some((first, end)) = entries {
                    first.names(visit);
                    end.iter().for_each(|end| end.names(visit));
                }
            }
        }
    }
}

/// Removes a symbol from the start of the formula text. Returns whether the symbol was there.
fn take(rest: &mut &str, symbol: &str) -> bool {
    let trimmed = rest.trim_start();
    let after = trimmed.strip_prefix(symbol);
    *rest = after.map_or(trimmed, str::trim_start);
    after.is_some()
}

fn holds(verdict: Holds) -> Vec<f64> {
    vec![f64::from(verdict as u8)]
}

/// Converts the result of a formula to a verdict on the paper's claim: 0 is no, 1 is partly, 2 is yes.
pub fn verdict(number: f64) -> Result<Holds, String> {
    [Holds::No, Holds::Partly, Holds::Yes]
        .into_iter()
        .find(|h| f64::from(*h as u8) == number)
        .ok_or_else(|| format!("{number} is no verdict"))
}

fn apply(name: &str, lists: &[Vec<f64>]) -> Result<Vec<f64>, String> {
    let each = |f: fn(f64, f64) -> f64| -> Result<Vec<f64>, String> {
        let [a, b] = lists else { return Err(format!("{name} takes two values")) };
        let n = a.len().max(b.len());
        let fits = |l: &Vec<f64>| l.len() == n || l.len() == 1;
        if !fits(a) || !fits(b) {
            return Err(format!("{name}: lists of {} and {}", a.len(), b.len()));
        }
        Ok((0..n).map(|i| f(a[i % a.len()], b[i % b.len()])).collect())
    };
    let all = || lists.iter().flatten().copied();
    let points = |xs: &[f64], ys: &[f64]| xs.iter().copied().zip(ys.iter().copied()).collect::<Vec<_>>();
    let line = |of: fn(rules::Line) -> f64| match lists {
        [xs, ys] => rules::line(&points(xs, ys)).map(|l| vec![of(l)]).ok_or("no line fits".to_owned()),
        _ => Err(format!("{name} takes two lists")),
    };
    match (name, lists) {
        ("+", _) => each(|a, b| a + b),
        ("-", _) => each(|a, b| a - b),
        ("*", _) => each(|a, b| a * b),
        ("/", _) => each(|a, b| a / b),
        ("<", _) => each(|a, b| f64::from(u8::from(a < b))),
        (">", _) => each(|a, b| f64::from(u8::from(a > b))),
        ("<=", _) => each(|a, b| f64::from(u8::from(a <= b))),
        (">=", _) => each(|a, b| f64::from(u8::from(a >= b))),
        ("==", _) => each(|a, b| f64::from(u8::from(a == b))),
        ("&&", _) => each(f64::min),
        ("||", _) => each(f64::max),
        ("neg", [a]) => Ok(a.iter().map(|x| -x).collect()),
        ("abs", [a]) => Ok(a.iter().map(|x| x.abs()).collect()),
        ("ln", [a]) => Ok(a.iter().map(|x| x.ln()).collect()),
        ("count", [a]) => Ok(vec![a.iter().filter(|x| **x != 0.0).count() as f64]),
        ("min", _) => Ok(vec![all().fold(f64::INFINITY, f64::min)]),
        ("max", _) => Ok(vec![all().fold(f64::NEG_INFINITY, f64::max)]),
        ("argmin", [a]) => {
            let least = (0..a.len()).min_by(|i, j| a[*i].total_cmp(&a[*j]));
            least.map(|i| vec![i as f64]).ok_or("argmin of an empty list".into())
        }
        // Index of the first nonzero entry, or the number of entries.
        ("first", [a]) => Ok(vec![a.iter().position(|x| *x != 0.0).unwrap_or(a.len()) as f64]),
        ("exponent", [xs, ys]) => {
            rules::exponent(&points(xs, ys)).map(|p| vec![p]).ok_or("no power fits".into())
        }
        ("line_start", _) => line(|l| l.start),
        ("line_slope", _) => line(|l| l.slope),
        ("line_residual", _) => line(|l| l.residual),
        ("verdict", [yes, partly]) => Ok(holds(Holds::of(yes[0] != 0.0, partly[0] != 0.0))),
        ("at_least", [ratio, wanted]) => Ok(holds(rules::at_least(ratio[0], wanted[0]))),
        ("at_most", [ratio, limit, most]) => Ok(holds(rules::at_most(ratio[0], limit[0], most[0]))),
        ("if_large", [of, errors]) => Ok(holds(rules::if_large(verdict(of[0])?, errors))),
        ("as_good", [error, other, most]) => Ok(holds(rules::as_good(error[0], other[0], most[0]))),
        ("within", [ratio, low, high]) => Ok(holds(rules::within(ratio[0], [low[0], high[0]]))),
        ("rises", [series, least]) => Ok(holds(rules::rises(series, least[0]))),
        ("falls", [series, least]) => Ok(holds(rules::falls(series, least[0]))),
        ("beside", [measured, claimed, near]) => Ok(holds(rules::beside(measured, claimed, near[0]))),
        // `Yes` if every case holds, `No` if none does, else `Partly`.
        ("each", [cases]) => {
            Ok(holds(Holds::all(cases.iter().map(|c| Holds::of(*c != 0.0, false)).collect::<Vec<_>>())))
        }
        ("all", _) => Ok(holds(Holds::all(all().map(verdict).collect::<Result<Vec<_>, _>>()?))),
        _ => Err(format!("there is no function `{name}` of {} arguments", lists.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn value(text: &str) -> Result<Vec<f64>, String> {
        let column = [4.0, 2.0, 8.0];
        let lookup = |name: &str, need: usize, range: Option<(usize, usize)>| match name {
            "a" => column
                .get(range.map_or(0..3, |(i, j)| i..j))
                .map(|l| l.iter().map(|x| x + need as f64).collect())
                .ok_or("a has 3 entries".into()),
            _ => Err(format!("no {name}")),
        };
        Formula::parse(text)?.list(&lookup)
    }

    #[test]
    fn formulas_evaluate() {
        for (text, expected) in [
            ("1 + 2 * 3 - 4 / 2", vec![5.0]),
            ("(1 + 2) * -3", vec![-9.0]),
            ("8 / 2 / 2", vec![2.0]),
            ("a", vec![4.0, 2.0, 8.0]),
            ("a[1:3] / a[1]", vec![1.0, 4.0]),
            ("a@2[0]", vec![6.0]),
            ("a[argmin(a)]", vec![2.0]),
            ("[a[0], 0.5, a[1:2]]", vec![4.0, 0.5, 2.0]),
            ("first(a >= 8)", vec![2.0]),
            ("first(a >= 9)", vec![3.0]),
            ("a[0] > 3 && a[1] > 3 || 0", vec![0.0]),
            ("if(a[0] > 3, a[1], missing)", vec![2.0]),
            ("min(a, 3) + max(a)", vec![10.0]),
            ("verdict(a[0] > 5, a[0] > 3)", vec![1.0]),
            ("at_least(a[2] / a[0], 2)", vec![2.0]),
            ("as_good(a[2], a[0], 2)", vec![1.0]),
            ("if_large(at_least(a[2] / a[0], 2), a / 1000)", vec![2.0]),
            ("if_large(at_least(a[2] / a[0], 2), a / 2000)", vec![1.0]),
            ("all(2, 0)", vec![1.0]),
            ("each(a >= 2)", vec![2.0]),
            ("exponent([1, 2, 4], [1, 4, 16])", vec![2.0]),
        ] {
            let found = value(text).unwrap();
            assert!(
                found.len() == expected.len()
                    && found.iter().zip(&expected).all(|(a, b)| (a - b).abs() < 1e-12),
                "{text}: {found:?}"
            );
        }
    }

    #[test]
    fn faults_are_errors() {
        for text in [
            "",
            "1 +",
            "(1",
            "[1, 2",
            "a[0",
            "1 2",
            "f(1)",
            "missing",
            "a[5]",
            "a + [1, 2]",
            "a@x",
            "at_least(1)",
            "if_large(3, a)",
        ] {
            assert!(value(text).is_err(), "{text}");
        }
        assert!(verdict(3.0).is_err() && verdict(1.0) == Ok(Holds::Partly));
    }
}
