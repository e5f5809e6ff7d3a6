//! The spans of polar angle within one frame, as the paper's Fig. 3: eqs. (1) and (2).

use gonia_brdf::Direction;
use gonia_brdf::Elementary;
use gonia_brdf::direction::local_direction;
use gonia_render::svg;
use gonia_rig::Rig;
use maud::{Markup, html};

/// The change of polar angle at the edges of the disc, towards the arm and away from it, degrees.
fn span_deg(theta_deg: f64, distance_m: f64, radius_m: f64) -> [f64; 2] {
    let arm = Direction::from_deg(theta_deg, 0.0);
    [radius_m, -radius_m].map(|x| {
        let d = local_direction(arm, distance_m, [x, 0.0]);
        d[0].arc_tangent2(d[2]).to_degrees() - theta_deg
    })
}

/// Both spans over the polar angle of the arm.
pub fn chart(rig: &Rig) -> Markup {
    const W: f64 = 380.0;
    const H: f64 = 240.0;
    const LEFT: f64 = 44.0;
    const RIGHT: f64 = 12.0;
    const TOP: f64 = 12.0;
    const BOTTOM: f64 = 40.0;
    const LIMIT_DEG: f64 = 20.0;
    let radius_m = rig.sampling.disc_radius_mm * 1e-3;
    let x = |theta: f64| LEFT + (W - LEFT - RIGHT) * theta / 90.0;
    let y = |span: f64| {
        let share = (span / LIMIT_DEG).clamp(-1.0, 1.0);
        TOP + (H - TOP - BOTTOM) * 0.5 * (1.0 - share)
    };
    let curve = |distance_m: f64, edge: usize| {
        (0..=44)
            .map(|k| 2.0 * f64::from(k))
            .map(|theta| {
                let span = span_deg(theta, distance_m, radius_m)[edge];
                format!("{},{}", svg::n(x(theta)), svg::n(y(span)))
            })
            .collect::<Vec<String>>()
            .join(" ")
    };
    let arms = [
        (rig.light.distance_m, "var(--mark)", "light"),
        (rig.camera.distance_m, "var(--bar)", "camera"),
    ];
    let inside = html! {
        @for span in [-20.0, -10.0, 0.0, 10.0, 20.0] {
            (svg::line(LEFT, y(span), W - RIGHT, y(span), "frame"))
            (svg::text(LEFT - 5.0, y(span) + 3.0, "end", "small", &format!("{span:+.0}°")))
        }
        @for theta in [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0] {
            (svg::line(x(theta), H - BOTTOM, x(theta), H - BOTTOM + 4.0, "tick"))
            (svg::text(x(theta), H - BOTTOM + 15.0, "middle", "small", &format!("{theta}°")))
        }
        @for (k, (distance_m, color, name)) in arms.iter().enumerate() {
            @for edge in [0, 1] {
                polyline points=(curve(*distance_m, edge)) fill="none" stroke=(color) stroke-width="1.8" {}
            }
            (svg::text(W - RIGHT - 4.0, TOP + 12.0 + 14.0 * k as f64, "end", "small",
                &format!("{name}, {distance_m} m")))
            line x1=(svg::n(W - RIGHT - 104.0)) x2=(svg::n(W - RIGHT - 84.0))
                y1=(svg::n(TOP + 9.0 + 14.0 * k as f64)) y2=(svg::n(TOP + 9.0 + 14.0 * k as f64))
                stroke=(color) stroke-width="2.4" {}
        }
        (svg::text(0.5 * (W + LEFT), H - 6.0, "middle", "axis", "polar angle of the arm"))
    };
    svg::drawing(W, H, "span of polar angles within a frame", inside)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spans_are_those_of_the_paper() {
        let rig = Rig::paper(400);
        let r = rig.sampling.disc_radius_mm * 1e-3;
        for (theta, distance, minus, plus) in [
            (60.0, rig.light.distance_m, -9.15, 5.90),
            (60.0, rig.camera.distance_m, -5.07, 3.88),
            (85.0, rig.camera.distance_m, -0.91, 0.67),
        ] {
            let [towards, away] = span_deg(theta, distance, r);
            assert!((towards - minus).abs() < 0.01 && (away - plus).abs() < 0.01);
        }
        assert_eq!(chart(&rig).into_string().matches("<polyline").count(), 4);
    }
}
