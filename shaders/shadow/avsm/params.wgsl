// Parameters of `avsm` (adaptive volumetric shadow maps).
#define_import_path umbravox::avsm

struct AvsmParams {
    // Largest optical depth of a piece at transmittance 1 whose chord stays within the error tolerance.
    longest_depth: f32,
    // Largest error in transmittance of the compression, before nodes are removed.
    epsilon: f32,
}

@group(1) @binding(5) var<uniform> params: AvsmParams;
