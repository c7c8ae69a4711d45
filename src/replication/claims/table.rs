//! Markdown tables of the tested claims of papers.

use super::Row;
use super::claim::figures_text;
use super::rules::Holds;
use crate::report::markdown::table_line;

/// Scene on which claims of papers were tested, with everything needed to repeat the test.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TriedOn {
    /// Name of the scene, as in the column `scene` of `claims.csv`.
    pub name: String,
    /// Description of the paper's data that a built-in scene replaces, or the file from which the scene was read.
    pub about: String,
    /// Text of the scene file (TOML) on which claims of papers were tested.
    pub toml: String,
}

impl TriedOn {
    /// Returns the scene as a part of `claims.md`.
    pub fn markdown(&self) -> String {
        let Self { name, about, toml } = self;
        format!("**{name}**: {about}\n\n```toml\n{}\n```\n", toml.trim_end())
    }
}

/// Returns a Markdown table that counts the claims of each paper by verdict: those that hold, hold in part, do not
/// hold, or were not tested.
pub fn counts(rows: &[Row]) -> String {
    let mut out =
        String::from("| paper | yes | partly | no | not tried |\n| --- | ---: | ---: | ---: | ---: |\n");
    let verdicts = [Holds::Yes, Holds::Partly, Holds::No, Holds::Untried];
    for paper in papers(rows) {
        let count = |holds| rows.iter().filter(|r| r.paper == paper && r.holds == holds).count();
        out += &table_line([paper.to_owned()].into_iter().chain(verdicts.map(|v| count(v).to_string())));
    }
    out
}

/// Returns the papers in the rows of the table of tested claims, each once, in order.
fn papers(rows: &[Row]) -> Vec<&str> {
    let mut papers: Vec<&str> = rows.iter().map(|r| r.paper.as_str()).collect();
    papers.dedup();
    papers
}

/// Writes `claims.md`, the Markdown report on tested claims of papers: counts of verdicts, one table of claims per
/// paper, and the scenes. `made_by` names the graphics adapter and the program revision.
pub fn markdown(rows: &[Row], scenes: &[TriedOn], made_by: &str) -> String {
    let mut out = format!("# Claims of the papers, tried\n{made_by}\n\n{}", counts(rows));
    for paper in papers(rows) {
        out += &format!(
            "\n## {paper}\n| where | claim | claimed | measured | holds | scene | note |\n\
            | --- | --- | --- | --- | --- | --- | --- |\n"
        );
        for row in rows.iter().filter(|r| r.paper == paper) {
            let Row { place, claim, claimed, measured, holds, scene, note, .. } = row.clone();
            let cells = [place, claim, claimed, figures_text(&measured), holds.word().into(), scene, note];
            out += &table_line(cells);
        }
    }
    if !scenes.is_empty() {
        out += "\n## Scenes\n";
    }
    for scene in scenes {
        out += &(scene.markdown() + "\n");
    }
    out.trim_end().to_owned() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::report::writers::csv;

    fn rows() -> Vec<Row> {
        let row = |paper: &str, holds| Row {
            paper: paper.into(),
            place: "Table 1".into(),
            claim: "a | b, \"c\"".into(),
            claimed: "1 to 3".into(),
            measured: vec![("ratio".into(), 2.0 / 3.0), ("bytes".into(), 1.5e6)],
            holds,
            scene: "fur".into(),
            note: "Yes from 2 on.".into(),
        };
        let untried = Row { measured: Vec::new(), scene: String::new(), ..row("Voicu 2011", Holds::Untried) };
        vec![row("Kim and Neumann 2001", Holds::Partly), row("Voicu 2011", Holds::No), untried]
    }

    #[test]
    fn csv_has_the_columns_of_the_contract() {
        let text = String::from_utf8(csv(&rows()).unwrap()).unwrap();
        let again: Vec<Row> =
            csv::Reader::from_reader(text.as_bytes()).deserialize().map(|r| r.unwrap()).collect();
        assert_eq!((csv(&again).unwrap(), again[0].holds), (text.clone().into_bytes(), Holds::Partly));
        let mut reader = csv::Reader::from_reader(text.as_bytes());
        let columns = "paper,where,claim,claimed,measured,holds,scene,note";
        assert_eq!(reader.headers().unwrap().iter().collect::<Vec<_>>().join(","), columns);
        let read: Vec<Vec<String>> = reader.deserialize().map(|r| r.unwrap()).collect();
        assert_eq!(read[0][2..6], ["a | b, \"c\"", "1 to 3", "ratio: 0.667; bytes: 1.50e6", "partly"]);
        assert_eq!((read[1][5].as_str(), read[2][5].as_str(), read[2][4].as_str()), ("no", "", ""));
    }

    #[test]
    fn the_page_counts_and_has_a_table_a_paper() {
        let scene = TriedOn { name: "fur".into(), about: "grass".into(), toml: "tf = \"hair\"\n".into() };
        let text = markdown(&rows(), &[scene], "llvmpipe, revision 1");
        assert!(text.contains("| Voicu 2011 | 0 | 0 | 1 | 1 |"), "{text}");
        assert!(text.contains("| Kim and Neumann 2001 | 0 | 1 | 0 | 0 |"));
        assert_eq!(text.matches("\n## ").count(), 3);
        let cells = |l: &str| l.replace("\\|", "").matches('|').count();
        assert!(text.lines().filter(|l| l.starts_with("| Table 1")).all(|l| cells(l) == 8), "{text}");
        assert!(text.contains("```toml\ntf = \"hair\"\n```\n") && text.ends_with("```\n"));
    }
}
