// Parameters of `moments` (moment shadow maps).
#define_import_path umbravox::moments

struct MomentParams {
    // Even moments b_2, b_4, b_6 and b_8 of the distribution towards which power moments are biased.
    biased_moments: vec4<f32>,
    // Interpolation weight from the least (0) to the greatest (1) optical depth that the moments allow.
    beta: f32,
    // Weight of the distribution towards which the moments are biased.
    bias: f32,
    // Angle on the unit circle to which the end of the depth range is mapped.
    largest_angle: f32,
    // Largest optical depth of a piece at transmittance 1 whose chord stays within the error tolerance.
    longest_depth: f32,
}

@group(1) @binding(5) var<uniform> params: MomentParams;
