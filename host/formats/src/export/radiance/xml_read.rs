//! Reading Radiance's BSDF files: the reflection of their side towards +z.

use super::klems::{COUNT, opposite, patch_of};
use super::tree::place_of;
use super::tree_text::{Tree, parse};
use super::{colour, xml};
use crate::FileError;
use crate::format::{Content, ForeignBrdf, ForeignContent, ForeignFormat, Format, Gaps};
use crate::text_file::read_text;
use gonia_brdf::direction::Vec3;
use gonia_brdf::{Brdf, Direction};
use gonia_rig::Scale;
use std::path::Path;

/// The format, to be imported.
pub(crate) static FORMAT: Format = Format {
    name: "Radiance, WINDOW",
    endings: &["xml"],
    magic: &[],
    content: Content::Foreign(ForeignFormat {
        name: "Radiance .xml",
        content: ForeignContent::Brdf {
            scale: Some(Scale::Absolute),
            read,
        },
    }),
};

/// The values of one wavelength.
enum Values {
    Tree(u32, Tree),
    /// A row a view.
    Klems(Vec<f32>),
}

/// A file's reflection.
struct Radiance {
    /// Y; or Y, X and Z of a matrix; or Y, u' and v' of a tree.
    blocks: Vec<Values>,
}

/// Reads a file.
///
/// # Errors
/// One line naming it: no such XML, another basis, no reflection of the side towards +z, numbers that are none.
pub fn read(path: &Path) -> Result<Box<dyn ForeignBrdf>, FileError> {
    let text = without_comments(&read_text(path)?);
    let structure = element(&text, "IncidentDataStructure").ok_or_else(|| {
        let what = "has no element IncidentDataStructure";
        FileError::new(path, what, "give a BSDF file of Radiance or WINDOW")
    })?;
    let reflection = |wavelength: &str| -> Option<&str> {
        sections(&text, "WavelengthData").find_map(|data| {
            let is_wanted = element(data, "Wavelength")?.trim() == wavelength;
            let blocks = || sections(data, "WavelengthDataBlock");
            let is_back = |block: &&str| {
                element(block, "WavelengthDataDirection")
                    .is_some_and(|direction| direction.trim() == "Reflection Back")
            };
            is_wanted.then(|| blocks().find(is_back)).flatten()
        })
    };
    let names = if structure.trim() == "Columns" {
        xml::OF_MATRIX
    } else {
        xml::OF_TREE
    };
    let [visible, x, z] = names.map(reflection);
    let Some(visible) = visible else {
        let directions = sections(&text, "WavelengthDataBlock")
            .filter_map(|block| element(block, "WavelengthDataDirection"))
            .map(|direction| direction.trim().to_owned());
        let found: std::collections::BTreeSet<String> = directions.collect();
        let found: Vec<String> = found.into_iter().collect();
        return Err(FileError::new(
            path,
            format_args!(
                "has no 'Reflection Back' of 'Visible', the side towards +z; it has {}",
                found.join(", ")
            ),
            "give a file with that side (Radiance's pkgBSDF or wrapBSDF turn one round)",
        ));
    };
    let blocks: Vec<&str> = match (x, z) {
        (Some(x), Some(z)) => vec![visible, x, z],
        _ => vec![visible],
    };
    let blocks: Result<Vec<Values>, FileError> = blocks
        .into_iter()
        .zip(names)
        .map(|(block, name)| values_of(path, structure.trim(), block).map_err(|e| e.at(name)))
        .collect();
    Ok(Box::new(Radiance { blocks: blocks? }))
}

fn values_of(path: &Path, structure: &str, block: &str) -> Result<Values, FileError> {
    let numbers = element(block, "ScatteringData").unwrap_or_default();
    let rank = match structure {
        "TensorTree4" => 4,
        "TensorTree3" => 3,
        "Columns" => return klems_of(path, block, numbers),
        _ => {
            return Err(FileError::new(
                path,
                format_args!("has the structure '{structure}'"),
                "give one of TensorTree4, TensorTree3 or Columns",
            ));
        }
    };
    let tree = parse(numbers, rank).ok_or_else(|| {
        FileError::new(
            path,
            format_args!("its ScatteringData is no tree of rank {rank} of values from 0 on"),
            "copy the file again",
        )
    })?;
    Ok(Values::Tree(rank, tree))
}

fn klems_of(path: &Path, block: &str, numbers: &str) -> Result<Values, FileError> {
    for basis in ["ColumnAngleBasis", "RowAngleBasis"] {
        let name = element(block, basis).unwrap_or_default().trim();
        if name != "LBNL/Klems Full" {
            return Err(FileError::new(
                path,
                format_args!("has the {basis} '{name}'"),
                "give a file of the basis LBNL/Klems Full, or a tensor tree",
            ));
        }
    }
    let words = numbers.split(|c: char| c.is_whitespace() || c == ',');
    let values: Option<Vec<f32>> = words
        .filter(|word| !word.is_empty())
        .map(|word| {
            word.parse()
                .ok()
                .filter(|v: &f32| v.is_finite() && *v >= 0.0)
        })
        .collect();
    match values {
        Some(values) if values.len() == COUNT * COUNT => Ok(Values::Klems(values)),
        Some(values) => Err(FileError::new(
            path,
            format_args!(
                "its ScatteringData has {} numbers where there are {COUNT} x {COUNT}",
                values.len()
            ),
            "copy the file again",
        )),
        None => Err(FileError::new(
            path,
            "its ScatteringData holds what is no number from 0 on",
            "copy the file again",
        )),
    }
}

fn without_comments(text: &str) -> String {
    let mut parts = text.split("<!--");
    let mut out = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        out += part.split_once("-->").map_or("", |(_, rest)| rest);
    }
    out
}

/// What stands in each element of a name.
fn sections<'a>(text: &'a str, name: &'a str) -> impl Iterator<Item = &'a str> {
    let mut rest = text;
    std::iter::from_fn(move || {
        loop {
            let at = rest.find(&format!("<{name}"))?;
            rest = &rest[at + 1 + name.len()..];
            // Not the beginning of a longer name.
            if !rest.starts_with(|c: char| c == '>' || c.is_whitespace()) {
                continue;
            }
            let inner = &rest[rest.find('>')? + 1..];
            let end = inner.find(&format!("</{name}>"))?;
            rest = &inner[end..];
            return Some(&inner[..end]);
        }
    })
}

fn element<'a>(text: &'a str, name: &'a str) -> Option<&'a str> {
    sections(text, name).next()
}

impl Values {
    fn at(&self, light: Direction, view: Direction) -> f64 {
        f64::from(match self {
            Self::Tree(rank, tree) => tree.at(*rank, place_of(*rank, light, view)),
            Self::Klems(values) => values[patch_of(view) * COUNT + patch_of(opposite(light))],
        })
    }
}

impl Brdf for Radiance {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let [light, view] = [light, view].map(Direction::from_vec3);
        match &self.blocks[..] {
            [y, second, third] => {
                let [y, second, third] = [y, second, third].map(|values| values.at(light, view));
                colour::rgb_of(match self.blocks[0] {
                    Values::Tree(..) => colour::xyz_of_yuv([y, second, third]),
                    Values::Klems(_) => [second, y, third],
                })
            }
            blocks => [blocks.first().map_or(0.0, |y| y.at(light, view)); 3],
        }
    }
}

impl ForeignBrdf for Radiance {
    fn gaps(&self) -> Option<Gaps> {
        None
    }
}
