// Segments between the nodes of a transmittance curve: straight lines of transmittance, or of optical depth
// (OPTICAL_DEPTH), which is straight in a homogeneous medium.
#define_import_path umbravox::segments

// Least value of a node: transmittance 0, or less than the light that is left where rays end.
#ifdef OPTICAL_DEPTH
const LEAST_VALUE: f32 = -8.0;
// Largest optical depth of a piece of the march, and the ratio of the transmittances at its ends.
const LONGEST_PIECE: f32 = 0.9162907;
#else
const LEAST_VALUE: f32 = 0.0;
const LONGEST_PIECE: f32 = 1e30;
#endif
const LEAST_RATIO: f32 = 0.4;

// Returns the value that is linear in depth on a segment: transmittance, or its logarithm.
fn segment_value(transmittance: f32) -> f32 {
#ifdef OPTICAL_DEPTH
    return max(log(max(transmittance, 1e-30)), LEAST_VALUE);
#else
    return transmittance;
#endif
}

fn segment_transmittance(value: f32) -> f32 {
#ifdef OPTICAL_DEPTH
    return exp(value);
#else
    return value;
#endif
}
