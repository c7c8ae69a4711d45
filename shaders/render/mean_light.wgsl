// Mean transmittance from the light over a stretch of an eye ray.
#define_import_path umbravox::mean_light

#ifdef LINEAR_LIGHT
// Returns the mean transmittance from the light over a stretch of the eye ray, on which it changes linearly with the optical
// depth to the eye from a to b. The mean is linear in a and b, so that random estimates without bias stay so.
fn mean_light(a: f32, b: f32, depth: f32) -> f32 {
    let middle = select(1.0 / depth - 1.0 / (exp(depth) - 1.0), 0.5 - depth / 12.0, depth < 0.1);
    return a + (b - a) * middle;
}
#else
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
#endif
