//! From frames to samples.
