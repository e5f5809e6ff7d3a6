//! Directions as places of the unit square, by the map of Shirley and Chiu (1997): equal areas of the square are
//! equal projected solid angles.

use gonia_brdf::{Direction, Elementary};
use std::f64::consts::FRAC_PI_4;

/// The place of a direction's x and y.
pub fn of_disk([x, y]: [f64; 2]) -> [f64; 2] {
    let radius = x.hypotenuse(y);
    // Quarters of the disk, the first one about +x.
    let mut phi = y.arc_tangent2(x);
    if phi < -FRAC_PI_4 {
        phi += 8.0 * FRAC_PI_4;
    }
    let along = |about: f64| (phi - about * FRAC_PI_4) / FRAC_PI_4 * radius;
    let (a, b) = if phi < FRAC_PI_4 {
        (radius, along(0.0))
    } else if phi < 3.0 * FRAC_PI_4 {
        (-along(2.0), radius)
    } else if phi < 5.0 * FRAC_PI_4 {
        (-radius, -along(4.0))
    } else {
        (along(6.0), -radius)
    };
    [a, b].map(|v| (0.5 * (v + 1.0)).clamp(0.0, 1.0))
}

/// The direction whose x and y have a place.
pub fn direction_at(place: [f64; 2]) -> Direction {
    let [a, b] = place.map(|v| 2.0 * v - 1.0);
    let (radius, phi) = if a == 0.0 && b == 0.0 {
        (0.0, 0.0)
    } else if a > b.abs() {
        (a, b / a)
    } else if b > a.abs() {
        (b, 2.0 - a / b)
    } else if -a > b.abs() {
        (-a, 4.0 + b / a)
    } else if -b > a.abs() {
        (-b, 6.0 - a / b)
    } else {
        // A diagonal.
        let phi = f64::from(if a > 0.0 { 1 } else { 3 });
        (a.abs(), if b > 0.0 { phi } else { 8.0 - phi })
    };
    Direction::from_deg(radius.clamp(0.0, 1.0).arc_sine().to_degrees(), phi * 45.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_and_directions_are_each_others_and_areas_are_kept() {
        // Known ones: the axes, the diagonals, the centre.
        for (disk, place) in [
            ([0.0, 0.0], [0.5, 0.5]),
            ([1.0, 0.0], [1.0, 0.5]),
            ([0.0, 1.0], [0.5, 1.0]),
            ([-1.0, 0.0], [0.0, 0.5]),
            ([0.0, -1.0], [0.5, 0.0]),
            ([0.5f64.sqrt(), 0.5f64.sqrt()], [1.0, 1.0]),
            ([-(0.5f64.sqrt()), -(0.5f64.sqrt())], [0.0, 0.0]),
        ] {
            let found = of_disk(disk);
            assert!(
                (0..2).all(|i| (found[i] - place[i]).abs() < 1e-9),
                "{found:?}"
            );
        }
        let n = 64;
        let mut inside = 0;
        for k in 0..n * n {
            let place = [k % n, k / n].map(|i| (f64::from(i) + 0.4) / f64::from(n));
            let d = direction_at(place);
            let v = d.to_vec3();
            let back = of_disk([v[0], v[1]]);
            assert!(
                (0..2).all(|i| (back[i] - place[i]).abs() < 1e-9),
                "{place:?}"
            );
            // x < ½ is 0.8045 of the disk's area.
            inside += u32::from(v[0] < 0.5);
        }
        let share = f64::from(inside) / f64::from(n * n);
        assert!((share - 0.8045).abs() < 0.01, "{share}");
    }
}
