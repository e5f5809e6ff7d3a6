//! The page: what a reader sees, in its order.

use crate::charts::{seconds, thousands};
use crate::files::RIVALS_FIGURE;
use crate::input::ReportInput;
use crate::subspaces::Subspace;
use crate::{
    albedo, baselines, charts, explorer, fits, panels, shots, slices, spans, subspaces, uncertainty,
};
use gonia_brdf::{Brdf, Grid};
use gonia_formats::{FileError, FrameCounts, Pointing, Summary, write_whole_bytes};
use gonia_render::svg::STYLE;
use gonia_rig::{Figures, Remark, Scale};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use std::path::Path;

/// Writes the report whole: one HTML file that needs no other file and no network.
///
/// # Errors
/// When the file cannot be written.
pub fn write_report(path: &Path, input: &ReportInput<'_>) -> Result<(), FileError> {
    write_whole_bytes(path, page(input).into_string().as_bytes())
}

/// The whole page.
fn page(input: &ReportInput<'_>) -> Markup {
    let summary = input.summary;
    let grid = input.dense.grid();
    html! {
        (DOCTYPE)
        html lang="en" {
            head {
                meta charset="utf-8";
                meta name="viewport" content="width=device-width, initial-scale=1";
                meta name="color-scheme" content="light dark";
                // No icon, so that a browser does not ask the network for one.
                link rel="icon" href="data:,";
                title { (summary.title) " – gonia" }
                style { (PreEscaped(STYLE)) }
            }
            body {
                main {
                    (heading(summary, grid))
                    (shown_bands(input.bands))
                    (cards(summary, grid))
                    (left_out(input.remarks))
                    (provenance(summary))
                    (renders(input))
                    (explorer::section(input.dense, unit_of(summary)))
                    (slice_sheets(input))
                    @if let Some(figures) = &summary.figures { (figures_table(figures)) }
                    @if let Some(bars) = input.errors { (uncertainty::section(bars, input.dense, summary)) }
                    (baselines::section(input.baselines, baselines_figure(input.charts)))
                    (fits::section(input.fits))
                    (session_charts(input, grid))
                    (charts_beside(input.charts))
                    (refused_and_files(summary))
                    footer.soft {
                        "Made by gonia " (env!("CARGO_PKG_VERSION")) ". This file needs nothing beside itself."
                    }
                }
            }
        }
    }
}

fn heading(summary: &Summary, grid: Grid) -> Markup {
    let scale = match summary.scale {
        Scale::Absolute => "values in 1/sr",
        Scale::Relative => "values relative, up to one factor",
    };
    html! {
        header {
            h1 { (summary.title) }
            div.soft {
                "Dense anisotropic BRDF, " (grid.n_theta()) " × " (grid.n_phi()) " directions of light and of view ("
                (grid.step_deg()) "° steps), " (scale)
            }
        }
    }
}

/// What stands for bands, where these were measured.
fn shown_bands(bands: &[String]) -> Markup {
    html! {
        @for said in bands { p.soft { (said) } }
    }
}

fn cards(summary: &Summary, grid: Grid) -> Markup {
    html! {
        div.cards {
            @if let Some(poses) = summary.poses {
                @let of = if poses.reached > poses.planned { ", those of the reference among them" } else { "" };
                (card(&thousands(poses.reached), "", &format!("poses reached{of}, plan of {}", thousands(poses.planned))))
            }
            @if let Some(frames) = &summary.frames { (frames_card(frames)) }
            @if let Some(pointing) = &summary.pointing { (pointing_card(pointing)) }
            @if let Some(bins) = &summary.bins {
                @let share = 100.0 * bins.filled as f64 / grid.n_cells() as f64;
                (card(&thousands(bins.filled), "", &format!("bins filled ({share:.1} %), of {} samples", thousands(bins.samples))))
            }
            @if let Some(cells) = summary.cells {
                (card(&thousands(cells.interpolated + cells.extrapolated), "",
                    &format!("cells interpolated, {} of them extrapolated", thousands(cells.extrapolated))))
            }
            @if let Some(interior) = summary.figures.as_ref().and_then(|f| f.stratum(gonia_rig::Stratum::Interior)) {
                (card(&format!("{:.1}", 100.0 * interior.log_rms), "%", "error in the interior (RMS of ln ratio)"))
            }
            @if !summary.stages.is_empty() {
                @let total: f64 = summary.stages.iter().map(|stage| stage.seconds).sum();
                (card(&seconds(total), "", "for the whole run"))
            }
        }
    }
}

