//! Other ways to the same BRDF: their table, and the paper's Fig. 8.

use crate::{charts, shots};
use gonia_brdf::{Brdf, DenseBrdf, Direction};
use gonia_formats::baselines_toml::{BaselineRow, BaselineTable};
use gonia_render as render;
use gonia_render::{Environment, Light, Picture, Tabulated, png, svg, tone};
use gonia_rig::{Figures, Stratum};
use maud::{Markup, PreEscaped, html};

/// The table, and the figure (an image's address) where there is one; nothing without a comparison.
pub(crate) fn section(baselines: Option<&BaselineTable>, figure: Option<String>) -> Markup {
    let Some(baselines) = baselines else {
        return html! {};
    };
    let has_truth = baselines.rows.iter().any(|row| row.against_truth.is_some());
    html! {
        h2 { "Other ways to the same data" }
        p.soft {
            "From the samples of the same session. RMS of the log ratio in the interior and at grazing angles, \
             cosine-weighted error, mean ΔE00 of a rendered sphere; first against the dense measurement"
            @if has_truth { ", then against the truth" } ". Ways marked * were computed at a share of the cells."
        }
        div.wide { table {
            thead { tr {
                th { "way" } th.num { "numbers kept" } th.num { "time" }
                th.num { "interior" } th.num { "grazing" } th.num { "cos" } th.num { "ΔE" }
                @if has_truth { th.num { "interior" } th.num { "grazing" } th.num { "cos" } th.num { "ΔE" } }
            } }
            tbody { @for row in &baselines.rows { (table_row(row, has_truth)) } }
        } }
        @if let Some(uri) = figure {
            figure.chart {
                img src=(uri) alt="a slice and three renders of each way";
                figcaption {
                    "The paper's Fig. 8: a slice over both azimuths at 74°/74° and three renders; each column at \
                     the exposure of its first row."
                }
            }
        }
    }
}

fn table_row(row: &BaselineRow, has_truth: bool) -> Markup {
    html! {
        tr {
            td { (row.name) @if row.is_partial { "*" } " " span.soft { (row.what) } }
            td.num { (charts::thousands(row.numbers)) }
            td.num { (charts::seconds(row.seconds)) }
            (figures(row.against_dense.as_ref(), row.is_partial))
            @if has_truth { (figures(row.against_truth.as_ref(), row.is_partial)) }
        }
    }
}

fn figures(figures: Option<&Figures>, is_partial: bool) -> Markup {
    let log_rms = |stratum| {
        let row = figures.and_then(|f| f.stratum(stratum));
        row.map_or("–".to_owned(), |row| format!("{:.3}", row.log_rms))
    };
    let cosine = figures
        .and_then(|f| f.stratum(Stratum::All))
        .map_or("–".to_owned(), |row| {
            format!("{:.1} %", 100.0 * row.cos_error_mean)
        });
    let sphere = figures
        .filter(|_| !is_partial)
        .map_or("–".to_owned(), |f| format!("{:.2}", f.sphere_delta_e));
    html! {
        td.num { (log_rms(Stratum::Interior)) }
        td.num { (log_rms(Stratum::Grazing)) }
        td.num { (cosine) }
        td.num { (sphere) }
    }
}

/// Pixels a side of the pictures in the figure.
const PX: usize = 220;
/// Polar angles of its slice, degrees: the paper's.
const SLICE_DEG: f64 = 74.0;
/// Directional lights that stand for the sky, as in the paper.
const SKY_LIGHTS: usize = 512;

/// The pictures of one table: the slice over both azimuths, then three renders.
pub struct BaselinePictures {
    name: String,
    slice: Vec<[f32; 3]>,
    pictures: [Picture; 3],
}

