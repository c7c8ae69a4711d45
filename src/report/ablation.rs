//! Markdown report of an ablation: time and memory with and without each optimization, which skips a rendering step.

use super::tables::escape_markdown;
use crate::measure::ablate::Ablation;

/// Markdown table of an ablation: times and memory of each shadow method without and with one optimization.
pub fn markdown(rows: &[Ablation]) -> String {
    let Some(first) = rows.first() else {
        return "No plan skipped a step that `--no-skip` enables.\n".into();
    };
    let clock = first.clock.unwrap_or_default();
    let mut out = format!(
        "Steps that the plan skipped, and their cost when they are not skipped. Medians on {}, {clock} clock.\n\n\
        | scene | method | skipped | tables ms | build ms | frame ms | MB | picture differs by |\n\
        | --- | --- | --- | ---: | ---: | ---: | ---: | ---: |\n",
        first.adapter
    );
    let pair = |a: Option<f64>, b: Option<f64>, digits: usize| {
        let text = |v: Option<f64>| v.map_or("?".into(), |v| format!("{v:.digits$}"));
        format!("{} → {}", text(a), text(b))
    };
    let megabytes = |bytes: Option<u64>| bytes.map(|b| b as f64 * 1e-6);
    for row in rows {
        let what = match row.omission.as_str() {
            "" => String::new(),
            name => format!("{name}: {} ({})", row.what, row.why),
        };
        out += &format!(
            "| {} | {} | {} | {} | {} | {} | {} | {} |\n",
            escape_markdown(&row.scene),
            escape_markdown([&*row.method, &*row.params].join(" ").trim_end()),
            escape_markdown(&what),
            pair(row.tables_ms, row.tables_ms_forced, 1),
            pair(row.build_ms, row.build_ms_forced, 1),
            pair(row.frame_ms, row.frame_ms_forced, 1),
            pair(megabytes(row.bytes), megabytes(row.bytes_forced), 2),
            row.picture_difference.map_or_else(
                || escape_markdown(&row.note),
                |d| if d == 0.0 { "0".into() } else { format!("{d:.0e}") }
            ),
        );
    }
    out
}
