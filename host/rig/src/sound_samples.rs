//! Samples whose directions or values cannot stand as they came: what is read otherwise, and what is
//! left out.

use gonia_brdf::Sample;

/// How many of some samples were odd, and which was the first of each kind, counted from 0.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Oddities {
    /// Samples in all, those that are left out among them.
    pub samples: usize,
    /// With a negative polar angle: −θ at φ is the direction θ at φ + 180°.
    pub signed: Oddity,
    /// With a direction below the horizon, 90° < |θ| ≤ 180°: left out.
    pub below: Oddity,
    /// With a polar angle beyond 180°, which is none: left out.
    pub no_angle: Oddity,
    /// With a number that is NaN or infinite: left out.
    pub not_finite: Oddity,
}

/// How many samples of one kind, and the number and the values of the first.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Oddity {
    /// How many.
    pub count: usize,
    /// The number of the first, counted from 0, and what is odd in it: `theta_v 91`.
    pub first: Option<(usize, String)>,
}

impl Oddity {
    fn note(&mut self, number: usize, name: &str, value: f32) {
        self.count += 1;
        if self.first.is_none() {
            self.first = Some((number, format!("{name} {value}")));
        }
    }
}

impl Oddities {
    /// How many samples were left out.
    pub fn left_out(&self) -> usize {
        self.below.count + self.no_angle.count + self.not_finite.count
    }
}

/// Turns negative polar angles to the other side of the normal, and leaves out what has no direction above
/// the sample or no value. Samples that are sound stay as they are, in their order.
pub fn keep_sound<const N: usize>(samples: &mut Vec<Sample<N>>) -> Oddities {
    let mut odd = Oddities {
        samples: samples.len(),
        ..Oddities::default()
    };
    let Some(first) = samples.iter().position(|s| !is_sound(s)) else {
        return odd;
    };
    let mut kept = first;
    for number in first..samples.len() {
        if let Some(sample) = sound(samples[number], number, &mut odd) {
            samples[kept] = sample;
            kept += 1;
        }
    }
    samples.truncate(kept);
    odd
}

const POLAR_ANGLES: std::ops::RangeInclusive<f32> = 0.0..=90.0;

fn is_sound<const N: usize>(s: &Sample<N>) -> bool {
    let azimuths = [s.phi_i_deg, s.phi_v_deg];
    POLAR_ANGLES.contains(&s.theta_i_deg)
        && POLAR_ANGLES.contains(&s.theta_v_deg)
        && azimuths.iter().chain(&s.rgb).all(|v| v.is_finite())
}

fn sound<const N: usize>(mut s: Sample<N>, number: usize, odd: &mut Oddities) -> Option<Sample<N>> {
    let numbers = [
        ("theta_i", s.theta_i_deg),
        ("phi_i", s.phi_i_deg),
        ("theta_v", s.theta_v_deg),
        ("phi_v", s.phi_v_deg),
    ];
    let channel = |c: usize| if N == 3 { ["r", "g", "b"][c] } else { "value" };
    let values = s.rgb.iter().enumerate().map(|(c, v)| (channel(c), *v));
    let all = numbers.into_iter().chain(values);
    if let Some((name, value)) = all.into_iter().find(|(_, v)| !v.is_finite()) {
        odd.not_finite.note(number, name, value);
        return None;
    }
    let polar = [numbers[0], numbers[2]];
    if let Some((name, theta)) = polar.iter().find(|(_, theta)| theta.abs() > 180.0) {
        odd.no_angle.note(number, name, *theta);
        return None;
    }
    if let Some((name, theta)) = polar.iter().find(|(_, theta)| theta.abs() > 90.0) {
        odd.below.note(number, name, *theta);
        return None;
    }
    if let Some((name, theta)) = polar.iter().find(|(_, theta)| *theta < 0.0) {
        odd.signed.note(number, name, *theta);
        turn(&mut s.theta_i_deg, &mut s.phi_i_deg);
        turn(&mut s.theta_v_deg, &mut s.phi_v_deg);
    }
    Some(s)
}

fn turn(theta: &mut f32, phi: &mut f32) {
    if *theta < 0.0 {
        *theta = -*theta;
        *phi = (*phi + 180.0).rem_euclid(360.0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sample(theta_i: f32, phi_i: f32, theta_v: f32, value: f32) -> Sample {
        Sample {
            theta_i_deg: theta_i,
            phi_i_deg: phi_i,
            theta_v_deg: theta_v,
            phi_v_deg: 10.0,
            rgb: [value; 3],
            frame: 0,
        }
    }

    #[test]
    fn sound_samples_stay_and_odd_ones_are_turned_or_left_out_and_counted() {
        let good = sample(30.0, 300.0, 90.0, -0.1);
        let mut samples = vec![
            good,
            sample(-30.0, 300.0, 20.0, 1.0),
            sample(30.0, 0.0, -91.0, 1.0),
            sample(30.0, 0.0, 20.0, f32::NAN),
            sample(-999.0, 0.0, 20.0, 1.0),
            sample(-5.0, 0.0, -6.0, 2.0),
            sample(f32::INFINITY, 0.0, 20.0, 1.0),
        ];
        let odd = keep_sound(&mut samples);
        let both = Sample {
            phi_v_deg: 190.0,
            ..sample(5.0, 180.0, 6.0, 2.0)
        };
        assert_eq!(samples, [good, sample(30.0, 120.0, 20.0, 1.0), both]);
        assert_eq!((odd.samples, odd.left_out()), (7, 4));
        assert_eq!(
            (
                odd.signed.count,
                odd.below.count,
                odd.no_angle.count,
                odd.not_finite.count
            ),
            (2, 1, 1, 2)
        );
        assert_eq!(odd.below.first, Some((2, "theta_v -91".into())));
        assert_eq!(odd.not_finite.first, Some((3, "r NaN".into())));
        assert_eq!(keep_sound(&mut samples).left_out(), 0);
    }
}
