//! What a dense BRDF's file says of the samples that its values are a fit of, so that the fit can be asked instead of
//! the grid.

use crate::whole_file::folder_of;
use crate::{FileError, checksum};
use gonia_brdf::{MirrorPlane, SymmetryKind};
use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Component, Path, PathBuf};

/// The samples that a dense BRDF's values are a fit of, and the symmetry that the fit was asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FitSource {
    /// Without it, the samples show it.
    pub symmetry: Option<SymmetryKind>,
    /// Its plane, where that was stated.
    pub plane: Option<MirrorPlane>,
    /// The files of samples, in their order.
    pub files: Vec<SourceFile>,
}

/// A file of samples, as another file names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// Its place from the folder of the dense BRDF, or the whole path where there is none.
    pub place: PathBuf,
    /// Its checksum.
    pub checksum: String,
}

/// Why the samples of a dense BRDF cannot be had.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SourceLost {
    /// A file is not there.
    Missing(PathBuf),
    /// What is there has other bytes.
    Changed(PathBuf),
}

/// Name of the fact that tells that the values are those of a fit, and with which symmetry it was asked for.
pub const FIT_SYMMETRY: &str = "fit_symmetry";
/// What stands for a symmetry that the samples show.
const AUTO: &str = "auto";

/// Between the name of a symmetry and the azimuth of its plane, degrees, where that was stated.
const ABOUT: &str = " about ";

/// The fact for [`FIT_SYMMETRY`], of a symmetry and of its plane where that was stated.
pub fn fit_symmetry(asked: Option<SymmetryKind>, plane: Option<MirrorPlane>) -> String {
    let name = asked.map_or(AUTO, SymmetryKind::name);
    match plane {
        Some(plane) => format!("{name}{ABOUT}{:.3}", plane.azimuth_deg()),
        None => name.to_owned(),
    }
}

/// What such a fact says; `None` of others.
fn symmetry_of(fact: &str) -> Option<(Option<SymmetryKind>, Option<MirrorPlane>)> {
    let (name, plane) = match fact.split_once(ABOUT) {
        Some((name, azimuth)) => {
            let azimuth: f64 = azimuth.parse().ok()?;
            (
                name,
                Some(MirrorPlane::at_deg(azimuth)).filter(|_| azimuth.is_finite()),
            )
        }
        None => (fact, None),
    };
    match name {
        AUTO => Some((None, None)).filter(|_| plane.is_none()),
        name => Some((Some(SymmetryKind::named(name)?), plane)),
    }
}

fn place_key(number: usize) -> String {
    format!("samples_file.{number}")
}

fn checksum_key(number: usize) -> String {
    format!("samples_checksum.{number}")
}

/// The facts that name the files of samples behind a dense BRDF, with their checksums.
///
/// # Errors
/// When a file of samples cannot be read.
pub fn files_of_samples(
    dense: &Path,
    samples: &[PathBuf],
) -> Result<BTreeMap<String, String>, FileError> {
    let mut facts = BTreeMap::new();
    for (number, path) in (1..).zip(samples) {
        facts.insert(
            place_key(number),
            ascii(&place_from(folder_of(dense), path)),
        );
        facts.insert(checksum_key(number), checksum::of_file(path)?);
    }
    Ok(facts)
}

impl FitSource {
    /// What a dense BRDF's provenance says; `None` where its values are not those of a fit that can be made again.
    pub fn of(provenance: &BTreeMap<String, String>) -> Option<Self> {
        let (symmetry, plane) = symmetry_of(provenance.get(FIT_SYMMETRY)?)?;
        let file = |number| {
            Some(SourceFile {
                place: of_ascii(provenance.get(&place_key(number))?),
                checksum: provenance.get(&checksum_key(number))?.clone(),
            })
        };
        let files: Vec<SourceFile> = (1..).map_while(file).collect();
        (!files.is_empty()).then_some(Self {
            symmetry,
            plane,
            files,
        })
    }

    /// The files, from where the dense BRDF is: where they were, or beside it.
    ///
    /// # Errors
    /// The first that is not there, or is another.
    pub fn find(&self, dense: &Path) -> Result<Vec<PathBuf>, SourceLost> {
        let folder = folder_of(dense);
        self.files.iter().map(|file| file.find(folder)).collect()
    }
}

impl SourceFile {
    fn find(&self, folder: &Path) -> Result<PathBuf, SourceLost> {
        let there = folder.join(&self.place);
        let beside = self.place.file_name().map(|name| folder.join(name));
        let mut lost = SourceLost::Missing(there.clone());
        for path in [Some(there), beside].into_iter().flatten() {
            match checksum::of_file(&path) {
                Ok(found) if found == self.checksum => return Ok(path),
                Ok(_) => lost = SourceLost::Changed(path),
                Err(_) => {}
            }
        }
        Err(lost)
    }
}

