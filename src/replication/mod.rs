//! Replication studies: tests of the quantitative claims in papers on shadow methods, and a stability suite of
//! extreme cases.

pub mod claims;
pub mod stability;

#[cfg(test)]
mod tests {
    use super::{claims, stability};
    use crate::measure::ablate::Ablation;
    use crate::measure::table::COLUMNS;
    use crate::report::side_tables::{SIDE_TABLES, SideTable};
    use crate::report::writers::csv;

    #[test]
    fn columns_are_those_that_are_written() {
        let header = |csv: Vec<u8>| String::from_utf8(csv).unwrap().lines().next().unwrap().to_owned();
        let written = [
            ("ablation.csv", csv(&[Ablation::default()])),
            ("stability.csv", csv(&[stability::Row::default()])),
            ("claims.csv", csv(&[claims::Row::default()])),
        ];
        for (file, csv) in written {
            assert_eq!(header(csv.unwrap()), SideTable::names(file).collect::<Vec<_>>().join(","), "{file}");
        }
        // The other two tables share columns with the comparison table.
        assert_eq!(SIDE_TABLES.len(), 3 + 2);
        for name in SideTable::names("budgets.csv").chain(SideTable::names("trials.csv")) {
            let own = ["budget", "by", "rank", "separated"].contains(&name);
            assert!(own || COLUMNS.iter().any(|c| c.name == name), "{name}");
        }
    }
}
