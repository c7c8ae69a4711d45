// Moments kept as 32-bit floats: the filter's mean of them.
#define_import_path umbravox::moment_vectors

#import umbravox::vectors::VECTORS
#import umbravox::vectors_read::{Place, vector_of}

struct Moments {
    // Optical depth, then the moments times it, one after another.
    first: vec4<f32>,
    second: vec4<f32>,
    third: vec4<f32>,
}

fn moments_of(place: Place) -> Moments {
    var third = vec4<f32>(0.0);
    if VECTORS > 2u { third = vector_of(place, 2u); }
    return Moments(vector_of(place, 0u), vector_of(place, 1u), third);
}
