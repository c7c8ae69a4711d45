//! Tests of commands, run as a user runs them.

mod benchmark;
mod files;
mod fit;
mod flags;
mod info;
mod strands;
mod tf;
