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
    let step = |a: Option<&usize>, b: Option<&usize>| match (a, b) {
        (Some(a), Some(b)) => times[*a][*b],
        _ => 0.0,
    };
    let mut improved = false;
    for length in 1..=STRETCH {
        let mut first = 1;
        while first + length <= path.len() {
            let end = first + length;
            let (head, tail) = (path.get(first), path.get(end - 1));
            // What the path gains without the stretch.
            let (before, after) = (path.get(first - 1), path.get(end));
            let gain = step(before, head) + step(tail, after) - step(before, after);
            // And what it costs between each two neighbours of the rest, or at its end.
            let cost = |at: usize| {
                let rest = |k: usize| path.get(if k < first { k } else { k + length });
                let (left, right) = (rest(at - 1), rest(at));
                step(left, head) + step(tail, right) - step(left, right)
            };
            let best = (1..=path.len() - length)
                .map(|at| (at, cost(at)))
                .min_by(|a, b| a.1.total_cmp(&b.1));
            if let Some((at, cost)) = best
                && cost < gain - GAIN
            {
                let stretch: Vec<usize> = path.drain(first..end).collect();
                path.splice(at..at, stretch);
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
    fn a_stretch_goes_where_it_costs_least_and_the_path_is_never_longer_for_it() {
        let way =
            |a: &Direction, b: &Direction| (a.theta - b.theta).abs().max((a.phi - b.phi).abs());
        // Scattered, and the same every time.
        let places: Vec<Direction> = (0..60)
            .map(|k| Direction::from_deg(f64::from(k * 37 % 90), f64::from(k * 101 % 360)))
            .collect();
        let times = both_ways(&places, &way);
        let total = |path: &[usize]| -> f64 { path.windows(2).map(|w| times[w[0]][w[1]]).sum() };
        let mut path: Vec<usize> = (0..60).collect();
        let mut last = total(&path);
        let mut moves = 0;
        while move_a_stretch(&mut path, &times) {
            assert!(total(&path) < last, "{} {last}", total(&path));
            last = total(&path);
            moves += 1;
        }
        assert!(moves > 1);
        let mut sorted = path.clone();
        sorted.sort_unstable();
        assert_eq!(sorted, (0..60).collect::<Vec<_>>());
        // No stretch of any length fits better anywhere else.
        for length in 1..=STRETCH {
            for first in 1..=path.len() - length {
                let mut rest = path.clone();
                let stretch: Vec<usize> = rest.drain(first..first + length).collect();
                for at in 1..=rest.len() {
                    let mut other = rest.clone();
                    other.splice(at..at, stretch.iter().copied());
                    assert!(total(&other) > last - 1e-6, "{first} {length} {at}");
                }
            }
        }
    }

    #[test]
    fn nothing_and_one_have_trivial_paths() {
        assert!(shortest_path(&[], &|_, _| 1.0).is_empty());
        let one = [Direction::from_deg(1.0, 2.0)];
        assert_eq!(shortest_path(&one, &|_, _| 1.0), [0]);
    }
}