fn card(value: &str, unit: &str, what: &str) -> Markup {
    html! {
        div.card {
            b { (value) @if !unit.is_empty() { span.unit { " " (unit) } } }
            span { (what) }
        }
    }
}

fn frames_card(frames: &FrameCounts) -> Markup {
    let refused = match frames.n_refused() {
        0 => "none refused".to_owned(),
        n => format!("{} refused", thousands(n)),
    };
    card(
        &thousands(frames.kept),
        "",
        &format!("frames kept, {refused}"),
    )
}

fn pointing_card(pointing: &Pointing) -> Markup {
    let what = format!(
        "largest pointing error (limit {}°), p99 {:.4}°",
        pointing.limit_deg, pointing.p99_deg
    );
    card(&format!("{:.4}", pointing.max_deg), "°", &what)
}

/// What is beside the data and is not shown.
fn left_out(remarks: &[Remark]) -> Markup {
    html! {
        @if !remarks.is_empty() {
            h2 { "Left out" }
            ul { @for remark in remarks { li { (remark.to_string()) } } }
        }
    }
}

fn provenance(summary: &Summary) -> Markup {
    if summary.provenance.is_empty() {
        return html! {};
    }
    html! {
        h2 { "Where it comes from" }
        table.plain {
            tbody {
                @for (name, text) in &summary.provenance {
                    tr { th scope="row" { (name.replace('_', " ")) } td { (text) } }
                }
            }
        }
    }
}

/// What the values are: 1/sr only where the file says so.
pub fn unit_of(summary: &Summary) -> &'static str {
    match summary.scale {
        Scale::Relative => "(relative)",
        Scale::Absolute => "1/sr",
    }
}

/// The factor that brings the measured values to the truth's scale, where one was fitted.
fn factor(input: &ReportInput<'_>) -> f64 {
    match (input.truth, &input.summary.figures) {
        (Some(_), Some(figures)) => figures.factor.unwrap_or(1.0),
        _ => 1.0,
    }
}

fn renders(input: &ReportInput<'_>) -> Markup {
    let drawn = shots::draw(input.dense, factor(input), input.truth);
    let class = if input.truth.is_some() {
        "shots"
    } else {
        "shots alone"
    };
    let grid = input.dense.grid();
    let last_deg = (grid.n_theta() - 1) as f64 * grid.step_deg();
    let picture = |uri: &str, name: &str, what: &str| {
        html! {
            figure {
                img src=(uri) width=(shots::PX) height=(shots::PX) alt=(format!("{name}, {what}"));
                figcaption { b { (name) } " · " (what) }
            }
        }
    };
    html! {
        h2 { "How it looks" }
        p.soft {
            "Lit by a key light from the upper left, a fill from the right, a rim from behind and a dim dome. \
             The material's x axis runs to the right, its y axis up; sphere and cloth cast no shadows. "
            "Beyond " (last_deg) "°, where the grid ends, they show the values of its last polar angle. "
            @if input.truth.is_some() {
                "Measured and true share one exposure; their difference is ΔE00 of what the screen shows."
            }
        }
        div class=(class) {
            @for shot in &drawn {
                (picture(&shot.measured, shot.name, "measured"))
                @if let Some(beside) = &shot.beside_truth {
                    (picture(&beside.truth, shot.name, "true"))
                    (picture(&beside.difference, shot.name,
                        &format!("difference, bright is ΔE {}", beside.brightest_delta_e)))
                }
            }
        }
    }
}

