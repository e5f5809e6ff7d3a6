//! Sliders through the four-dimensional data, and a lit sphere to turn: a reduced table inside the
//! page and a script that draws from it.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use gonia_brdf::Elementary;
use gonia_brdf::{DenseBrdf, Grid};
use gonia_render::color::luminance;
use maud::{Markup, PreEscaped, html};

const SCRIPT: &str = include_str!("explorer.js");
/// Finest steps of the reduced table in polar angle and azimuth, degrees: 22 × 60 directions, 3.5 MB
/// of text.
const THETA_STEP_DEG: f64 = 4.0;
const PHI_STEP_DEG: f64 = 6.0;
/// Below this share of the largest value everything is black.
const DYNAMIC_RANGE: f32 = 2e-5;

/// A table of fewer directions, a byte a channel, and only one of two mirrored pairs.
struct Reduced {
    theta_deg: Vec<f64>,
    n_phi: usize,
    least: f32,
    most: f32,
    white: f32,
    bytes: Vec<u8>,
}

/// The part of the page.
pub fn section(dense: &DenseBrdf, unit: &str) -> Markup {
    let reduced = Reduced::new(dense);
    let meta = format!(
        "{{\"thetaDeg\":{:?},\"nPhi\":{},\"least\":{:e},\"most\":{:e},\"white\":{:e},\"unit\":\"{}\"}}",
        reduced.theta_deg,
        reduced.n_phi,
        reduced.least,
        reduced.most,
        reduced.white,
        if unit == "1/sr" { " 1/sr" } else { "" }
    );
    let slider = |id: &str, name: Markup, low: &str, high: &str, step: &str, start: &str| {
        html! {
            label {
                span { (name) " " output id=(format!("{id}-value")) {} }
                input type="range" id=(id) min=(low) max=(high) step=(step) value=(start);
            }
        }
    };
    let axis = |id: &str, name: &str, chosen: usize| {
        html! {
            label {
                span { (name) }
                select id=(id) {
                    @for (k, angle) in ["θi (light)", "φi (light)", "θv (view)", "φv (view)"].iter().enumerate() {
                        option value=(k) selected[k == chosen] { (angle) }
                    }
                }
            }
        }
    };
    let named = |id: &str| html! { span id=(format!("{id}-name")) {} };
    html! {
        h2 { "Through the data" }
        p.soft {
            "Any two angles against the other two, and a sphere under one light; drawn by the page itself from every "
            (reduced.theta_deg.get(1).copied().unwrap_or_default()) "° of polar angle and " (360 / reduced.n_phi)
            "° of azimuth, linear between."
        }
        div #explorer {
            figure {
                canvas #slice width="600" height="600" aria-label="a slice through the data" {}
                div.controls {
                    (axis("axis-x", "to the right", 3))
                    (axis("axis-y", "upwards", 1))
                    (slider("rest-a", named("rest-a"), "0", "1", "0.005", "0.7"))
                    (slider("rest-b", named("rest-b"), "0", "1", "0.005", "0.7"))
                    (slider("slice-exposure", html! { "exposure" }, "-4", "6", "0.25", "0"))
                }
            }
            figure {
                canvas #ball width="300" height="300" aria-label="a lit sphere" {}
                div.controls {
                    (slider("light-azimuth", html! { "light, around" }, "-180", "180", "2", "-35"))
                    (slider("light-height", html! { "light, height" }, "-80", "80", "2", "40"))
                    (slider("material-turn", html! { "material, turned" }, "0", "180", "2", "0"))
                    (slider("ball-exposure", html! { "exposure" }, "-4", "4", "0.25", "0"))
                }
            }
        }
        script #explorer-meta type="application/json" { (PreEscaped(meta)) }
        script #explorer-cells type="application/octet-stream" { (PreEscaped(STANDARD.encode(&reduced.bytes))) }
        script { (PreEscaped(SCRIPT)) }
    }
}

