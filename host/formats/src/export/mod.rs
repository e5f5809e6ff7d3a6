//! Dense BRDFs in the formats of other programs: the list of formats, and how one is chosen.
//!
//! A new format is one file that defines an [`ExportFormat`], and one row in [`EXPORTS`]; the book's table is made
//! of them.

pub(crate) mod bird;
mod dataset;
mod folder;
pub(crate) mod format;
#[cfg(test)]
pub(crate) mod lopsided;
mod merl;
mod netcdf;
pub(crate) mod pab;
pub(crate) mod radiance;
mod speos;
mod utia;
mod zarr;
pub(crate) mod zarr_read;
mod zarr_rings;
pub(crate) mod zemax;

pub use bird::BirdFile;
pub(crate) use dataset::{channels_of, scale_of};
pub use folder::check_new_folder;
pub use format::{ExportFormat, ExportSettings, Holds, How, Meaning, Point, Resolution};
pub use zarr_rings::ZarrRings;

use crate::{FileError, rgl, table};
use std::path::Path;

/// Every format that is exported. Of several with one ending the first is written where no name is given.
pub static EXPORTS: [&ExportFormat; 12] = [
    &rgl::EXPORT,
    &radiance::TENSOR_TREE_4,
    &radiance::TENSOR_TREE_3,
    &radiance::KLEMS,
    &pab::EXPORT,
    &zemax::EXPORT,
    &speos::EXPORT,
    &netcdf::EXPORT,
    &zarr::EXPORT,
    &merl::EXPORT,
    &utia::EXPORT,
    &bird::EXPORT,
];

/// The format that a dense BRDF is exported in: by `name` on the command line, or else by the ending of
/// `path`, of several the first one of the table.
///
/// # Errors
/// One line with the list of what there is.
pub fn export_format(path: &Path, name: Option<&str>) -> Result<&'static ExportFormat, FileError> {
    let file = path
        .file_name()
        .map(|name| name.to_string_lossy().to_ascii_lowercase())
        .unwrap_or_default();
    let fits = |format: &ExportFormat| match name {
        Some(name) => format.name == name,
        None => file.ends_with(&format!(".{}", format.ending)),
    };
    let found = EXPORTS.into_iter().find(|format| fits(format));
    found.ok_or_else(|| {
        let known = EXPORTS
            .iter()
            .map(|format| format!("{} ({}, .{})", format.name, format.title, format.ending));
        let problem = match name {
            Some(name) => format!("cannot be written as '{name}': there is no such format"),
            None => "has not the ending of a format that is exported".to_owned(),
        };
        let remedy = format_args!("give --format {}", table::listed(known)).to_string();
        FileError::new(path, problem, remedy)
    })
}

/// The formats as rows of a table, a heading first: name, ending, and so on.
pub fn export_table() -> Vec<[String; 7]> {
    let heading = [
        "name",
        "ending",
        "read by",
        "values",
        "channels",
        "angles",
        "`--resolution`",
    ];
    let mut rows = vec![heading.map(str::to_owned)];
    rows.extend(EXPORTS.iter().map(|format| {
        let resolution = format
            .resolution
            .as_ref()
            .map(|r| format!("{}, {} to {}; {}", r.of, r.least, r.most, r.default));
        [
            format!("`{}`", format.name),
            format!("`.{}`", format.ending),
            format.readers.to_owned(),
            format.means.to_string(),
            format.holds.to_string(),
            format.angles.to_owned(),
            resolution.unwrap_or_else(|| "one size".to_owned()),
        ]
    }));
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    const PAGE: &str = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../../docs/src/reference/files/exports.md"
    );
    const MARKS: [&str; 2] = ["<!-- formats -->\n", "<!-- /formats -->"];

    #[test]
    fn the_books_table_is_the_list_of_formats() {
        let page = std::fs::read_to_string(PAGE).unwrap().replace("\r\n", "\n");
        let [start, end] = MARKS.map(|mark| page.find(mark).unwrap());
        let mut rows = export_table()
            .into_iter()
            .map(|row| format!("| {} |\n", row.join(" | ")));
        let heading = rows.next().unwrap();
        let made = format!(
            "{heading}|---|---|---|---|---|---|---|\n{}",
            rows.collect::<String>()
        );
        let start = start + MARKS[0].len();
        if std::env::var_os("GONIA_UPDATE_DOCS").is_some() {
            std::fs::write(PAGE, format!("{}{made}{}", &page[..start], &page[end..])).unwrap();
            return;
        }
        assert_eq!(
            &page[start..end],
            made,
            "GONIA_UPDATE_DOCS=1 writes the table"
        );
    }

    #[test]
    fn a_format_is_found_by_its_name_and_by_its_ending_and_no_two_share_a_name() {
        for (k, format) in EXPORTS.iter().enumerate() {
            let path = format!("a.{}", format.ending.to_uppercase());
            let found = export_format(Path::new(&path), None).unwrap();
            assert_eq!(found.ending, format.ending, "{path}");
            let found = export_format(Path::new("a"), Some(format.name)).unwrap();
            assert_eq!(found.name, format.name);
            assert!(EXPORTS[..k].iter().all(|other| other.name != format.name));
            if let Some(r) = &format.resolution {
                assert!((r.least..=r.most).contains(&r.default));
            }
        }
        for (path, name) in [("a.zmx", None), ("bsdf", None), ("a.bsdf", Some("RGL"))] {
            let error = export_format(Path::new(path), name).err().unwrap();
            let error = error.to_string();
            for format in EXPORTS {
                assert!(error.contains(format.name), "{error}");
            }
            assert_eq!(error.lines().count(), 1);
        }
    }
}
