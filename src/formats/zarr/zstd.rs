//! Streams of zstd, with a bound on what they may remember.

use ruzstd::decoding::{FrameDecoder, StreamingDecoder};
use std::io::{self, Read};

/// What a stream may ask to remember: that of the highest level of the command `zstd`.
const WINDOW_MOST_BYTES: u64 = 128 << 20;

/// A stream of zstd.
///
/// # Errors
/// It is none, or wants more memory than any writer makes it want.
pub(super) fn zstd<R: Read>(input: R) -> io::Result<StreamingDecoder<R, FrameDecoder>> {
    let stream = StreamingDecoder::new_with_max_window_size(input, WINDOW_MOST_BYTES);
    stream.map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e.to_string()))
}