impl Reduced {
    fn new(dense: &DenseBrdf) -> Self {
        let grid = dense.grid();
        let (each_theta, each_phi) = steps(grid);
        let rings: Vec<usize> = (0..grid.n_theta()).step_by(each_theta).collect();
        let azimuths: Vec<usize> = (0..grid.n_phi()).step_by(each_phi).collect();
        let nodes: Vec<usize> = rings
            .iter()
            .flat_map(|t| azimuths.iter().map(move |p| t * grid.n_phi() + p))
            .collect();
        // A table of others may not be reciprocal: the mean of both orders stands for both.
        let value = |a: usize, b: usize| {
            let (f, g) = (dense.at(a, b), dense.at(b, a));
            [0, 1, 2].map(|c| 0.5 * (f[c] + g[c]))
        };
        let pairs = || {
            let nodes = &nodes;
            (0..nodes.len()).flat_map(move |a| nodes[a..].iter().map(move |b| (nodes[a], *b)))
        };
        let mut luminances: Vec<f32> = pairs()
            .step_by(7)
            .map(|(a, b)| luminance(value(a, b)))
            .collect();
        let rank = (luminances.len() * 985 / 1000).min(luminances.len().saturating_sub(1));
        let white = match luminances.get_mut(rank) {
            Some(_) => luminances
                .select_nth_unstable_by(rank, f32::total_cmp)
                .1
                .max(1e-9),
            None => 1.0,
        };
        let most = pairs().flat_map(|(a, b)| value(a, b)).fold(white, f32::max);
        let least = DYNAMIC_RANGE * most;
        let scale = 255.0 / (most / least).natural_log();
        let code = |v: f32| (scale * (v.max(least) / least).natural_log() + 0.5) as u8;
        Self {
            theta_deg: rings.iter().map(|t| *t as f64 * grid.step_deg()).collect(),
            n_phi: azimuths.len(),
            least,
            most,
            white,
            bytes: pairs().flat_map(|(a, b)| value(a, b).map(code)).collect(),
        }
    }
}

/// Every how many nodes of polar angle and of azimuth are kept.
fn steps(grid: Grid) -> (usize, usize) {
    let theta = (THETA_STEP_DEG / grid.step_deg()).ceil().max(1.0) as usize;
    let least = (PHI_STEP_DEG / grid.step_deg()).ceil().max(1.0) as usize;
    let phi = (least..).find(|each| grid.n_phi().is_multiple_of(*each));
    (theta, phi.unwrap_or(1))
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Brdf;
    use gonia_brdf::model::Kurt;

    #[test]
    fn the_reduced_table_holds_the_values_to_a_few_per_cent() {
        let model = Kurt::two_thread_fabric();
        let grid = Grid::with_step_deg(5.0).unwrap();
        let reduced = Reduced::new(&DenseBrdf::tabulate(grid, &model));
        assert_eq!(reduced.theta_deg[..3], [0.0, 5.0, 10.0]);
        assert_eq!(reduced.n_phi, 36);
        let n = reduced.theta_deg.len() * reduced.n_phi;
        assert_eq!(reduced.bytes.len(), 3 * n * (n + 1) / 2);
        // The pair of node 40 (θ 5°, φ 40°) and node 75 (10°, 30°).
        let (a, b) = (40, 75);
        let at = 3 * (a * n - a * (a - 1) / 2 + (b - a));
        let at_deg = |t, p| gonia_brdf::Direction::from_deg(t, p).to_vec3();
        let truth = model.eval(at_deg(5.0, 40.0), at_deg(10.0, 30.0));
        for c in 0..3 {
            let share = f32::from(reduced.bytes[at + c]) / 255.0;
            let value = reduced.least * (reduced.most / reduced.least).power(share);
            assert!((f64::from(value) / truth[c] - 1.0).abs() < 0.03);
        }
    }

    #[test]
    fn the_papers_grid_stays_small() {
        assert_eq!(steps(Grid::PAPER), (2, 3));
        let n: usize = 22 * 60;
        assert!(3 * n * (n + 1) / 2 * 4 / 3 < 3_600_000);
    }
}
