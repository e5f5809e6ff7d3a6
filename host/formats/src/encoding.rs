//! Whether the counts of a picture file are proportional to light, by what the file says of itself.

/// Gammas closer to 1 than this are those of linear counts: a gAMA chunk holds five decimals.
use gonia_brdf::Elementary;
const TOLERANCE: f64 = 0.02;

/// What is wrong with an ICC profile's tone curves, when they are not straight; `None` for linear ones
/// and for profiles that say nothing of tones.
pub(super) fn of_profile(profile: &[u8]) -> Option<String> {
    let count = u32_at(profile, 128)? as usize;
    // Real profiles have some twenty tags; what claims more is no profile.
    let tags = (0..count.min(256)).filter_map(|k| {
        let at = 132 + 12 * k;
        let name = profile.get(at..at + 4)?;
        let from = u32_at(profile, at + 4)? as usize;
        Some((name, profile.get(from..)?))
    });
    let curves = tags.filter(|(name, _)| {
        [b"rTRC", b"gTRC", b"bTRC", b"kTRC"]
            .iter()
            .any(|n| name == n)
    });
    curves
        .filter_map(|(_, curve)| of_curve(curve))
        .next()
        .map(|how| format!("its colour profile says that counts are {how}"))
}

/// How a tone curve differs from a straight line.
fn of_curve(curve: &[u8]) -> Option<String> {
    let fixed = |at: usize| Some(f64::from(u32_at(curve, at)? as i32) / 65_536.0);
    let gamma = match curve.get(..4)? {
        b"curv" => match u32_at(curve, 8)? {
            0 => return None,
            1 => f64::from(u16_at(curve, 12)?) / 256.0,
            n => {
                // A table: its middle, of a straight line's half.
                let last = f64::from(u16_at(curve, 12 + 2 * (n as usize - 1))?);
                let middle = f64::from(u16_at(curve, 12 + 2 * (n as usize / 2))?);
                let place = (n / 2) as f64 / f64::from(n - 1);
                (middle / last).natural_log() / place.natural_log()
            }
        },
        // y = (a·x + b)^g, in four more forms with a straight piece.
        b"para" => fixed(12)?,
        _ => return None,
    };
    power(gamma)
}

/// What a gAMA value (the power of light that the counts are) says; `None` for linear counts.
pub(super) fn of_gamma(exponent: f64) -> Option<String> {
    power(1.0 / exponent).map(|how| format!("its gAMA chunk says that counts are {how}"))
}

/// In words, counts whose power `gamma` is light.
fn power(gamma: f64) -> Option<String> {
    let is_linear = (gamma - 1.0).abs() <= TOLERANCE;
    (!is_linear).then(|| format!("encoded with a gamma of {gamma:.2}"))
}

fn u32_at(bytes: &[u8], at: usize) -> Option<u32> {
    let four = bytes.get(at..)?.first_chunk()?;
    Some(u32::from_be_bytes(*four))
}

fn u16_at(bytes: &[u8], at: usize) -> Option<u16> {
    let two = bytes.get(at..)?.first_chunk()?;
    Some(u16::from_be_bytes(*two))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A profile with one tone curve.
    pub fn profile(curve: &[u8]) -> Vec<u8> {
        let mut bytes = vec![0; 128];
        bytes.extend(1u32.to_be_bytes());
        bytes.extend(b"kTRC");
        bytes.extend([144u32.to_be_bytes(), (curve.len() as u32).to_be_bytes()].concat());
        bytes.extend(curve);
        bytes
    }

    fn curve(kind: &[u8; 4], values: &[u8]) -> Vec<u8> {
        [&kind[..], &[0; 4], values].concat()
    }

    #[test]
    fn straight_curves_are_linear_and_others_say_their_gamma() {
        let table = |power: f64| -> Vec<u8> {
            let values = (0..256).map(|k| (65_535.0 * (f64::from(k) / 255.0).power(power)) as u16);
            let count = 256u32.to_be_bytes().to_vec();
            count
                .into_iter()
                .chain(values.flat_map(u16::to_be_bytes))
                .collect()
        };
        let one = |gamma: u16| [&1u32.to_be_bytes()[..], &gamma.to_be_bytes()].concat();
        let para = |gamma: f64| [&[0; 4][..], &((gamma * 65_536.0) as i32).to_be_bytes()].concat();
        for linear in [
            curve(b"curv", &[0; 4]),
            curve(b"curv", &one(256)),
            curve(b"curv", &table(1.0)),
            curve(b"para", &para(1.0)),
        ] {
            assert_eq!(of_profile(&profile(&linear)), None);
        }
        for encoded in [
            curve(b"curv", &one(563)),
            curve(b"curv", &table(2.2)),
            curve(b"para", &para(2.2)),
        ] {
            let said = of_profile(&profile(&encoded)).unwrap();
            assert!(said.contains("gamma of 2.2"), "{said}");
        }
        // No profile at all, or one cut short.
        for bytes in [
            &[][..],
            &[255; 200],
            &profile(&curve(b"curv", &one(563)))[..150],
        ] {
            assert_eq!(of_profile(bytes), None);
        }
        assert_eq!(of_gamma(1.0), None);
        assert!(of_gamma(0.45455).unwrap().contains("gamma of 2.20"));
    }
}
