// Sums of many terms in two levels: each term is added to a partial sum of a few terms, which limits rounding errors.
#define_import_path umbravox::sums

#ifdef RAY_STATES
#import umbravox::ray_state::{put_word, put_float, take_word, take_float}
#endif

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

#ifdef RAY_STATES
// Stores a sum of a ray that waits: four words.
fn put_sum(sum: Sum) {
    put_float(sum.total);
    put_float(sum.complete);
    put_float(sum.partial);
    put_word(sum.terms);
}

fn take_sum() -> Sum {
    let total = take_float();
    let complete = take_float();
    let partial = take_float();
    return Sum(total, complete, partial, take_word());
}
#endif
