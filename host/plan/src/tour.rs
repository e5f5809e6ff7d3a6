//! A short open path through some directions: nearest neighbours first, then improved until no
//! reversal of a stretch (2-opt) and no move of a short stretch elsewhere (Or-opt) helps.

use crate::MoveTime;
use gonia_brdf::Direction;

/// Longest stretch that is moved as a whole.
const STRETCH: usize = 3;
/// Improvements smaller than this, in seconds, are rounding.
const GAIN: f64 = 1e-9;

/// The order in which to visit all directions, starting at the first one.
///
/// The path will be travelled forwards and backwards, so a step counts the mean of both ways; 2-opt
/// needs that symmetry too, or it might never end.
pub fn shortest_path(directions: &[Direction], time: MoveTime) -> Vec<usize> {
    let times = both_ways(directions, &|a, b| time(*a, *b));
    let mut path = nearest_neighbours(&times);
    while reverse_a_stretch(&mut path, &times) || move_a_stretch(&mut path, &times) {}
    path
}

/// An order of thousands of places, starting at the first one: 2-opt only, since moving stretches
/// takes time with the cube of their number.
pub fn long_path<T>(places: &[T], time: &dyn Fn(&T, &T) -> f64) -> Vec<usize> {
    let times = both_ways(places, time);
    let mut path = nearest_neighbours(&times);
    while reverse_a_stretch(&mut path, &times) {}
    path
}

/// The mean of both ways between any two places.
fn both_ways<T>(places: &[T], time: &dyn Fn(&T, &T) -> f64) -> Vec<Vec<f64>> {
    let way = |a: &T, b: &T| 0.5 * (time(a, b) + time(b, a));
    places
        .iter()
        .map(|a| places.iter().map(|b| way(a, b)).collect())
        .collect()
}

fn nearest_neighbours(times: &[Vec<f64>]) -> Vec<usize> {
    let n = times.len();
    let mut path: Vec<usize> = (0..n.min(1)).collect();
    let mut left: Vec<usize> = (1..n).collect();
    while let Some(last) = path.last().copied() {
        let nearest =
            (0..left.len()).min_by(|a, b| times[last][left[*a]].total_cmp(&times[last][left[*b]]));
        let Some(nearest) = nearest else { break };
        path.push(left.remove(nearest));
    }
    path
}

/// The time of the step that leaves position `k`; nothing leaves the last.
fn leaving(path: &[usize], times: &[Vec<f64>], k: usize) -> f64 {
    match (path.get(k), path.get(k + 1)) {
        (Some(a), Some(b)) => times[*a][*b],
        _ => 0.0,
    }
}

fn reverse_a_stretch(path: &mut [usize], times: &[Vec<f64>]) -> bool {
    let n = path.len();
    let mut improved = false;
    for first in 1..n {
        for last in first + 1..n {
            let before = times[path[first - 1]][path[first]] + leaving(path, times, last);
            let mut after = times[path[first - 1]][path[last]];
            if last + 1 < n {
                after += times[path[first]][path[last + 1]];
            }
            if after < before - GAIN {
                path[first..=last].reverse();
                improved = true;
            }
        }
    }
    improved
}

fn move_a_stretch(path: &mut Vec<usize>, times: &[Vec<f64>]) -> bool {
    let total = |path: &[usize]| -> f64 { path.windows(2).map(|w| times[w[0]][w[1]]).sum() };
    let mut improved = false;
    for length in 1..=STRETCH {
        let mut first = 1;
        while first + length <= path.len() {
            let stretch: Vec<usize> = path[first..first + length].to_vec();
            let mut rest = path.clone();
            rest.drain(first..first + length);
            let before = total(path);
            let best = (1..=rest.len())
                .map(|at| {
                    let mut candidate = rest.clone();
                    candidate.splice(at..at, stretch.iter().copied());
                    candidate
                })
                .min_by(|a, b| total(a).total_cmp(&total(b)));
            if let Some(best) = best
                && total(&best) < before - GAIN
            {
                *path = best;
                improved = true;
            }
            first += 1;
        }
    }
    improved
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_on_a_line_are_visited_in_order() {
        let mixed: Vec<Direction> = [0.0, 50.0, 20.0, 40.0, 10.0, 30.0]
            .map(|t| Direction::from_deg(t, 0.0))
            .to_vec();
        let path = shortest_path(&mixed, &|a, b| (a.theta - b.theta).abs());
        assert_eq!(path, [0, 4, 2, 5, 3, 1]);
    }

    #[test]
    fn nothing_and_one_have_trivial_paths() {
        assert!(shortest_path(&[], &|_, _| 1.0).is_empty());
        let one = [Direction::from_deg(1.0, 2.0)];
        assert_eq!(shortest_path(&one, &|_, _| 1.0), [0]);
    }
}
