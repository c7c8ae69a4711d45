//! Tests of commands that need a device, run as a user runs them.

mod claims;
mod curve;
mod frames;
mod pictures;
mod stability;
