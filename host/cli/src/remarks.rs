//! Warnings on standard error.

use crate::say::errln;
use gonia_rig::Remark;

/// Prints what is to be said of data that are used all the same, a line each.
pub fn print(remarks: &[Remark]) {
    for remark in remarks {
        errln!("warning: {}", gonia_formats::one_line(&remark.to_string()));
    }
}
