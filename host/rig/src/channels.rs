//! What the channels of samples and of dense BRDFs are.

use std::fmt;

/// The channels of values, in their order: colours, one value, or the bands of a spectrum.
#[derive(Clone, Debug, PartialEq, Default)]
pub enum Channels {
    /// Red, green and blue, linear.
    #[default]
    Rgb,
    /// One value: a monochrome camera's, a photodiode's.
    Single,
    /// Bands by their wavelengths, nanometres, ascending and at least one.
    Bands(Vec<f64>),
}

/// Two bands of one wavelength.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("{0} nm is there twice")]
pub struct SameBand(pub f64);

impl Channels {
    /// Bands of these wavelengths, and the places in the list given where each stands: bands come in ascending
    /// order, whatever order a file has.
    ///
    /// # Errors
    /// A wavelength that is there twice.
    pub fn bands(wavelengths_nm: &[f64]) -> Result<(Self, Vec<usize>), SameBand> {
        let mut order: Vec<usize> = (0..wavelengths_nm.len()).collect();
        order.sort_by(|a, b| wavelengths_nm[*a].total_cmp(&wavelengths_nm[*b]));
        let sorted: Vec<f64> = order.iter().map(|k| wavelengths_nm[*k]).collect();
        match sorted.windows(2).find(|pair| pair[0] == pair[1]) {
            Some(pair) => Err(SameBand(pair[0])),
            None => Ok((Self::Bands(sorted), order)),
        }
    }

    /// How many.
    pub fn count(&self) -> usize {
        match self {
            Self::Rgb => 3,
            Self::Single => 1,
            Self::Bands(wavelengths) => wavelengths.len(),
        }
    }

    /// Their names in an image: `R`, `G`, `B`; `Y`; `380nm`, …
    pub fn names(&self) -> Vec<String> {
        match self {
            Self::Rgb => ["R", "G", "B"].map(str::to_owned).to_vec(),
            Self::Single => vec!["Y".to_owned()],
            Self::Bands(wavelengths) => wavelengths.iter().map(|w| format!("{w}nm")).collect(),
        }
    }

    /// Their names as columns of a table: those of an image, colours in small letters.
    pub fn column_names(&self) -> Vec<String> {
        match self {
            Self::Rgb => ["r", "g", "b"].map(str::to_owned).to_vec(),
            _ => self.names(),
        }
    }

    /// The wavelength of a band's name, nanometres: `380nm`, `380.5 nm`.
    pub fn wavelength_of(name: &str) -> Option<f64> {
        let name = name.trim();
        let number = name
            .strip_suffix("nm")
            .or_else(|| name.strip_suffix("NM"))?
            .trim_end();
        let plain = number
            .chars()
            .all(|letter| letter.is_ascii_digit() || letter == '.');
        let wavelength: f64 = number.parse().ok().filter(|_| plain)?;
        (wavelength > 0.0).then_some(wavelength)
    }
}

/// For messages: `R, G, B`; `Y`; `31 bands from 400nm to 700nm`.
impl fmt::Display for Channels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Bands(wavelengths) if wavelengths.len() > 3 => {
                let [first, .., last] = wavelengths[..] else {
                    return Ok(());
                };
                write!(f, "{} bands from {first}nm to {last}nm", wavelengths.len())
            }
            _ => f.write_str(&self.names().join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bands_come_by_wavelength_and_not_by_letter_and_none_twice() {
        let (channels, order) = Channels::bands(&[1000.0, 380.0, 400.5]).unwrap();
        assert_eq!(channels.names(), ["380nm", "400.5nm", "1000nm"]);
        assert_eq!(order, [1, 2, 0]);
        assert_eq!(
            Channels::bands(&[400.0, 380.0, 400.0]),
            Err(SameBand(400.0))
        );
    }

    #[test]
    fn a_bands_name_is_its_wavelength_and_no_other_name_is_one() {
        for (name, wavelength) in [("380nm", 380.0), (" 632.8 nm", 632.8), ("550NM", 550.0)] {
            assert_eq!(Channels::wavelength_of(name), Some(wavelength), "{name}");
        }
        for name in [
            "nm", "380", "-380nm", "1e3nm", "infnm", "0nm", "a380nm", "380um", "3.8.0nm",
        ] {
            assert_eq!(Channels::wavelength_of(name), None, "{name}");
        }
    }
}
