//! A value that no rig has, and the check of a range.

use std::ops::RangeInclusive;

/// A value that no rig has.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{key}: {problem}; {remedy}")]
pub struct RigError {
    /// The key in `rig.toml`, with its table.
    pub key: &'static str,
    /// What is wrong with its value.
    pub problem: String,
    /// What to do.
    pub remedy: String,
}

impl RigError {
    /// An error with what is wrong and what to do.
    pub(crate) fn new(key: &'static str, problem: String, remedy: &str) -> Self {
        Self {
            key,
            problem,
            remedy: remedy.into(),
        }
    }
}

/// Checks that a value lies in a range. A unit may be empty; a range from the least positive number on
/// is one without zero.
///
/// # Errors
/// It does not, or is NaN.
pub(crate) fn within(
    key: &'static str,
    value: f64,
    range: RangeInclusive<f64>,
    unit: &str,
) -> Result<(), RigError> {
    // Written so that a NaN is outside of every range.
    if range.contains(&value) {
        return Ok(());
    }
    let (least, most) = (range.start(), range.end());
    let unit = if unit.is_empty() {
        String::new()
    } else {
        format!(" {unit}")
    };
    let remedy = if *least == f64::MIN_POSITIVE {
        format!("give more than 0 and at most {most}{unit}")
    } else {
        format!("give a value from {least} to {most}{unit}")
    };
    Err(RigError {
        key,
        problem: format!("{value}{unit} is not possible"),
        remedy,
    })
}
