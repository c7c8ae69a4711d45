// Parameters of `moments`.
#define_import_path umbravox::moments

struct MomentParams {
    // Even moments b_2, b_4, b_6 and b_8 of the distribution towards which power moments are biased.
    biased_moments: vec4<f32>,
    // From the least (0) to the greatest (1) optical depth that the moments allow.
    beta: f32,
    // Weight of the biased distribution.
    bias: f32,
    // Angle at which the range of depths ends on the unit circle.
    largest_angle: f32,
    padding: f32,
}

@group(1) @binding(5) var<uniform> params: MomentParams;
