//! Tests of commands that need a device, run as a user runs them.

mod benchmark;
mod claims;
mod curve;
mod frames;
mod pictures;
mod slices;
mod stability;
mod verify;
