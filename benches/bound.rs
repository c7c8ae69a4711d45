//! Long search for violations of the error bound of `dsm`: 100,000 scenes (`ATTACK_TRIES` sets another number).

#[path = "../tests/common/attack.rs"]
mod attack;

use std::process::ExitCode;

const TRIES: usize = 100_000;

fn main() -> ExitCode {
    let tries = attack::setting("ATTACK_TRIES", TRIES);
    match attack::search(tries, attack::setting("ATTACK_SEED", 1) as u64, "greedy") {
        None => ExitCode::SUCCESS,
        Some(found) => {
            println!("{}", found.summary());
            if found.broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
        }
    }
}
