// Mean transmittance from the light over a stretch of an eye ray.
#define_import_path umbravox::mean_light

// Transmittance that counts as this much at least, so that its logarithm is finite.
const DARKEST: f32 = 1e-6;

// Returns the mean transmittance from the light over a stretch of the eye ray. It goes from a to b as an exponential
// of the optical depth to the eye: exact for any layered medium and any step.
fn mean_light(a: f32, b: f32, depth: f32) -> f32 {
    let x = depth + log(max(a, DARKEST) / max(b, DARKEST));
    let lit = select((1.0 - exp(-x)) / x, 1.0 - 0.5 * x, abs(x) < 1e-3);
    let unlit = select((1.0 - exp(-depth)) / depth, 1.0 - 0.5 * depth, depth < 1e-3);
    return a * lit / unlit;
}
