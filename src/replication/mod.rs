//! Replication studies: the quantitative claims of the methods' papers, and the stability suite.

pub mod claims;
pub mod stability;

#[cfg(test)]
mod tests {
    use super::{claims::table::Record, stability};
    use crate::measure::ablate::Ablation;
    use crate::measure::budget::Trial;
    use crate::report::budgets::Ranked;
    use crate::report::side_tables::SIDE_TABLES;
    use crate::report::writers::csv;

    #[test]
    fn columns_are_those_that_are_written() {
        let header = |csv: Vec<u8>| String::from_utf8(csv).unwrap().lines().next().unwrap().to_owned();
        let case = stability::Row::new("case", "dsm", String::new(), stability::Status::Failed);
        let written = [
            ("ablation.csv", csv(&[Ablation::default()])),
            ("budgets.csv", csv(&[Ranked::default()])),
            ("trials.csv", csv(&[Trial::default()])),
            ("stability.csv", csv(&[case])),
            ("claims.csv", csv(&[Record::default()])),
        ];
        assert_eq!(written.len(), SIDE_TABLES.len());
        for ((file, csv), table) in written.into_iter().zip(SIDE_TABLES) {
            let names: Vec<_> = table.columns.iter().map(|[name, ..]| *name).collect();
            assert_eq!((file, header(csv.unwrap())), (table.file, names.join(",")));
        }
    }
}
