//! The search that tries to break the promise of `dsm`: 2,000 scenes, always the same ones (`docs/bound.md`).

#[path = "common/attack.rs"]
mod attack;

const TRIES: usize = 2000;

#[test]
fn no_scene_breaks_the_promise() {
    let tries = attack::setting("ATTACK_TRIES", TRIES);
    let Some(found) = attack::search(tries, attack::setting("ATTACK_SEED", 1) as u64) else { return };
    println!("{}", found.summary());
    assert!(found.tries > tries / 2 && found.depths > 1000 * found.tries, "{}", found.summary());
    assert!(found.broken.is_empty(), "{}", found.summary());
}
