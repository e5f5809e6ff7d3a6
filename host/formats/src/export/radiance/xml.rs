//! What is around the numbers of a Radiance file.

use crate::FileError;
use crate::write_whole;
use gonia_rig::DenseFile;
use std::io::{self, Write};
use std::path::Path;

/// Names of a matrix's blocks: Y alone, or with X and Z.
pub const OF_MATRIX: [&str; 3] = ["Visible", "CIE-X", "CIE-Z"];
/// Names of a tree's blocks: Y alone, or with the chromaticity u', v' (CIE 1976).
pub const OF_TREE: [&str; 3] = ["Visible", "CIE-u", "CIE-v"];

/// What a file holds.
pub struct Document<'a> {
    /// `Columns`, `TensorTree4`, `TensorTree3`.
    pub structure: &'static str,
    /// What defines the basis, where that is not known by its name.
    pub basis: &'static str,
    /// The elements that name the basis of a block.
    pub block: &'static str,
    /// The names of the blocks.
    pub wavelengths: [&'static str; 3],
    /// The numbers of a block.
    pub numbers: &'a [String],
}

/// Writes a file whole.
///
/// # Errors
/// When it cannot be written.
pub fn write(path: &Path, file: &DenseFile, document: &Document<'_>) -> Result<(), FileError> {
    write_whole(path, |out| text(out, file, document))
}

fn text(out: &mut impl Write, file: &DenseFile, document: &Document<'_>) -> io::Result<()> {
    writeln!(out, "<?xml version=\"1.0\" encoding=\"UTF-8\"?>")?;
    writeln!(out, "<!--\nscale = {}", file.scale)?;
    for (name, value) in &file.provenance {
        writeln!(out, "{} = {}", comment(name), comment(value))?;
    }
    let name = file
        .provenance
        .get("material")
        .map_or("material", |name| name);
    let Document {
        structure, basis, ..
    } = document;
    writeln!(
        out,
        "-->\n<WindowElement xmlns=\"http://windows.lbl.gov\" xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" xsi:schemaLocation=\"http://windows.lbl.gov/BSDF-v1.4.xsd\">\n<WindowElementType>System</WindowElementType>\n<FileType>BSDF</FileType>\n<Optical>\n<Layer>\n<Material>\n<Name>{}</Name>\n<Manufacturer>gonia</Manufacturer>\n<DeviceType>Other</DeviceType>\n</Material>\n<DataDefinition>\n<IncidentDataStructure>{structure}</IncidentDataStructure>\n{basis}</DataDefinition>",
        element(name)
    )?;
    for (wavelength, numbers) in document.wavelengths.iter().zip(document.numbers) {
        write!(
            out,
            "<WavelengthData>\n<LayerNumber>System</LayerNumber>\n<Wavelength unit=\"Integral\">{wavelength}</Wavelength>\n<SourceSpectrum>CIE Illuminant D65 1nm.ssp</SourceSpectrum>\n<DetectorSpectrum>ASTM E308 1931 Y.dsp</DetectorSpectrum>\n<WavelengthDataBlock>\n<WavelengthDataDirection>Reflection Back</WavelengthDataDirection>\n{}<ScatteringDataType>BRDF</ScatteringDataType>\n<ScatteringData>\n",
            document.block
        )?;
        out.write_all(numbers.as_bytes())?;
        out.write_all(b"\n</ScatteringData>\n</WavelengthDataBlock>\n</WavelengthData>\n")?;
    }
    out.write_all(b"</Layer>\n</Optical>\n</WindowElement>\n")
}

/// As a comment may hold it, which has no two dashes in a row.
fn comment(text: &str) -> String {
    crate::one_line(text).replace('-', "\u{2010}")
}

/// As the text of an element.
fn element(text: &str) -> String {
    crate::one_line(text)
        .replace('&', "&amp;")
        .replace('<', "&lt;")
}
