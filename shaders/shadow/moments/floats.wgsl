// Reads filtered moments that are stored as 32-bit floats.
#define_import_path umbravox::moment_vectors

#import umbravox::vectors::VECTORS
#import umbravox::vectors_read::filtered_vector

struct Moments {
    // Optical depth (or absorbed light), then each moment times it.
    first: vec4<f32>,
    second: vec4<f32>,
    third: vec4<f32>,
}

fn moments_of(place: vec2<f32>) -> Moments {
    var third = vec4<f32>(0.0);
    if VECTORS > 2u { third = filtered_vector(place, 2u); }
    return Moments(filtered_vector(place, 0u), filtered_vector(place, 1u), third);
}
