//! What the camera sees.