/// Draws what stands in a row of the figure.
pub fn draw_baseline(name: &str, dense: &DenseBrdf) -> BaselinePictures {
    let brdf = Tabulated::new(dense);
    let sky = Environment::sky().lights(SKY_LIGHTS);
    let slice = (0..PX * PX)
        .map(|at| {
            let phi = |k: usize| (k as f64 + 0.5) / PX as f64 * 360.0;
            let (column, row) = (at % PX, PX - 1 - at / PX);
            let light = Direction::from_deg(SLICE_DEG, phi(row));
            dense.lookup(light, Direction::from_deg(SLICE_DEG, phi(column)))
        })
        .collect();
    let draw = |shape: fn(&dyn Brdf, &[Light], usize, usize) -> Picture, lights: &[Light]| {
        shape(&brdf, lights, PX, 1).with_smooth_outline()
    };
    BaselinePictures {
        name: name.to_owned(),
        slice,
        pictures: [
            draw(render::sphere, &render::single()),
            draw(render::sphere, &sky),
            draw(render::cylinder, &render::single()),
        ],
    }
}

/// The figure, as an SVG by itself; every column at the exposure of its first row.
pub fn figure(rows: &[BaselinePictures]) -> String {
    const SIDE: f64 = 200.0;
    const LEFT: f64 = 104.0;
    const TOP: f64 = 30.0;
    const GAP: f64 = 10.0;
    let Some(first) = rows.first() else {
        return String::new();
    };
    let white = slice_white(&first.slice);
    let exposures = [0, 1, 2].map(|k: usize| shots::exposure(&first.pictures[k]));
    let columns = [
        "φi against φv at 74°/74°",
        "sphere, light from above",
        "sphere, sky of 512 lights",
        "cylinder, light from above",
    ];
    let place = |column: usize, row: usize| {
        (
            LEFT + column as f64 * (SIDE + GAP),
            TOP + row as f64 * (SIDE + GAP),
        )
    };
    let (width, height) = place(columns.len(), rows.len());
    let style = "text{font:13px system-ui,sans-serif;fill:#333}.frame{fill:none;stroke:#ccc}";
    let drawing = html! {
        svg xmlns="http://www.w3.org/2000/svg" viewBox=(format!("0 0 {} {}", svg::n(width), svg::n(height))) {
            style { (PreEscaped(style)) }
            @for (k, name) in columns.iter().enumerate() {
                (svg::text(place(k, 0).0 + 0.5 * SIDE, 20.0, "middle", "title", name))
            }
            @for (k, row) in rows.iter().enumerate() {
                @let (x, y) = place(0, k);
                (svg::text(LEFT - 10.0, y + 0.5 * SIDE, "end", "title", &row.name))
                @let pixels: Vec<[u8; 3]> = row.slice.iter().map(|v| tone::rgb8(*v, 1.0 / white)).collect();
                (svg::image(x, y, SIDE, SIDE, &png::data_uri(&png::rgb(&pixels, PX, PX))))
                (svg::rect(x, y, SIDE, SIDE, "frame"))
                @for (j, picture) in row.pictures.iter().enumerate() {
                    @let (x, y) = place(j + 1, k);
                    @let pixels = tone::picture_rgba(picture, exposures[j]);
                    (svg::image(x, y, SIDE, SIDE, &png::data_uri(&png::rgba(&pixels, PX, PX))))
                }
            }
        }
    };
    drawing.into_string()
}

fn slice_white(slice: &[[f32; 3]]) -> f32 {
    let mut values: Vec<f32> = slice
        .iter()
        .map(|rgb| gonia_render::color::luminance(*rgb))
        .collect();
    let rank = values.len() * 97 / 100;
    match values.get(rank) {
        Some(_) => values
            .select_nth_unstable_by(rank, f32::total_cmp)
            .1
            .max(1e-9),
        None => 1.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Grid;
    use gonia_brdf::model::Kurt;

    #[test]
    fn the_figure_has_a_slice_and_three_pictures_a_row() {
        let grid = Grid::with_step_deg(15.0).unwrap();
        let dense = DenseBrdf::tabulate(grid, &Kurt::two_thread_fabric());
        let rows = [
            draw_baseline("dense", &dense),
            draw_baseline("kurt2", &dense),
        ];
        let drawn = figure(&rows);
        assert_eq!(drawn.matches("<image").count(), 8);
        assert!(drawn.contains(">dense<") && drawn.contains(">kurt2<"));
        assert!(section(None, None).into_string().is_empty());
    }
}
