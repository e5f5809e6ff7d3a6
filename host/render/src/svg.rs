//! The few things that every chart has.

use gonia_brdf::Elementary;
use maud::{Markup, html};

/// The style of the report and of the live page; its first block holds the light colours.
pub const STYLE: &str = include_str!("style.css");

/// A number for an attribute, with no more decimals than a screen shows.
pub fn n(value: f64) -> String {
    let rounded = (value * 100.0).round() / 100.0;
    format!("{rounded}")
}

/// A text. `anchor` is start, middle or end.
pub fn text(x: f64, y: f64, anchor: &str, class: &str, text: &str) -> Markup {
    html! { text x=(n(x)) y=(n(y)) text-anchor=(anchor) class=(class) { (text) } }
}

/// A straight line.
pub fn line(x1: f64, y1: f64, x2: f64, y2: f64, class: &str) -> Markup {
    html! { line x1=(n(x1)) y1=(n(y1)) x2=(n(x2)) y2=(n(y2)) class=(class) {} }
}

/// A bar or a frame.
pub fn rect(x: f64, y: f64, w: f64, h: f64, class: &str) -> Markup {
    html! { rect x=(n(x)) y=(n(y)) width=(n(w)) height=(n(h)) class=(class) {} }
}

/// A picture, its pixels kept square and sharp.
pub fn image(x: f64, y: f64, w: f64, h: f64, uri: &str) -> Markup {
    html! {
        image x=(n(x)) y=(n(y)) width=(n(w)) height=(n(h)) href=(uri)
            preserveAspectRatio="none" style="image-rendering:pixelated" {}
    }
}

/// A drawing of `w` × `h` units that fills the width it is given, with a name for screen readers.
pub fn drawing(w: f64, h: f64, name: &str, inside: Markup) -> Markup {
    html! {
        svg viewBox=(format!("0 0 {} {}", n(w), n(h))) role="img" aria-label=(name)
            style=(format!("max-width:{}px", n(1.5 * w))) { (inside) }
    }
}

/// A drawing of the page as a file of its own, in the page's light colours.
pub fn alone(drawing: Markup) -> String {
    let rules: String = STYLE
        .lines()
        .filter(|line| line.starts_with("svg text") || line.starts_with("svg ."))
        .collect();
    let head = format!(
        "<style>{rules}</style><rect width=\"100%\" height=\"100%\" fill=\"var(--card)\"/>"
    );
    let drawing = drawing.into_string();
    let text = match drawing.split_once('>') {
        Some((tag, rest)) => {
            let tag = tag.replacen("<svg", "<svg xmlns=\"http://www.w3.org/2000/svg\"", 1);
            format!("{tag}>{head}{rest}")
        }
        None => drawing,
    };
    light_colours().fold(text, |text, (name, value)| {
        text.replace(&format!("var({name})"), value)
    })
}

/// The names and values of the page's light colours: the first block of its style.
fn light_colours() -> impl Iterator<Item = (&'static str, &'static str)> {
    let block = STYLE.split('}').next().unwrap_or_default();
    block
        .split([';', '{'])
        .filter_map(|rule| rule.trim().split_once(": "))
        .filter(|(name, _)| name.starts_with("--"))
}

/// The least "round" number (1, 2, 5 times a power of ten) that is at least `value`.
pub fn round_up(value: f64) -> f64 {
    if !(value > 0.0 && value.is_finite()) {
        return 1.0;
    }
    let power = 10f64.power(value.decimal_log().floor());
    let factor = [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .find(|f| f * power >= value * (1.0 - 1e-9));
    factor.unwrap_or(10.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn round_numbers_are_round_and_large_enough() {
        for (value, expected) in [
            (0.7, 1.0),
            (1.0, 1.0),
            (1.2, 2.0),
            (34.0, 50.0),
            (0.026, 0.05),
        ] {
            assert!((round_up(value) / expected - 1.0).abs() < 1e-9, "{value}");
        }
        assert_eq!(round_up(0.0), 1.0);
        assert_eq!(n(1.0 / 3.0), "0.33");
    }
}