fn slice_sheets(input: &ReportInput<'_>) -> Markup {
    let grid = input.dense.grid();
    let mut measured = slices::of_table(input.dense);
    let factor = factor(input) as f32;
    for value in measured.iter_mut().flat_map(|slice| &mut slice.values) {
        *value = value.map(|v| v * factor);
    }
    let truth = input
        .truth
        .map(|truth: &dyn Brdf| slices::of_model(truth, grid));
    let white = slices::white(truth.as_deref().unwrap_or(&measured));
    let unit = unit_of(input.summary);
    let sheet = |drawing: Markup, name: &str, what: &str| {
        html! { figure { (drawing) figcaption { b { (name) } " · " (what) } } }
    };
    html! {
        h2 { "Slices over both azimuths" }
        p.soft {
            "Polar angle of the light from row to row, of the view from column to column. Isotropic reflection would \
             show as stripes along the diagonal; threads show as what breaks them."
        }
        div.sheets {
            (sheet(panels::colours(&measured, white, unit), "Measured", "one exposure for all panels"))
            @if let Some(truth) = &truth {
                @let ratio = slices::log_ratio(&measured, truth);
                (sheet(panels::colours(truth, white, unit), "True", "the same exposure"))
                (sheet(panels::differences(&ratio, slices::largest_difference(&ratio)), "Measured against true",
                    "mean over the channels of the log ratio; blue too dark, red too bright"))
            }
            @if let Some(mask) = input.measured.filter(|mask| mask.grid() == grid) {
                (sheet(panels::measured(&slices::of_mask(mask)), "Measured bins", "the rest is interpolated"))
            }
            @if let Some(bars) = input.errors.filter(|bars| bars.errors.grid() == grid) {
                @let of = bars.band.as_ref().map_or("mean over the channels".to_owned(),
                    |band| format!("at {}nm", band.wavelength));
                (sheet(panels::shares(&slices::relative_errors(&bars.errors, bars.values(input.dense))), "Error bars",
                    &format!("standard error as a share of the value, {of}")))
            }
        }
        h2 { "Slices over the light's polar angle" }
        p.soft { "The paper's Fig. 9 b to d, measured; the scale of colours is that of the slices above." }
        div.sheets {
            @for subspace in Subspace::ALL {
                @let drawing = subspaces::sheet(input.dense, subspace, factor, white);
                (sheet(html! { div.wide.fine { (drawing) } }, subspace.name(), "measured"))
            }
        }
    }
}

/// The figure of the baselines, where it is among the charts.
fn baselines_figure(charts: &[(String, String)]) -> Option<String> {
    let figure = charts.iter().find(|(name, _)| name == RIVALS_FIGURE);
    figure.map(|(_, svg)| svg_uri(svg))
}

/// Charts that others made, as they are; the page's style does not reach into an image.
fn charts_beside(charts: &[(String, String)]) -> Markup {
    let charts: Vec<_> = charts
        .iter()
        .filter(|(name, _)| name != RIVALS_FIGURE)
        .collect();
    html! {
        @if !charts.is_empty() {
            h2 { "Cost and accuracy" }
            div.sheets {
                @for (name, svg) in charts {
                    figure.chart { img src=(svg_uri(svg)) alt=(name); figcaption { (name) } }
                }
            }
        }
    }
}

fn svg_uri(svg: &str) -> String {
    use base64::Engine as _;
    let text = base64::engine::general_purpose::STANDARD.encode(svg);
    format!("data:image/svg+xml;base64,{text}")
}

