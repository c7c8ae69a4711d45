// States of rays that wait for pages of the volume (RAY_STATES): words of each ray, which a later dispatch reads in the
// order in which they were written.
#define_import_path umbravox::ray_state

#ifdef RAY_STATES
// Number of rays, then for each ray its status, then the other words of all rays.
@group(2) @binding(#{RAY_STATE_BINDING}) var<storage, read_write> ray_states: array<u32>;

// Status of a ray; 0 before it starts.
const WAITING: u32 = 1u;
const FINISHED: u32 = 2u;

// Place of the status of this thread's ray, and of the next word that is read or written.
var<private> status_place: u32;
var<private> next_place: u32;

// Number of words of a march by cells, which come first.
const MARCH_WORDS: u32 = 6u;

// Goes to a word of this thread's ray.
fn go_to_word(word: u32) {
    next_place = status_place + ray_states[0] * (1u + word);
}

// Selects the ray of this thread; returns false if the ray is finished.
fn select_ray(index: u32) -> bool {
    status_place = 1u + index;
    go_to_word(0u);
    return ray_states[status_place] != FINISHED;
}

// Returns whether the ray of this thread has a state from an earlier dispatch.
fn has_state() -> bool {
    return ray_states[status_place] == WAITING;
}

// Starts the state of a ray that waits.
fn start_state() {
    ray_states[status_place] = WAITING;
    go_to_word(0u);
}

fn finish_ray() {
    ray_states[status_place] = FINISHED;
}

fn put_word(word: u32) {
    ray_states[next_place] = word;
    next_place += ray_states[0];
}

fn put_float(number: f32) {
    put_word(bitcast<u32>(number));
}

fn put_words(words: vec4<u32>) {
    put_word(words.x);
    put_word(words.y);
    put_word(words.z);
    put_word(words.w);
}

fn take_word() -> u32 {
    let word = ray_states[next_place];
    next_place += ray_states[0];
    return word;
}

fn take_float() -> f32 {
    return bitcast<f32>(take_word());
}

fn take_words() -> vec4<u32> {
    let x = take_word();
    let y = take_word();
    let z = take_word();
    return vec4<u32>(x, y, z, take_word());
}
#endif
