//! Colours for numbers.

/// From dark green through teal and gold to pale yellow: for shares and distances, 0 ..= 1.
/// Lightness rises evenly, so that it reads in grey too.
pub fn sequential(t: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 6] = [
        [16.0, 24.0, 38.0],
        [24.0, 66.0, 84.0],
        [38.0, 112.0, 104.0],
        [118.0, 152.0, 86.0],
        [214.0, 184.0, 92.0],
        [253.0, 237.0, 190.0],
    ];
    between(&STOPS, t)
}

/// From blue through near white to red: for differences, −1 ..= 1.
pub fn diverging(t: f32) -> [u8; 3] {
    const STOPS: [[f32; 3]; 5] = [
        [28.0, 82.0, 156.0],
        [128.0, 172.0, 212.0],
        [244.0, 243.0, 240.0],
        [230.0, 152.0, 118.0],
        [166.0, 38.0, 44.0],
    ];
    between(&STOPS, 0.5 * (t + 1.0))
}

fn between(stops: &[[f32; 3]], t: f32) -> [u8; 3] {
    let last = stops.len() - 1;
    let place = t.clamp(0.0, 1.0) * last as f32;
    // A NaN stays NaN through clamp and lands on the first stop.
    let k = (place as usize).min(last - 1);
    let f = place - k as f32;
    [0, 1, 2].map(|c| (stops[k][c] + f * (stops[k + 1][c] - stops[k][c]) + 0.5) as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lightness_rises_and_differences_are_symmetric() {
        let grey =
            |[r, g, b]: [u8; 3]| 0.3 * f32::from(r) + 0.6 * f32::from(g) + 0.1 * f32::from(b);
        let mut before = -1.0;
        for k in 0..=50 {
            let now = grey(sequential(k as f32 / 50.0));
            assert!(now > before);
            before = now;
        }
        assert_eq!(diverging(0.0), [244, 243, 240]);
        assert_eq!(diverging(-7.0), [28, 82, 156]);
        assert_eq!(diverging(f32::INFINITY), [166, 38, 44]);
    }
}
