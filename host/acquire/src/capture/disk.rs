//! Free disk space.

use std::path::Path;

/// Room on the disk of a folder that this program may use, MB (10⁶ bytes); `None` where the system does
/// not say.
pub fn free_mb(folder: &Path) -> Option<u64> {
    Some(fs4::available_space(folder).ok()? / 1_000_000)
}
