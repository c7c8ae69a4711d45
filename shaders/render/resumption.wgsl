// State of a picture that takes several dispatches, for software adapters that limit loops (src/gpu/tuning.rs).
#define_import_path umbravox::resumption

// Marks that the transmittance from the light is not known.
const UNKNOWN_LIGHT: f32 = -1.0;

struct Resumption {
    // Number of pixels that are not finished.
    unfinished: atomic<u32>,
    // For each pixel, the sample at which its ray resumes: -FAR before the first dispatch, FAR for finished pixels.
    // Then the transmittance from the light there, or UNKNOWN_LIGHT, and the values there and one step before; FAR if they
    // are not known.
    resume: array<vec4<f32>>,
}

@group(2) @binding(2) var<storage, read_write> resumption: Resumption;
