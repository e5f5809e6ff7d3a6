//! The paper's figures of a measurement, each a file of its own.

use crate::files::RIVALS_FIGURE;
use crate::input::ReportInput;
use crate::subspaces::Subspace;
use crate::{html, panels, shots, slices, spans, subspaces};
use gonia_brdf::Brdf;
use gonia_formats::{FileError, check_writable, write_whole_bytes};
use gonia_render as render;
use gonia_render::{Environment, Picture, Tabulated, png, svg, tone};
use gonia_rig::Rig;
use maud::Markup;
use std::path::{Path, PathBuf};

/// Pixels of the picture with many lights, a side, and of the height of that on a cylinder.
const PX: usize = 512;
/// Directional lights that stand for the environment, as in the paper.
const SKY_LIGHTS: usize = 512;

/// Writes the figures into a folder, which is made where it is missing, and returns their paths:
/// Fig. 2 (a sphere under the sky), Fig. 3 (spans of a frame) where the rig is known, Fig. 6 (bent
/// around a cylinder, a light above the camera), Fig. 8 (baselines) where they were compared, and
/// Fig. 9 a to d (slices).
///
/// # Errors
/// When the folder or a file cannot be written.
pub fn write_figures(folder: &Path, input: &ReportInput<'_>) -> Result<Vec<PathBuf>, FileError> {
    check_writable(folder)?;
    let mut written = Vec::new();
    let mut keep = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        write_whole_bytes(&path, bytes)?;
        written.push(path);
        Ok::<_, FileError>(())
    };
    let brdf = Tabulated::new(input.dense);
    let sky = Environment::sky().lights(SKY_LIGHTS);
    let sphere = render::sphere(&brdf, &sky, PX, 1).with_smooth_outline();
    keep("fig2.png", &picture_png(&sphere))?;
    if let Some(rig) = input.rig {
        keep("fig3.svg", spans_alone(rig).as_bytes())?;
    }
    let size = (PX * 2 / 3, PX);
    let bent = render::bent(&brdf, &render::single(), size, 0.0);
    keep("fig6.png", &picture_png(&bent))?;
    let figure = input.charts.iter().find(|(name, _)| name == RIVALS_FIGURE);
    if let Some((_, figure)) = figure {
        keep("fig8.svg", figure.as_bytes())?;
    }
    let table = slices::of_table(input.dense);
    let white = slices::white(&table);
    let azimuths = panels::colours(&table, white, html::unit_of(input.summary));
    keep("fig9a.svg", svg::alone(azimuths).as_bytes())?;
    for (letter, subspace) in ["b", "c", "d"].into_iter().zip(Subspace::ALL) {
        let sheet: Markup = subspaces::sheet(input.dense, subspace, 1.0, white);
        let name = format!("fig9{letter}.svg");
        keep(&name, svg::alone(sheet).as_bytes())?;
    }
    Ok(written)
}

/// Writes the picture of the lit sphere alone, as a PNG of `px` × `px` pixels (for a README).
///
/// # Errors
/// When the file cannot be written.
pub fn write_sphere(path: &Path, brdf: &dyn Brdf, px: usize) -> Result<(), FileError> {
    let picture = render::sphere(brdf, &render::studio(), px, 2);
    let exposure = shots::exposure(&picture);
    write_whole_bytes(
        path,
        &png::rgba(&tone::picture_rgba(&picture, exposure), px, px),
    )
}

fn spans_alone(rig: &Rig) -> String {
    svg::alone(spans::chart(rig))
}

fn picture_png(picture: &Picture) -> Vec<u8> {
    let pixels = tone::picture_rgba(picture, shots::exposure(picture));
    png::rgba(&pixels, picture.width, picture.height)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::model::Kurt;
    use gonia_brdf::{DenseBrdf, Grid};
    use gonia_formats::Summary;
    use gonia_rig::Scale;

    #[test]
    fn a_measurement_has_the_papers_figures_as_files_that_stand_alone() {
        let dir = tempfile::tempdir().unwrap();
        let grid = Grid::with_step_deg(15.0).unwrap();
        let dense = DenseBrdf::tabulate(grid, &Kurt::two_thread_fabric());
        let summary = Summary::new("fabric", Scale::Relative);
        let rig = Rig::paper(400);
        let charts = [(RIVALS_FIGURE.to_owned(), "<svg/>".to_owned())];
        let bare = ReportInput::new(&summary, &dense);
        let folder = dir.path().join("figures");
        assert_eq!(write_figures(&folder, &bare).unwrap().len(), 6);
        let whole = ReportInput {
            rig: Some(&rig),
            charts: &charts,
            ..bare
        };
        let written = write_figures(&folder, &whole).unwrap();
        assert_eq!(written.len(), 8);
        for path in written {
            let bytes = std::fs::read(&path).unwrap();
            if path.extension().is_some_and(|e| e == "png") {
                assert!(bytes.starts_with(b"\x89PNG"), "{}", path.display());
                continue;
            }
            let text = String::from_utf8(bytes).unwrap();
            assert!(text.starts_with("<svg"), "{}", path.display());
            // No colour is left to a page that is not there.
            assert!(!text.contains("var("), "{}", path.display());
        }
    }
}
