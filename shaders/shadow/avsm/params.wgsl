// Parameters of `avsm`.
#define_import_path umbravox::avsm

struct AvsmParams {
    // Optical depth whose chord stays within the tolerance at transmittance 1.
    longest_depth: f32,
}

@group(1) @binding(5) var<uniform> params: AvsmParams;