fn figures_table(figures: &Figures) -> Markup {
    let optional = |value: Option<f64>, digits: usize| match value {
        Some(value) => format!("{value:.digits$}"),
        None => "–".to_owned(),
    };
    html! {
        h2 { "Figures of merit" }
        p.soft { (figures.basis()) "." }
        div.wide {
            table {
                thead { tr {
                    th { "part of the domain" }
                    th.num { "cells" }
                    th.num { "log RMS" }
                    th.num { "log mean" }
                    th.num { "cos-weighted" }
                    th.num { "p99" }
                    th.num { "ΔE00" }
                    th.num { "reciprocity" }
                } }
                tbody {
                    @for row in &figures.strata {
                        tr {
                            td { (row.stratum.name()) " " span.soft { (row.stratum.meaning()) } }
                            td.num { (thousands(row.cells)) }
                            td.num { (format!("{:.4}", row.log_rms)) }
                            td.num { (format!("{:+.4}", row.log_mean)) }
                            td.num { (format!("{:.2} %", 100.0 * row.cos_error_mean)) }
                            td.num { (format!("{:.1} %", 100.0 * row.cos_error_p99)) }
                            td.num { (optional(row.delta_e, 2)) }
                            td.num { @if row.reciprocity_a == 0.0 { "exact" } @else { (format!("{:.1e}", row.reciprocity_a)) } }
                        }
                    }
                }
            }
        }
        p.soft {
            "Rendered: mean ΔE00 of the sphere " (format!("{:.2}", figures.sphere_delta_e)) ", of the cylinder "
            (format!("{:.2}", figures.cylinder_delta_e)) ". Log RMS: root mean square of ln(" (figures.a) "/" (figures.b)
            "). Cos-weighted: |difference|·cosθi·cosθv over the mean of " (figures.b) "·cosθi·cosθv. ΔE00 of π·f as a \
             reflectance. Reciprocity: root mean square of ln(f(i, v)/f(v, i)) of " (figures.a) "."
        }
    }
}

fn session_charts(input: &ReportInput<'_>, grid: Grid) -> Markup {
    let summary = input.summary;
    html! {
        div.charts {
            (albedo::section(input.dense, summary.scale))
            @if let Some(rig) = input.rig {
                section {
                    h2 { "Span of a frame" }
                    figure {
                        (spans::chart(rig))
                        figcaption { "By how much polar angles differ from the arm's at the edges of the sampled disc, eq. (2)" }
                    }
                }
            }
            @if let Some(pointing) = &summary.pointing {
                section {
                    h2 { "Pointing" }
                    figure {
                        (charts::pointing(pointing))
                        figcaption { (thousands(pointing.counts.iter().sum())) " readings of kept frames" }
                    }
                }
            }
            @if !summary.stages.is_empty() {
                section { h2 { "Time by stage" } figure { (charts::stages(&summary.stages)) } }
            }
            @if let Some(bins) = &summary.bins {
                section {
                    h2 { "Bins filled" }
                    figure {
                        (charts::bins(bins, grid.step_deg()))
                        figcaption { "Share of all azimuth pairs with at least one sample" }
                    }
                }
            }
        }
    }
}

fn refused_and_files(summary: &Summary) -> Markup {
    let refused = summary
        .frames
        .as_ref()
        .map_or(&[][..], |frames| &frames.refused);
    html! {
        @if !refused.is_empty() {
            h2 { "Frames refused" }
            table.plain { tbody {
                @for row in refused { tr { th scope="row" { (thousands(row.count)) } td { (row.reason) } } }
            } }
        }
        @if !summary.files.is_empty() {
            h2 { "Files" }
            table { tbody {
                @for file in &summary.files {
                    tr { td { (file.path) } td.num { (megabytes(file.bytes)) } td { (file.what) } }
                }
            } }
        }
    }
}

