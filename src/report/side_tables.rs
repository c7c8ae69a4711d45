//! The columns of all tables but `compare.csv`: name, unit, and what it is.

/// A table beside the comparison.
pub struct SideTable {
    /// Its file.
    pub file: &'static str,
    /// Description of the table's rows and of the command that writes it.
    pub about: &'static str,
    /// Name, unit and meaning of each column, in order.
    pub columns: &'static [[&'static str; 3]],
}

/// Every one that a command writes.
pub const SIDE_TABLES: &[SideTable] = &[
    SideTable {
        file: "ablation.csv",
        about: "One row for each method and thing that its plan left out (`compare --ablate`).",
        columns: ABLATION,
    },
    SideTable {
        file: "budgets.csv",
        about: "One row for each scene, budget, error and method that has a row within the budget (`compare --budget`).",
        columns: BUDGETS,
    },
    SideTable {
        file: "trials.csv",
        about: "One row for each setting that a search within budgets tried (`compare --budget`).",
        columns: TRIALS,
    },
    SideTable {
        file: "stability.csv",
        about: "One row for each case and method (`stability`).",
        columns: STABILITY,
    },
    SideTable {
        file: "claims.csv",
        about: "One row for each claim of a paper and scene that it was tried on (`claims`).",
        columns: CLAIMS,
    },
];

const ABLATION: &[[&str; 3]] = &[
    ["scene", "", "As in `compare.csv`."],
    ["adapter", "", "As in `compare.csv`."],
    ["clock", "", "Whose clock build and frame are from; tables are made by the host."],
    ["method", "", "As in `compare.csv`."],
    ["params", "", "As in `compare.csv`."],
    ["omission", "", "Name for `--no-skip`; empty where the whole method failed."],
    ["what", "", "What the plan left out."],
    ["why", "", "Why it could."],
    ["tables_ms", "ms", "Time to make tables and classes of bricks, as the plan has it, median."],
    ["tables_ms_forced", "ms", "The same with the work forced back on."],
    ["build_ms", "ms", "Time to make the shadow structure."],
    ["build_ms_forced", "ms", "The same with the work forced back on."],
    ["frame_ms", "ms", "Time of one picture with the structure made."],
    ["frame_ms_forced", "ms", "The same with the work forced back on."],
    ["bytes", "", "Memory of shadow structure, tables and bricks, in bytes."],
    ["bytes_forced", "", "The same with the work forced back on."],
    ["picture_difference", "", "Largest difference of a channel between the two pictures, linear."],
    ["note", "", "Why a figure is missing."],
];

const BUDGETS: &[[&str; 3]] = &[
    ["scene", "", "As in `compare.csv`."],
    ["adapter", "", "As in `compare.csv`."],
    ["budget", "", "As `--budget` takes it: `bytes=2MiB`, `ms=50`."],
    ["by", "", "The column that is to be least: `point_err_rms` or `image_rmse`."],
    ["rank", "", "1 for the closest method."],
    ["method", "", "As in `compare.csv`."],
    ["params", "", "Settings of the method's closest row."],
    ["map", "", "As in `compare.csv`."],
    ["tuned", "", "Whether a search chose the row."],
    ["bytes", "", "As in `compare.csv`."],
    ["build_ms", "ms", "As in `compare.csv`."],
    ["frame_ms", "ms", "As in `compare.csv`."],
    ["point_err_rms", "", "As in `compare.csv`."],
    ["image_rmse", "", "As in `compare.csv`."],
];

const TRIALS: &[[&str; 3]] = &[
    ["scene", "", "As in `compare.csv`."],
    ["adapter", "", "As in `compare.csv`."],
    ["method", "", "As in `compare.csv`."],
    ["params", "", "As in `compare.csv`."],
    ["map", "", "As in `compare.csv`."],
    ["bytes", "", "As in `compare.csv`."],
    [
        "build_ms",
        "ms",
        "Time to make the shadow structure, the slower of two runs; empty where no budget is of time.",
    ],
    ["frame_ms", "ms", "Time of one picture, the slower of two runs; empty where no budget is of time."],
    ["point_err_rms", "", "As in `compare.csv`; empty where no budget holds the setting."],
    ["image_rmse", "", "As in `compare.csv`; empty where no budget holds the setting."],
    ["tuned_for", "", "The budgets and errors that the setting was chosen for."],
    ["note", "", "Why it failed."],
];

const STABILITY: &[[&str; 3]] = &[
    ["case", "", "Name of the case."],
    ["method", "", "Shadow method."],
    ["params", "", "Its settings as `key=value` texts separated by spaces."],
    [
        "status",
        "",
        "`ok`, or the worst that is wrong: `bound_exceeded`, `not_monotone`, `out_of_range`, `nan`, `failed`.",
    ],
    ["ray_err_max", "", "Largest `|T_method - T_exact|` along light rays, of the worst light."],
    [
        "bound",
        "",
        "What the method promises of it, but for its tolerance in depth; empty where nothing is promised.",
    ],
    ["monotone_violations", "", "Depths at which transmittance rises, of all lights."],
    ["out_of_range", "", "Finite values outside 0 to 1, of all lights."],
    ["non_finite", "", "Values that are no numbers, of all lights."],
    ["build_ms", "ms", "Time to make the shadow structure, of the slowest light."],
    ["bytes", "", "Memory of the shadow structure, in bytes."],
    ["note", "", "What is wrong, and what costs much more than ordinarily."],
];

const CLAIMS: &[[&str; 3]] = &[
    ["paper", "", "As cited."],
    ["where", "", "Section, table or figure."],
    ["claim", "", "What the paper states."],
    ["claimed", "", "Its figure or comparison."],
    ["measured", "", "What was measured, the telling figure first."],
    ["holds", "", "`yes`, `partly`, `no`, or empty where it was not tried."],
    ["scene", "", "On what."],
    ["note", "", "By which rule it holds or not, and remarks."],
];
