//! The subspaces of the paper's Fig. 9 b–d: polar angle of the light against an azimuth or the
//! polar angle of the view, the other two angles from panel to panel.

use gonia_brdf::{DenseBrdf, Direction};
use gonia_render::{png, svg, tone};
use maud::{Markup, html};

/// The azimuths that panels stand for, degrees.
const PHI_DEG: [f64; 6] = [0.0, 60.0, 120.0, 180.0, 240.0, 300.0];
/// The polar angles.
const THETA_DEG: [f64; 3] = [30.0, 60.0, 74.0];

/// A part of the figure. The polar angle of the light runs upwards in all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subspace {
    /// b: φv to the right; φi from column to column, θv from row to row.
    ViewAzimuth,
    /// c: φi to the right; φv from column to column, θv from row to row.
    LightAzimuth,
    /// d: θv to the right; φi from column to column, φv from row to row.
    ViewPolarAngle,
}

impl Subspace {
    /// All, in the figure's order.
    pub const ALL: [Subspace; 3] = [
        Subspace::ViewAzimuth,
        Subspace::LightAzimuth,
        Subspace::ViewPolarAngle,
    ];

    /// What is drawn, in a few words.
    pub fn name(self) -> &'static str {
        match self {
            Subspace::ViewAzimuth => "θi against φv",
            Subspace::LightAzimuth => "θi against φi",
            Subspace::ViewPolarAngle => "θi against θv",
        }
    }

    fn axis(self) -> &'static str {
        match self {
            Subspace::ViewAzimuth => "azimuth of the view φv",
            Subspace::LightAzimuth => "azimuth of the light φi",
            Subspace::ViewPolarAngle => "polar angle of the view θv",
        }
    }

    fn rows(self) -> &'static [f64] {
        match self {
            Subspace::ViewPolarAngle => &PHI_DEG,
            _ => &THETA_DEG,
        }
    }

    fn title(self, column_deg: f64, row_deg: f64) -> String {
        match self {
            Subspace::ViewAzimuth => format!("φi {column_deg}° θv {row_deg}°"),
            Subspace::LightAzimuth => format!("φv {column_deg}° θv {row_deg}°"),
            Subspace::ViewPolarAngle => format!("φi {column_deg}° φv {row_deg}°"),
        }
    }

    /// Light and view at a place of a panel.
    fn directions(self, column: f64, row: f64, right: f64, theta_i: f64) -> (Direction, Direction) {
        let d = Direction::from_deg;
        match self {
            Subspace::ViewAzimuth => (d(theta_i, column), d(row, right)),
            Subspace::LightAzimuth => (d(theta_i, right), d(row, column)),
            Subspace::ViewPolarAngle => (d(theta_i, column), d(right, row)),
        }
    }
}

/// One part of the figure; `white` is the value that shows as white, shared by all of them.
pub fn sheet(dense: &DenseBrdf, subspace: Subspace, factor: f32, white: f32) -> Markup {
    const LEFT: f64 = 44.0;
    const GAP: f64 = 8.0;
    const TOP: f64 = 20.0;
    const WIDTH: f64 = 92.0;
    let grid = dense.grid();
    let theta_max = (grid.n_theta() - 1) as f64 * grid.step_deg();
    let is_square = subspace == Subspace::ViewPolarAngle;
    let height = if is_square { WIDTH } else { 64.0 };
    let (columns, right_max) = if is_square {
        (grid.n_theta(), theta_max)
    } else {
        (grid.n_phi(), 360.0)
    };
    let rows = subspace.rows();
    let bottom = rows.len() as f64 * (height + TOP);
    let ticks: &[f64] = if is_square {
        &[0.0, 30.0, 60.0]
    } else {
        &[0.0, 180.0]
    };
    let panel = |column: usize, row: usize| {
        let (column_deg, row_deg) = (PHI_DEG[column], rows[row]);
        let mut pixels = Vec::with_capacity(columns * grid.n_theta());
        for up in (0..grid.n_theta()).rev() {
            for right in 0..columns {
                let (light, view) = subspace.directions(
                    column_deg,
                    row_deg,
                    right as f64 * grid.step_deg(),
                    up as f64 * grid.step_deg(),
                );
                pixels.push(tone::rgb8(dense.lookup(light, view), factor / white));
            }
        }
        let uri = png::data_uri(&png::rgb(&pixels, columns, grid.n_theta()));
        let x = LEFT + column as f64 * (WIDTH + GAP);
        let y = TOP + row as f64 * (height + TOP);
        html! {
            (svg::image(x, y, WIDTH, height, &uri))
            (svg::rect(x, y, WIDTH, height, "frame"))
            (svg::text(x + 0.5 * WIDTH, y - 4.0, "middle", "small", &subspace.title(column_deg, row_deg)))
            @for tick in ticks {
                @let along = tick / right_max * WIDTH;
                (svg::line(x + along, y + height, x + along, y + height + 3.0, "tick"))
                @if row + 1 == rows.len() {
                    (svg::text(x + along, y + height + 13.0, "middle", "small", &format!("{tick}°")))
                }
            }
            @for tick in [0.0, 30.0, 60.0] {
                @let along = y + height * (1.0 - tick / theta_max);
                (svg::line(x - 3.0, along, x, along, "tick"))
                @if column == 0 {
                    (svg::text(x - 5.0, along + 3.0, "end", "small", &format!("{tick}°")))
                }
            }
        }
    };
    let whole_width = LEFT + 6.0 * WIDTH + 5.0 * GAP + 12.0;
    let inside = html! {
        @for row in 0..rows.len() { @for column in 0..PHI_DEG.len() { (panel(column, row)) } }
        (svg::text(LEFT + 3.0 * WIDTH, bottom + 32.0, "middle", "axis", subspace.axis()))
        g transform=(format!("translate(11 {}) rotate(-90)", svg::n(0.5 * bottom))) {
            (svg::text(0.0, 0.0, "middle", "axis", "polar angle of the light θi"))
        }
    };
    svg::drawing(whole_width, bottom + 38.0, subspace.name(), inside)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Grid;

    #[test]
    fn every_part_has_its_panels_and_its_axes() {
        let grid = Grid::with_step_deg(15.0).unwrap();
        let plane = vec![0.3; grid.n_cells()];
        let dense = DenseBrdf::new(grid, [plane.clone(), plane.clone(), plane]).unwrap();
        for (subspace, panels) in Subspace::ALL.into_iter().zip([18, 18, 36]) {
            let drawn = sheet(&dense, subspace, 1.0, 1.0).into_string();
            assert_eq!(drawn.matches("<image").count(), panels);
            assert!(drawn.contains(subspace.axis()) && drawn.contains("θi"));
        }
        let (light, view) = Subspace::LightAzimuth.directions(60.0, 30.0, 10.0, 20.0);
        assert!((light.theta_deg() - 20.0).abs() + (light.phi_deg() - 10.0).abs() < 1e-9);
        assert!((view.theta_deg() - 30.0).abs() + (view.phi_deg() - 60.0).abs() < 1e-9);
    }
}
