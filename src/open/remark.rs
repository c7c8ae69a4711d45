//! What is said of an input that is taken all the same.

/// What is said, and as what: `note` or `warning`.
pub type Remark = (&'static str, String);