fn megabytes(bytes: u64) -> String {
    match bytes {
        0..1_000 => format!("{bytes} B"),
        1_000..1_000_000 => format!("{:.1} kB", bytes as f64 / 1e3),
        _ => format!("{:.1} MB", bytes as f64 / 1e6),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::uncertainty::ErrorBars;
    use gonia_brdf::DenseBrdf;
    use gonia_brdf::Elementary;
    use gonia_brdf::model::Kurt;
    use gonia_formats::{BinCounts, CellCounts, FileNote, FrameCounts, PoseCounts, Refused, Stage};
    use gonia_pipeline::compare::Table;
    use gonia_pipeline::{Options, Side, compare};
    use gonia_rig::CellMask;

    /// A table of the demo's material with the errors a measurement might have.
    fn measured_fabric(step_deg: f64) -> (DenseBrdf, CellMask) {
        let truth = Kurt::two_thread_fabric();
        let grid = Grid::with_step_deg(step_deg).unwrap();
        let n = grid.n_directions();
        let at: Vec<_> = (0..n).map(|k| grid.direction(k)).collect();
        let mut planes = [0, 1, 2].map(|_| Vec::with_capacity(grid.n_cells()));
        let mut measured = Vec::new();
        for light in 0..n {
            for view in 0..n {
                let (i, v) = (at[light], at[view]);
                let wobble = 1.0
                    + 0.03 * (7.0 * i.phi).sine() * (5.0 * v.phi).cosine()
                    + 0.05 * (i.theta_deg().max(v.theta_deg()) / 86.0).powi(8);
                let f = truth.eval(i.to_vec3(), v.to_vec3());
                for (plane, f) in planes.iter_mut().zip(f) {
                    plane.push((f * wobble) as f32);
                }
                if i.theta_deg() <= 86.0 && v.theta_deg() <= 78.0 && (light + 3 * view) % 19 == 0 {
                    measured.push(grid.cell(light, view));
                }
            }
        }
        (
            DenseBrdf::new(grid, planes).unwrap(),
            CellMask::from_cells(grid, measured),
        )
    }

    /// Errors of noise, combined with what the rig's defaults add.
    fn error_bars(dense: &DenseBrdf, rig: &gonia_rig::Rig) -> ErrorBars {
        let calibration = gonia_rig::ReferenceCalibration::KnownReference;
        let lengths = [1000.0, 1800.0, 14.0];
        let budget = gonia_rig::Budget::new(calibration, 0.3, lengths, |input| rig.input(input));
        let grid = dense.grid();
        let plane = &dense.planes()[1];
        let noise: Vec<f32> = plane.iter().map(|f| 0.01 * f).collect();
        let holding = (&noise[..], gonia_pipeline::budget::Holding::Noise);
        let cells =
            gonia_pipeline::budget::CellBudget::new(grid, plane, holding, &[], &budget).unwrap();
        let u = |cell: usize| {
            let shares = cells.shares(cell).unwrap();
            let square: f64 = shares.iter().map(|share| share * share).sum();
            (square.sqrt() * f64::from(plane[cell])) as f32
        };
        let errors: Vec<f32> = (0..grid.n_cells()).map(u).collect();
        let provenance = [
            ("uncertainties".to_owned(), budget.to_string()),
            ("reference.certificate".to_owned(), "PTB 4711".to_owned()),
        ];
        ErrorBars {
            errors: DenseBrdf::new(grid, [errors.clone(), errors.clone(), errors]).unwrap(),
            band: None,
            origins: Vec::new(),
            provenance: provenance.into(),
        }
    }

    fn full_summary(dense: &DenseBrdf, mask: &CellMask, truth: &dyn Brdf) -> Summary {
        let mut summary = Summary::new("Two-thread fabric <gold & green>", Scale::Absolute);
        for (name, text) in [
            ("rig", "simulated, seed 7"),
            ("plan", "81 × (81 + 24) poses"),
        ] {
            summary.provenance.insert(name.into(), text.into());
        }
        summary.poses = Some(PoseCounts {
            planned: 8505,
            reached: 17_010,
        });
        let refused = vec![Refused {
            reason: "fiducial lines not found".into(),
            count: 4,
        }];
        summary.frames = Some(FrameCounts {
            kept: 17_006,
            refused,
        });
        let errors: Vec<f64> = (0..4000)
            .map(|k| 0.011 * (f64::from(k) * 0.37).sine().powi(3))
            .collect();
        summary.pointing = Pointing::from_errors(&errors, 0.03);
        summary.bins = Some(BinCounts::new(10_418_625, mask));
        let measured = mask.count() as u64;
        summary.cells = Some(CellCounts {
            measured,
            interpolated: mask.grid().n_cells() as u64 - measured - 1000,
            extrapolated: 1000,
        });
        let table = Table {
            brdf: dense,
            scale: Scale::Absolute,
        };
        summary.figures = Some(compare(table, Side::Model(truth), &Options::default()).unwrap());
        for (name, seconds) in [
            ("plan", 0.03),
            ("capture", 187.0),
            ("bin", 1.4),
            ("fill", 21.5),
            ("write", 1.5),
        ] {
            summary.stages.push(Stage {
                name: name.into(),
                seconds,
            });
        }
        summary.files.push(FileNote {
            path: "dense.exr".into(),
            bytes: 752_700_000,
            what: "dense BRDF".into(),
        });
        summary
    }

    #[test]
    fn a_full_report_is_one_file_that_asks_for_no_other() {
        let truth = Kurt::two_thread_fabric();
        let (dense, mask) = measured_fabric(10.0);
        let summary = full_summary(&dense, &mask, &truth);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("report.html");
        let rig = gonia_rig::Rig::paper(400);
        let bars = error_bars(&dense, &rig);
        let input = ReportInput {
            truth: Some(&truth),
            measured: Some(&mask),
            errors: Some(&bars),
            rig: Some(&rig),
            ..ReportInput::new(&summary, &dense)
        };
        write_report(&path, &input).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        for (place, _) in text
            .match_indices("src=\"")
            .chain(text.match_indices("href=\""))
        {
            let address = text[place..].split('"').nth(1).unwrap();
            assert!(
                address.starts_with("data:"),
                "{}",
                &address[..address.len().min(80)]
            );
        }
        assert!(!text.contains("@import") && !text.contains("url("));
        assert!(!text.contains("<script src") && !text.contains("fetch("));
        for said in [
            "Through the data",
            "Span of a frame",
            "Pointing",
            "Time by stage",
            "Bins filled",
            "Figures of merit",
            "Frames refused",
            "Files",
        ] {
            assert!(text.contains(&format!("<h2>{said}</h2>")), "{said}");
        }
        for said in [
            "expanded, U (k = 2)",
            "BRDF values (1/sr) carry an expanded uncertainty",
            "certificate PTB 4711",
            "The largest contribution",
            "What would make it better",
            "a reference with a certificate",
        ] {
            assert!(text.contains(said), "{said}");
        }
        // Five sheets of nine panels and their scales, one without, three of subspaces, the map of bins and its scale.
        assert_eq!(
            text.matches("<image").count(),
            5 * 10 + 9 + 18 + 18 + 36 + 2
        );
        assert_eq!(text.matches("<img").count(), 6);
        assert!(text.contains("Two-thread fabric &lt;gold &amp; green&gt;"));
    }

    #[test]
    fn a_report_of_the_dense_brdf_alone_leaves_out_what_is_not_known() {
        let (dense, _) = measured_fabric(15.0);
        let summary = Summary::new("somebody's BRDF", Scale::Relative);
        let input = ReportInput::new(&summary, &dense);
        let text = page(&input).into_string();
        assert!(!text.contains("Pointing") && !text.contains("Figures of merit"));
        assert!(!text.contains("Uncertainty"));
        assert!(!text.contains("Measured against true"));
        assert!(text.contains("(relative)") && text.contains("values relative"));
        assert_eq!(text.matches("<img").count(), 2);
    }

    #[test]
    #[ignore = "writes a page to look at: report-sample.html in the folder for temporary files"]
    fn a_page_to_look_at() {
        let truth = Kurt::two_thread_fabric();
        let (dense, mask) = measured_fabric(4.0);
        let summary = full_summary(&dense, &mask, &truth);
        let rig = gonia_rig::Rig::paper(400);
        let bars = error_bars(&dense, &rig);
        let input = ReportInput {
            truth: Some(&truth),
            measured: Some(&mask),
            errors: Some(&bars),
            rig: Some(&rig),
            ..ReportInput::new(&summary, &dense)
        };
        let start = std::time::Instant::now();
        let drawn = shots::draw(&dense, 1.0, None);
        println!(
            "sphere and cylinder of {} px: {:?}",
            shots::PX,
            start.elapsed()
        );
        assert_eq!(drawn.len(), 2);
        let path = std::env::temp_dir().join("report-sample.html");
        let start = std::time::Instant::now();
        write_report(&path, &input).unwrap();
        println!("{}: {:?}", path.display(), start.elapsed());
    }
}
