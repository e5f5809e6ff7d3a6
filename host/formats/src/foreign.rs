//! Other groups' formats, for `gonia import`.

pub use crate::format::{
    ExportSettings, ForeignBrdf, ForeignContent, ForeignFormat, ForeignWriter, Gaps, Resolution,
};

use crate::format::{Content, Format};
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

/// The format that a dense BRDF is exported in: by `name` on the command line, or else by the ending of
/// `path`, of several the first one of the table.
///
/// # Errors
/// One line with the list of what there is.
pub fn export_format(
    path: &Path,
    name: Option<&str>,
) -> Result<(&'static ForeignFormat, &'static ForeignWriter), FileError> {
    let ending = path
        .extension()
        .map(|ending| ending.to_string_lossy().to_ascii_lowercase());
    let fits = |format: &Format, writer: &ForeignWriter| match (name, &ending) {
        (Some(name), _) => writer.name == name,
        (None, Some(ending)) => format.endings.contains(&ending.as_str()),
        (None, None) => false,
    };
    let found = writers().find(|(format, _, writer)| fits(format, writer));
    found
        .map(|(_, foreign, writer)| (foreign, writer))
        .ok_or_else(|| {
            let described = writers().map(|(format, foreign, writer)| {
                format!("{} ({}, .{})", writer.name, foreign.name, format.endings[0])
            });
            FileError::new(
                path,
                match name {
                    Some(name) => format!("cannot be written as '{name}': there is no such format"),
                    None => "has not the ending of a format that is exported".to_owned(),
                },
                format_args!("give --format {}", table::listed(described)),
            )
        })
}

/// Every format that is exported.
fn writers() -> impl Iterator<
    Item = (
        &'static Format,
        &'static ForeignFormat,
        &'static ForeignWriter,
    ),
> {
    table::formats(|content| matches!(content, Content::Foreign(_))).filter_map(|format| {
        match &format.content {
            Content::Foreign(foreign) => Some((format, foreign, foreign.write.as_ref()?)),
            Content::Dense(_) | Content::Samples(_) => None,
        }
    })
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
        let by_bytes = at("velvet.brdf");
        let header = [90i32, 90, 180].map(i32::to_le_bytes);
        std::fs::write(&by_bytes, header.as_flattened()).unwrap();
        assert_eq!(foreign_format(&by_bytes).ok().unwrap().name, "MERL .binary");
        for name in ["a.txt", "a.exr"] {
            let error = foreign_format(&at(name)).err().unwrap().to_string();
            let said = "neither .bin (UTIA), .binary (MERL), .dat (Ngan, Durand, Matusik) nor .bsdf (RGL, Mitsuba's measured); give other samples to gonia fill as CSV";
            assert!(error.ends_with(said), "{error}");
        }
    }
}
