//! The share of the light that the material reflects, over the light's polar angle.

use gonia_brdf::DenseBrdf;
use gonia_pipeline::DirectionalAlbedo;
use gonia_render::svg;
use gonia_rig::Scale;
use maud::{Markup, html};

/// Colours of the curves, channel by channel.
const COLOURS: [(&str, &str); 3] = [("R", "#c33"), ("G", "#2a2"), ("B", "#36c")];

/// The curve of each channel, and what the curve is of.
pub fn section(brdf: &DenseBrdf, scale: Scale) -> Markup {
    let last_deg = brdf.grid().step_deg() * (brdf.grid().n_theta() - 1) as f64;
    let albedo = DirectionalAlbedo::of(brdf, last_deg);
    let relative = match scale {
        Scale::Absolute => "",
        Scale::Relative => ", in the unit of the relative values",
    };
    html! {
        section {
            h2 { "Directional albedo" }
            figure {
                (chart(&albedo))
                figcaption {
                    "∫ f cos θv dωv" (relative) ", mean over azimuths; highest "
                    (format!("{:.3}", albedo.highest)) " (" (albedo.channel_name) " at θi "
                    (format!("{:.0}°, φi {:.0}°", albedo.theta_i_deg, albedo.phi_i_deg))
                    "). Beyond the grid's last angle its values count on to the horizon"
                }
            }
        }
    }
}

fn chart(albedo: &DirectionalAlbedo) -> Markup {
    const W: f64 = 380.0;
    const H: f64 = 240.0;
    const LEFT: f64 = 44.0;
    const RIGHT: f64 = 12.0;
    const TOP: f64 = 12.0;
    const BOTTOM: f64 = 40.0;
    let values = albedo.by_polar_angle.iter().flatten();
    let top = svg::round_up(values.fold(1e-9, |most: f64, v| most.max(*v)));
    let x = |theta: f64| LEFT + (W - LEFT - RIGHT) * theta / 90.0;
    let y = |share: f64| H - BOTTOM - (H - TOP - BOTTOM) * share / top;
    let curve = |channel: usize| {
        let points = albedo.by_polar_angle.iter().enumerate();
        let points = points.map(|(k, of)| {
            let theta = k as f64 * albedo.step_deg;
            format!("{},{}", svg::n(x(theta)), svg::n(y(of[channel])))
        });
        points.collect::<Vec<String>>().join(" ")
    };
    let inside = html! {
        @for k in 0..=4 {
            @let share = top * f64::from(k) / 4.0;
            (svg::line(LEFT, y(share), W - RIGHT, y(share), "frame"))
            (svg::text(LEFT - 5.0, y(share) + 3.0, "end", "small", &format!("{share:.3}")))
        }
        @for theta in [0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0] {
            (svg::line(x(theta), H - BOTTOM, x(theta), H - BOTTOM + 4.0, "tick"))
            (svg::text(x(theta), H - BOTTOM + 15.0, "middle", "small", &format!("{theta}°")))
        }
        @for (channel, (name, colour)) in COLOURS.iter().enumerate() {
            polyline points=(curve(channel)) fill="none" stroke=(colour) stroke-width="1.8" {}
            (svg::text(LEFT + 12.0 + 16.0 * channel as f64, TOP + 12.0, "start", "small", name))
        }
        (svg::text(0.5 * (W + LEFT), H - 6.0, "middle", "axis", "polar angle of the light"))
    };
    svg::drawing(
        W,
        H,
        "directional albedo by polar angle of the light",
        inside,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Grid;
    use gonia_brdf::model::Lambert;

    #[test]
    fn the_section_shows_the_share_that_a_lambertian_reflects() {
        let grid = Grid::with_step_deg(6.0).unwrap();
        let model = Lambert {
            albedo: [0.2, 0.5, 0.7],
        };
        let brdf = DenseBrdf::tabulate(grid, &model);
        let drawn = section(&brdf, Scale::Absolute).into_string();
        assert!(drawn.contains("highest 0.700 (B"), "{drawn}");
        let relative = section(&brdf, Scale::Relative).into_string();
        assert!(relative.contains("relative values"));
        assert_eq!(drawn.matches("<polyline").count(), 3);
    }
}
