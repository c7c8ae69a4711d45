// Segments between the nodes of a transmittance curve: straight lines of transmittance, or of optical depth
// (OPTICAL_DEPTH), which is straight in a homogeneous medium.
#define_import_path umbravox::segments

// Least value of a node. Its transmittance, e^-8, is less than what is left where rays end.
#ifdef OPTICAL_DEPTH
const LEAST_VALUE: f32 = -8.0;
// Largest optical depth of a piece of the march.
const LONGEST_PIECE: f32 = 0.9162907;
#else
const LEAST_VALUE: f32 = 0.0;
const LONGEST_PIECE: f32 = 1e30;
#endif
// Smallest ratio of the transmittances at the ends of such a piece.
const LEAST_RATIO: f32 = 0.4;
// Transmittance of the least value of a logarithm.
const LEAST_TRANSMITTANCE: f32 = 3.3546263e-4;

// Returns the value that is linear in depth on a segment: transmittance, or its logarithm.
fn segment_value(transmittance: f32) -> f32 {
#ifdef OPTICAL_DEPTH
    return log(max(transmittance, LEAST_TRANSMITTANCE));
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
