//! Long search for violations of the error bound of `dsm`: 100,000 scenes (`ATTACK_TRIES` sets another number).

#[path = "../tests/common/attack/mod.rs"]
mod attack;
#[path = "../tests/common/mod.rs"]
mod common;

use std::process::ExitCode;

const TRIES: usize = 100_000;

fn main() -> ExitCode {
    let tries = attack::setting("ATTACK_TRIES", TRIES);
    let Some(gpu) = common::gpu() else { return ExitCode::SUCCESS };
    let found = attack::search(gpu, tries, attack::setting("ATTACK_SEED", 1) as u64, "greedy");
    println!("{}", found.summary());
    if found.broken.is_empty() { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}
