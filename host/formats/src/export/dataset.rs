//! A table as named arrays, for formats that hold any: values, their standard uncertainties, the axes.

use gonia_rig::{Channels, DenseChannels, Scale};

/// Axes of the values, slowest first.
pub const AXES: [&str; 5] = ["channel", "theta_i", "phi_i", "theta_v", "phi_v"];
/// Names of the values and of their standard uncertainties.
pub const VALUES: &str = "brdf";
pub const UNCERTAINTY: &str = "brdf_standard_uncertainty";

/// Named arrays.
pub struct Dataset<'a> {
    /// Length of each of [`AXES`].
    pub shape: [usize; 5],
    /// Of the file as a whole.
    pub attributes: Vec<(String, String)>,
    /// The arrays, the values last.
    pub arrays: Vec<Array<'a>>,
}

/// A named array.
pub struct Array<'a> {
    /// Its name.
    pub name: &'static str,
    /// Its axes.
    pub axes: &'static [&'static str],
    /// What is said of it, units among that.
    pub attributes: Vec<(String, String)>,
    /// What it holds.
    pub data: Data<'a>,
}

/// Values of an array.
pub enum Data<'a> {
    /// Numbers of an axis.
    Doubles(Vec<f64>),
    /// Names along an axis.
    Texts(Vec<String>),
    /// A plane a channel.
    Planes(&'a [Vec<f32>]),
}

/// The arrays of a table and of its standard uncertainties.
pub fn dataset<'a>(dense: &'a DenseChannels, errors: Option<&'a DenseChannels>) -> Dataset<'a> {
    let grid = dense.grid;
    let (n_theta, n_phi) = (grid.n_theta(), grid.n_phi());
    let unit = match dense.scale {
        Scale::Absolute => "sr-1",
        Scale::Relative => "1",
    };
    let step = grid.step_deg();
    let angles = |n: usize| Data::Doubles((0..n).map(|k| k as f64 * step).collect());
    let axis = |name, axes, of: &str, n| Array {
        name,
        axes,
        attributes: texts(&[("long_name", of), ("units", "degree")]),
        data: angles(n),
    };
    let mut arrays = vec![
        Array {
            name: "channel",
            axes: &["channel"],
            attributes: texts(&[("long_name", "channel")]),
            data: Data::Texts(dense.channels.names()),
        },
        axis("theta_i", &["theta_i"], "polar angle of the light", n_theta),
        axis("phi_i", &["phi_i"], "azimuth of the light", n_phi),
        axis("theta_v", &["theta_v"], "polar angle of the view", n_theta),
        axis("phi_v", &["phi_v"], "azimuth of the view", n_phi),
    ];
    if let Channels::Bands(wavelengths) = &dense.channels {
        arrays.push(Array {
            name: "wavelength",
            axes: &["channel"],
            attributes: texts(&[("long_name", "wavelength"), ("units", "nm")]),
            data: Data::Doubles(wavelengths.clone()),
        });
    }
    let of_values = [
        (
            "long_name",
            "bidirectional reflectance distribution function",
        ),
        ("units", unit),
    ];
    if let Some(errors) = errors {
        let of_errors = [
            ("long_name", "standard uncertainty of brdf"),
            ("units", unit),
        ];
        let mut attributes = texts(&of_errors);
        attributes.extend(provenance(errors));
        arrays.push(Array {
            name: UNCERTAINTY,
            axes: &AXES,
            attributes,
            data: Data::Planes(&errors.planes),
        });
    }
    let mut attributes = texts(&of_values);
    if errors.is_some() {
        attributes.extend(texts(&[("ancillary_variables", UNCERTAINTY)]));
    }
    arrays.push(Array {
        name: VALUES,
        axes: &AXES,
        attributes,
        data: Data::Planes(&dense.planes),
    });
    let mut attributes = texts(&[
        ("Conventions", "CF-1.11"),
        ("title", "anisotropic BRDF on a lattice of directions"),
        (
            "comment",
            "polar angles from the sample's normal, azimuths anticlockwise from its x axis seen from above; both directions point away from the surface",
        ),
        ("scale", &dense.scale.to_string()),
    ]);
    attributes.extend(provenance(dense));
    Dataset {
        shape: [dense.channels.count(), n_theta, n_phi, n_theta, n_phi],
        attributes,
        arrays,
    }
}

/// What a name of the provenance begins with.
pub const PREFIX: &str = "gonia.";

fn provenance(dense: &DenseChannels) -> impl Iterator<Item = (String, String)> {
    let facts = dense.provenance.iter();
    facts.map(|(name, value)| (format!("{PREFIX}{name}"), value.clone()))
}

fn texts(pairs: &[(&str, &str)]) -> Vec<(String, String)> {
    let owned = |(name, value): &(&str, &str)| ((*name).to_owned(), (*value).to_owned());
    pairs.iter().map(owned).collect()
}

/// The channels of names; `None` of what gonia would not write.
pub fn channels_of(names: &[String]) -> Option<Channels> {
    let wavelengths: Option<Vec<f64>> = names
        .iter()
        .map(|name| Channels::wavelength_of(name))
        .collect();
    let channels = match (names, wavelengths) {
        ([one], None) if one == "Y" => Channels::Single,
        ([_, _, _], None) => Channels::Rgb,
        (_, Some(wavelengths)) if !wavelengths.is_empty() => Channels::Bands(wavelengths),
        _ => return None,
    };
    (channels.names() == names).then_some(channels)
}

/// The scale that a file's attribute says.
pub fn scale_of(text: &str) -> Option<Scale> {
    [Scale::Absolute, Scale::Relative]
        .into_iter()
        .find(|scale| scale.to_string() == text)
}
