// Transmittance of a scene's shadows: the answer of the shadow method alone.
#define_import_path umbravox::shadow

#import umbravox::method::transmittance as method_transmittance

// Returns the transmittance from the light to a grid-space point.
fn transmittance(g: vec3<f32>) -> f32 {
    return method_transmittance(g);
}
