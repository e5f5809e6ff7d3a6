//! How far predictions are from what was measured, and what that counts.

use crate::elementary::Elementary;

/// A residual beyond this counts as this.
pub(super) const RESIDUAL_MAX: f64 = 1.0;

/// Logarithm of predicted over measured; of what is noise about zero, the difference over the predicted.
pub(super) fn residual(predicted: f64, measured: f64) -> f64 {
    let ratio = measured / predicted.max(1e-300);
    let residual = if ratio > 0.2 {
        -ratio.natural_log()
    } else {
        1.0 - ratio
    };
    residual.clamp(-RESIDUAL_MAX, RESIDUAL_MAX)
}

/// Mean over the channels of a residual's size.
pub(super) fn size(residual: &[f64; 3]) -> f64 {
    residual.iter().map(|r| r.abs()).sum::<f64>() / 3.0
}

/// What a residual counts: by its square where it is of the usual size, which noise makes, and by its root where
/// it is far larger, so that a few places on a peak do not hide what all others say.
pub(super) fn loss(residual: &[f64; 3], usual: f64) -> f64 {
    size(residual).hypotenuse(usual).sqrt() - usual.sqrt()
}
