//! What a column's name says: which quantity it holds, in which unit.

use crate::sample_rows::COLUMNS;
use gonia_rig::Channels;

/// The names of the field for the polar angle and for the azimuth, of the light and of the view.
const POLAR: [&str; 3] = ["theta", "polar", "zenith"];
const AZIMUTH: [&str; 3] = ["phi", "azimuth", "azim"];
const LIGHT: [&str; 12] = [
    "i",
    "in",
    "inc",
    "incident",
    "incidence",
    "incoming",
    "input",
    "light",
    "l",
    "illumination",
    "illum",
    "source",
];
const VIEW: [&str; 28] = [
    "v",
    "view",
    "viewing",
    "viewer",
    "o",
    "out",
    "outgoing",
    "output",
    "r",
    "refl",
    "reflected",
    "reflection",
    "s",
    "sc",
    "scat",
    "scatter",
    "scattered",
    "scattering",
    "e",
    "exit",
    "emission",
    "camera",
    "cam",
    "detector",
    "det",
    "observer",
    "obs",
    "sensor",
];
/// Names of the value of a single channel.
const VALUE: [&str; 8] = ["brdf", "bsdf", "fr", "f", "value", "val", "values", "y"];
/// What may stand before the wavelength of a band: `brdf_450nm`.
const OF_BANDS: [&str; 8] = ["brdf", "bsdf", "value", "val", "fr", "f", "r", "band"];
/// Names of the channels, and what may stand before or after them.
const CHANNELS: [[&str; 2]; 3] = [["r", "red"], ["g", "green"], ["b", "blue"]];
const OF_CHANNELS: [&str; 6] = ["brdf", "bsdf", "value", "val", "rgb", "channel"];
const FRAME: [&str; 4] = ["frame", "frameno", "framenr", "framenumber"];

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Quantity {
    /// An angle: its place among the columns of a sample.
    Angle(usize),
    /// A channel: 0 to 2.
    Channel(usize),
    /// The value of a single channel.
    Value,
    /// The value of a band of this wavelength, nanometres.
    Band(f64),
    /// The number of the frame.
    Frame,
}

/// What is known of a column by its name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ColumnName {
    pub quantity: Quantity,
    /// An angle in radians, as the name says.
    pub radians: bool,
    /// How far the name is from gonia's own: 0 is the same.
    pub distance: u8,
}

/// What a name says; `None` for a column of something else.
pub(super) fn column_name(name: &str) -> Option<ColumnName> {
    let name = name.trim();
    let lower = name.to_lowercase();
    if let Some(wavelength) = wavelength(&lower) {
        return Some(ColumnName {
            quantity: Quantity::Band(wavelength),
            radians: false,
            distance: 0,
        });
    }
    let (words, unit) = words_and_unit(name);
    let key = words.concat();
    let quantity = quantity(&key)?;
    let own = match quantity {
        Quantity::Angle(k) => Some(COLUMNS[k]),
        Quantity::Channel(c) => Some(COLUMNS[4 + c]),
        Quantity::Frame => Some(COLUMNS[7]),
        Quantity::Value | Quantity::Band(_) => None,
    };
    let radians = matches!(quantity, Quantity::Angle(_)) && unit == Some(AngleUnit::Radians);
    let distance = match own {
        Some(own) if lower == own => 0,
        Some(own) if key == own.replace('_', "") => 1 + u8::from(radians),
        _ => 3 + u8::from(radians),
    };
    Some(ColumnName {
        quantity,
        radians,
        distance,
    })
}

/// The wavelength in the name of a band's column: `450nm`, `450 nm [1/sr]`, `brdf_450nm`.
fn wavelength(lower: &str) -> Option<f64> {
    let (name, _) = without_unit(lower);
    let name = name.trim();
    let named = name.find(|letter: char| letter.is_ascii_digit())?;
    let before = name[..named].trim_end_matches(['_', ' ', '-', '.']);
    let is_band = before.is_empty() || OF_BANDS.contains(&before);
    Channels::wavelength_of(&name[named..]).filter(|_| is_band)
}

