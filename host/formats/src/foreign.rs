//! Other groups' formats, for `gonia import`.

pub use crate::format::{ForeignBrdf, ForeignContent, ForeignFormat, Gaps};

use crate::format::Content;
use crate::{FileError, table};
use std::path::Path;

/// The format of another group's file, by its first bytes, else by its ending.
///
/// # Errors
/// One line naming the file: unreadable, or of no format that is imported.
pub fn foreign_format(path: &Path) -> Result<&'static ForeignFormat, FileError> {
    match table::format_of_file(path)?.map(|format| &format.content) {
        Some(Content::Foreign(foreign)) => Ok(foreign),
        _ => Err(FileError::new(
            path,
            format_args!("neither {}", known()),
            "give other samples to gonia fill as CSV",
        )),
    }
}

/// The formats that are imported: `.bin (UTIA), .binary (MERL) nor .dat (…)`.
fn known() -> String {
    let formats = table::formats(|content| matches!(content, Content::Foreign(_)));
    let described = formats.map(|format| format!(".{} ({})", format.endings[0], format.name));
    table::listed(described).replace(" or ", " nor ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_told_by_their_endings_and_others_are_refused_with_the_list() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| {
            let path = dir.path().join(name);
            std::fs::write(&path, "x").unwrap();
            path
        };
        for (name, format) in [
            ("a.bin", "UTIA .bin"),
            ("a.binary", "MERL .binary"),
            ("a.DAT", "Ngan, Durand and Matusik .dat"),
        ] {
            assert_eq!(foreign_format(&at(name)).ok().unwrap().name, format);
        }
        let alta = at("b.dat");
        std::fs::write(&alta, "#DIM 3 1\n").unwrap();
        assert_eq!(foreign_format(&alta).ok().unwrap().name, "ALTA text");
        // 35 bins, the letter # as a number.
        std::fs::write(&alta, 35i32.to_le_bytes()).unwrap();
        assert!(foreign_format(&alta).ok().unwrap().name.starts_with("Ngan"));
        let by_bytes = at("velvet.brdf");
        let header = [90i32, 90, 180].map(i32::to_le_bytes);
        std::fs::write(&by_bytes, header.as_flattened()).unwrap();
        assert_eq!(foreign_format(&by_bytes).ok().unwrap().name, "MERL .binary");
        for name in ["a.txt", "a.exr"] {
            let error = foreign_format(&at(name)).err().unwrap().to_string();
            let said = "neither .bin (UTIA), .binary (MERL), .dat (ALTA), .dat (Ngan, Durand, Matusik), .bsdf (RGL, Mitsuba's measured), .xml (Radiance, WINDOW), .bsdf (Zemax), .astm (Cornell ASTM), .pab (pab text) nor .json (BiRD); give other samples to gonia fill as CSV";
            assert!(error.ends_with(said), "{error}");
        }
    }
}
