//! Radiance's BSDF files (XML of WINDOW 6): a tensor tree of rank 4 or 3, or Klems' matrix.
//!
//! Values are f in 1/sr. The side towards +z is Radiance's *Back*; the light's direction enters with x and y negated,
//! as the direction in which it travels. Colours are the CIE's X, Y, Z over those of the white point, so that a grey
//! has X = Y = Z: Radiance's white is that of equal energy.

mod colour;
mod klems;
mod square;
mod tree;
mod tree_text;
mod xml;
mod xml_read;

pub(super) use colour::{rgb_of, xyz_of};
pub(super) use tree::of_anisotropy;
pub(crate) use xml_read::FORMAT;

use super::{ExportFormat, Holds, How, Meaning, Resolution};

/// Where all three have their provenance.
const PROVENANCE: Option<&str> = Some("a comment at the top");
const READERS: &str = "Radiance; `gonia import`";

/// A tree of rank 4.
pub(super) static TENSOR_TREE_4: ExportFormat = TREE;

const TREE: ExportFormat = ExportFormat {
    name: "tensortree4",
    title: "Radiance XML, tensor tree of rank 4",
    ending: "xml",
    readers: READERS,
    means: Meaning::Absolute,
    holds: Holds::ColoursOrOne,
    angles: "cells of equal projected solid angle, larger where values are alike",
    provenance: PROVENANCE,
    is_folder: false,
    resolution: Some(LEVELS),
    step_deg: step_of_level,
    how: How::Brdf {
        write: tree::write_4,
        read: xml_read::read,
    },
};

/// A tree of rank 3, for isotropic materials.
pub(super) static TENSOR_TREE_3: ExportFormat = ExportFormat {
    name: "tensortree3",
    title: "Radiance XML, tensor tree of rank 3",
    angles: "isotropic: the mean over turns of the sample; cells as of `tensortree4`",
    how: How::Brdf {
        write: tree::write_3,
        read: xml_read::read,
    },
    ..TREE
};

/// Klems' matrix.
pub(super) static KLEMS: ExportFormat = ExportFormat {
    name: "klems",
    title: "Radiance XML, Klems' full basis",
    readers: "Radiance, WINDOW, EnergyPlus; `gonia import`",
    angles: "means over 145 patches of the light's and 145 of the view's directions",
    resolution: None,
    step_deg: |_| 10.0,
    how: How::Brdf {
        write: klems::write,
        read: xml_read::read,
    },
    ..TREE
};

const LEVELS: Resolution = Resolution {
    default: 5,
    least: 3,
    most: 6,
    of: "levels: 2^n cells along each of its sides",
};

fn step_of_level(level: usize) -> f64 {
    180.0 / f64::from(1 << level.min(16))
}

#[cfg(test)]
mod tests;
