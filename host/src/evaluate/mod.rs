//! How far one BRDF is from another.