/// Whether a line below the header holds the columns' units, some of them of angles: `deg`, `[rad]`.
pub(super) fn are_units(fields: &[impl AsRef<str>]) -> bool {
    let fields = || fields.iter().map(|field| inside_brackets(field.as_ref()));
    fields().all(is_unit) && fields().any(|field| angle_unit(field).is_some())
}

fn inside_brackets(field: &str) -> &str {
    field.trim().trim_matches(['[', ']', '(', ')'])
}

/// Whether a text is a unit of an angle or of a value; nothing is one too.
fn is_unit(text: &str) -> bool {
    let inside = text.trim();
    let of_values = ["1/sr", "sr^-1", "sr-1", "sr⁻¹", "-", "1", "a.u.", "au"];
    inside.is_empty()
        || angle_unit(inside).is_some()
        || of_values.contains(&inside.to_lowercase().as_str())
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum AngleUnit {
    Degrees,
    Radians,
}

fn angle_unit(text: &str) -> Option<AngleUnit> {
    match text.trim().to_lowercase().as_str() {
        // The second one is the ordinal sign, which keyboards have in its place.
        "°" | "º" | "deg" | "degs" | "degree" | "degrees" => Some(AngleUnit::Degrees),
        "rad" | "rads" | "radian" | "radians" => Some(AngleUnit::Radians),
        _ => None,
    }
}

/// The words of a name in lower case, and the unit that it ends in.
fn words_and_unit(name: &str) -> (Vec<String>, Option<AngleUnit>) {
    let (name, mut unit) = without_unit(name);
    let mut words = vec![String::new()];
    let mut before = ' ';
    for letter in name.chars() {
        // thetaIn is two words.
        let begins = letter.is_uppercase() && before.is_lowercase();
        before = letter;
        if let Some(word) = words
            .last_mut()
            .filter(|_| !begins && letter.is_alphanumeric())
        {
            word.push_str(&plain(letter));
        } else if begins {
            words.push(plain(letter));
        } else {
            words.push(if letter == '°' || letter == 'º' {
                "deg".into()
            } else {
                String::new()
            });
        }
    }
    words.retain(|word| !word.is_empty());
    if unit.is_none()
        && words.len() > 1
        && let Some(found) = words.last().and_then(|word| angle_unit(word))
    {
        unit = Some(found);
        words.pop();
    }
    (words, unit)
}

/// A name without the unit in brackets or after a slash: `theta_i [deg]`, `theta_i / °`.
fn without_unit(name: &str) -> (String, Option<AngleUnit>) {
    for (open, close) in [('[', ']'), ('(', ')')] {
        if let Some((before, rest)) = name.split_once(open)
            && let Some((inside, after)) = rest.split_once(close)
            && is_unit(inside)
        {
            return (format!("{before}{after}"), angle_unit(inside));
        }
    }
    match name.split_once('/') {
        Some((before, after)) if is_unit(after) => (before.to_owned(), angle_unit(after)),
        _ => (name.to_owned(), None),
    }
}

/// A letter in lower case, spelt out where it is Greek or a subscript.
fn plain(letter: char) -> String {
    match letter {
        'θ' | 'ϑ' | 'Θ' => "theta".into(),
        'φ' | 'ϕ' | 'Φ' => "phi".into(),
        'ᵢ' => "i".into(),
        'ᵥ' => "v".into(),
        'ₒ' => "o".into(),
        'ᵣ' => "r".into(),
        'ₛ' => "s".into(),
        _ => letter.to_lowercase().collect(),
    }
}

fn quantity(key: &str) -> Option<Quantity> {
    if FRAME.contains(&key) {
        return Some(Quantity::Frame);
    }
    if VALUE.contains(&key) {
        return Some(Quantity::Value);
    }
    for (c, names) in CHANNELS.iter().enumerate() {
        let of_channel = |name: &str| OF_CHANNELS.iter().any(|word| is_joined(key, word, name));
        if names.contains(&key) || names.iter().any(|name| of_channel(name)) {
            return Some(Quantity::Channel(c));
        }
    }
    // A long name says that it is an angle: "incident polar angle".
    let shorter = key.replace("angle", "");
    let sides: [(&[&str], usize); 2] = [(&LIGHT, 0), (&VIEW, 2)];
    for (side, polar) in sides {
        for (angle, place) in [(&POLAR, polar), (&AZIMUTH, polar + 1)] {
            if side
                .iter()
                .any(|s| angle.iter().any(|a| is_joined(&shorter, a, s)))
            {
                return Some(Quantity::Angle(place));
            }
        }
    }
    None
}

/// Whether a name is two words, in either order.
fn is_joined(name: &str, a: &str, b: &str) -> bool {
    name.strip_prefix(a) == Some(b) || name.strip_prefix(b) == Some(a)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_fields_names_are_known_in_every_spelling() {
        let names = [
            (
                0,
                "theta_i Theta_I thetaI THETA_IN theta.inc θi θ_in theta_{i} ϑᵢ incident_polar_angle theta_light theta_l",
            ),
            (
                1,
                "phi_i Phi_I phiIn phi_incident φi azimuth_in incidence_azimuth ϕᵢ phi_{in}",
            ),
            (
                2,
                "theta_v theta_o theta_out theta_r theta_s thetaOut θ_v θr theta_view scatter_polar zenith_out theta_det",
            ),
            (
                3,
                "phi_v phi_o phi_out phi_r phi_s φₒ azimuth_view scattered_azimuth",
            ),
        ];
        for (place, spellings) in names {
            for name in spellings.split(' ') {
                let known = column_name(name).map(|known| known.quantity);
                assert_eq!(known, Some(Quantity::Angle(place)), "{name}");
            }
        }
        for (quantity, spellings) in [
            (
                Quantity::Value,
                "brdf|BRDF|BRDF [1/sr]|brdf (sr^-1)|value|f|f_r|bsdf",
            ),
            (Quantity::Channel(0), "r|R|red|brdf_r|R [1/sr]|value_red"),
            (Quantity::Channel(2), "b|B|Blue|BRDF_B"),
            (Quantity::Frame, "frame|Frame|frame_number|Frame No."),
            (Quantity::Value, "Y"),
            (
                Quantity::Band(450.0),
                "450nm|450 nm|450NM|450 nm [1/sr]|brdf_450nm|BRDF 450nm|450.0nm",
            ),
        ] {
            for name in spellings.split('|') {
                let known = column_name(name).map(|known| known.quantity);
                assert_eq!(known, Some(quantity), "{name}");
            }
        }
    }

    #[test]
    fn what_is_not_certain_is_not_known() {
        for name in [
            "theta",
            "phi",
            "theta_d",
            "theta_h",
            "dphi",
            "phi_d",
            "elevation_i",
            "uBRDF",
            "dsf",
            "brdf_cos",
            "brdf*cos(theta)",
            "reflectance",
            "theta_1",
            "temperature",
            "theta_i [mrad]",
            "theta_i [gon]",
            "X",
            "frame_file",
            "",
            "°",
            "[deg]",
            "u_450nm",
            "theta_450nm",
            "450",
            "theta_i_err",
        ] {
            assert_eq!(column_name(name), None, "{name}");
        }
    }

    #[test]
    fn a_unit_in_the_name_is_that_unit() {
        for (name, radians) in [
            ("theta_i [deg]", false),
            ("theta_i (°)", false),
            ("theta_i°", false),
            ("theta_i / deg", false),
            ("theta_i_deg", false),
            ("thetaI_degrees", false),
            ("theta_i", false),
            ("theta_i_rad", true),
            ("theta_i [rad]", true),
            ("Theta_in (radians)", true),
            ("theta_i/rad", true),
            ("phiOutRad", true),
        ] {
            assert_eq!(
                column_name(name).map(|n| n.radians),
                Some(radians),
                "{name}"
            );
        }
    }
}