/// The way from a folder to a file; the whole path where there is no way.
fn place_from(folder: &Path, file: &Path) -> PathBuf {
    let (Ok(folder), Ok(file)) = (folder.canonicalize(), file.canonicalize()) else {
        return file.to_owned();
    };
    let (from, to): (Vec<Component>, Vec<Component>) =
        (folder.components().collect(), file.components().collect());
    let shared = from.iter().zip(&to).take_while(|(a, b)| a == b).count();
    if shared == 0 {
        return file;
    }
    let up = from[shared..].iter().map(|_| Component::ParentDir);
    up.chain(to[shared..].iter().copied()).collect()
}

/// A path in letters that every attribute of a file holds: `/` between its parts, bytes of other letters as `%E9`.
fn ascii(path: &Path) -> String {
    let mut text = String::new();
    for byte in path.to_string_lossy().bytes() {
        match byte {
            b'\\' if cfg!(windows) => text.push('/'),
            b' '..=b'~' if byte != b'%' => text.push(byte.into()),
            _ => {
                let _ = write!(text, "%{byte:02X}");
            }
        }
    }
    text
}

fn of_ascii(text: &str) -> PathBuf {
    let mut bytes = Vec::with_capacity(text.len());
    let mut rest = text.as_bytes();
    while let [first, after @ ..] = rest {
        let escaped = after.first_chunk::<2>().and_then(|two| {
            let two = std::str::from_utf8(two).ok()?;
            u8::from_str_radix(two, 16).ok()
        });
        match (first, escaped) {
            (b'%', Some(byte)) => {
                bytes.push(byte);
                rest = &after[2..];
            }
            _ => {
                bytes.push(*first);
                rest = after;
            }
        }
    }
    String::from_utf8_lossy(&bytes).into_owned().into()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_found_where_they_were_or_beside_and_only_as_they_were() {
        let dir = tempfile::tempdir().unwrap();
        let at = |name: &str| dir.path().join(name);
        for folder in ["made", "measured"] {
            std::fs::create_dir(at(folder)).unwrap();
        }
        let samples = [at("measured/é 100%41.csv"), at("made/b.csv")];
        std::fs::write(&samples[0], "first").unwrap();
        std::fs::write(&samples[1], "second").unwrap();
        let dense = at("made/d.exr");
        let mut facts = files_of_samples(&dense, &samples).unwrap();
        assert_eq!(facts["samples_file.1"], "../measured/%C3%A9 100%2541.csv");
        assert_eq!(facts["samples_file.2"], "b.csv");
        assert_eq!(FitSource::of(&facts), None);
        let asked = Some(SymmetryKind::HalfTurnBilateral);
        let plane = Some(MirrorPlane::at_deg(23.5));
        for (asked, plane) in [(None, None), (asked, None), (asked, plane)] {
            facts.insert(FIT_SYMMETRY.to_owned(), fit_symmetry(asked, plane));
            let source = FitSource::of(&facts).unwrap();
            assert_eq!((source.symmetry, source.plane), (asked, plane));
        }
        let source = FitSource::of(&facts).unwrap();
        let same = |found: &Path, path: &Path| {
            assert_eq!(found.canonicalize().unwrap(), path.canonicalize().unwrap());
        };
        let found = source.find(&dense).unwrap();
        found.iter().zip(&samples).for_each(|(f, s)| same(f, s));
        // Beside it too.
        let beside = at("made/é 100%41.csv");
        std::fs::rename(&samples[0], &beside).unwrap();
        same(&source.find(&dense).unwrap()[0], &beside);
        std::fs::write(&beside, "other").unwrap();
        assert_eq!(
            source.find(&dense),
            Err(SourceLost::Changed(beside.clone()))
        );
        std::fs::remove_file(&beside).unwrap();
        assert!(matches!(source.find(&dense), Err(SourceLost::Missing(_))));
    }

    #[test]
    fn a_symmetry_that_is_none_is_no_source() {
        for symmetry in [
            "round",
            "bilateral about",
            "bilateral about north",
            "auto about 20.0",
            "round about 20.0",
        ] {
            let facts = [
                (FIT_SYMMETRY, symmetry),
                ("samples_file.1", "a.csv"),
                ("samples_checksum.1", "00000000"),
            ];
            let facts = facts.map(|(name, fact)| (name.to_owned(), fact.to_owned()));
            assert_eq!(FitSource::of(&facts.into()), None, "{symmetry}");
        }
    }
}
