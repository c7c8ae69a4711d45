// Sums of many terms in two levels: each term is added to a partial sum of a few terms, which limits rounding errors.
#define_import_path umbravox::sums

// Number of terms of a partial sum; a power of two.
const TERMS: u32 = #{PARTS_OF_SUM};

struct Sum {
    total: f32,
    // Sum of all complete partial sums, the present partial sum, and its number of terms.
    complete: f32,
    partial: f32,
    terms: u32,
}

fn empty_sum() -> Sum {
    return Sum(0.0, 0.0, 0.0, 0u);
}

// Returns the sum with one more term.
fn add_term(sum: Sum, x: f32) -> Sum {
    let partial = sum.partial + x;
    let total = sum.complete + partial;
    let terms = sum.terms + 1u;
    let full = (terms & (TERMS - 1u)) == 0u;
    return Sum(total, select(sum.complete, total, full), select(partial, 0.0, full), terms);
}
