//! Which channels of an EXR are the values of a dense BRDF: R, G and B, or Y alone, or bands by their
//! wavelengths (`380nm`).

use gonia_rig::Channels;

/// What is known by the names of a file's channels.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Named {
    pub channels: Channels,
    /// Where each of the channels stands in the file's list.
    pub places: Vec<usize>,
}

/// Finds the values' channels; others beside them are no part of it.
///
/// # Errors
/// Problem and remedy: none, or more than one kind of them.
pub(super) fn named(names: &[String]) -> Result<Named, (String, String)> {
    let place = |wanted: &str| names.iter().position(|name| name == wanted);
    let colours: Vec<usize> = ["R", "G", "B"].iter().filter_map(|c| place(c)).collect();
    let (mut bands, mut wavelengths) = (Vec::new(), Vec::new());
    for (k, name) in names.iter().enumerate() {
        if let Some(wavelength) = Channels::wavelength_of(name) {
            bands.push(k);
            wavelengths.push(wavelength);
        }
    }
    let is_rgb = colours.len() == 3;
    if let Some(band) = bands.first() {
        let other = if is_rgb {
            Some("R, G, B")
        } else {
            place("Y").map(|_| "Y")
        };
        if let Some(other) = other {
            return Err((
                format!("has the channels {other} and {} too", names[*band]),
                "keep those of one kind: R, G and B, or bands (380nm), or Y".into(),
            ));
        }
        let (channels, order) = Channels::bands(&wavelengths).map_err(|same| {
            (
                format!("has channels of one band: {same}"),
                "keep one of the two".to_owned(),
            )
        })?;
        let places = order.iter().map(|k| bands[*k]).collect();
        return Ok(Named { channels, places });
    }
    if is_rgb {
        return Ok(Named {
            channels: Channels::Rgb,
            places: colours,
        });
    }
    // With X and Z, or RY and BY, it is a part of a colour.
    let of_colour = ["X", "Z", "RY", "BY"].iter().any(|c| place(c).is_some());
    match place("Y") {
        Some(y) if colours.is_empty() && !of_colour => Ok(Named {
            channels: Channels::Single,
            places: vec![y],
        }),
        _ => {
            let missing = ["R", "G", "B"].into_iter().find(|c| place(c).is_none());
            Err((
                format!(
                    "has no channel {}, only {}",
                    missing.unwrap_or("R"),
                    names.join(", ")
                ),
                "save it as RGB, with channels R, G and B, as Y alone, or as bands (380nm)".into(),
            ))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(names: &[&str]) -> Result<Named, (String, String)> {
        let names: Vec<String> = names.iter().map(|name| (*name).to_owned()).collect();
        named(&names)
    }

    #[test]
    fn bands_come_by_wavelength_whatever_the_order_of_letters() {
        let found = of(&["1000nm", "380nm", "origin", "400nm"]).unwrap();
        assert_eq!(found.channels.names(), ["380nm", "400nm", "1000nm"]);
        assert_eq!(found.places, [1, 3, 0]);
        let rgb = of(&["A", "B", "G", "R"]).unwrap();
        assert_eq!((rgb.channels, rgb.places), (Channels::Rgb, vec![3, 2, 1]));
        assert_eq!(of(&["Y", "origin"]).unwrap().channels, Channels::Single);
    }

    #[test]
    fn what_could_be_two_things_is_refused() {
        for (names, said) in [
            (&["B", "G", "R", "450nm"][..], "R, G, B and 450nm too"),
            (&["450nm", "Y"], "Y and 450nm too"),
            (&["450nm", "450.0nm"], "450 nm is there twice"),
            (&["X", "Y", "Z"], "has no channel R, only X, Y, Z"),
            (&["BY", "RY", "Y"], "has no channel R"),
            (&["B", "G"], "has no channel R, only B, G"),
            (&["origin"], "has no channel R"),
        ] {
            let (problem, _) = of(names).unwrap_err();
            assert!(problem.contains(said), "{problem}");
        }
    }
}
