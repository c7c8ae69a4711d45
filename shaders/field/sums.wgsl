// Sums of many parts, in two levels, so that a part is rounded beside few others and not beside all that came before.
#define_import_path umbravox::sums

// Parts that are added up by themselves; a power of two.
const PARTS: u32 = #{PARTS_OF_SUM};

struct Sum {
    total: f32,
    // The sum before the parts that are not yet `PARTS`, and theirs.
    whole: f32,
    part: f32,
    parts: u32,
}

fn empty_sum() -> Sum {
    return Sum(0.0, 0.0, 0.0, 0u);
}

// The sum with one more part.
fn with_part(sum: Sum, x: f32) -> Sum {
    let part = sum.part + x;
    let total = sum.whole + part;
    let parts = sum.parts + 1u;
    let full = (parts & (PARTS - 1u)) == 0u;
    return Sum(total, select(sum.whole, total, full), select(part, 0.0, full), parts);
}
