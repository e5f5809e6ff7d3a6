//! Where further poses help most.
//!
//! A fill tells how uncertain each cell is. A frame sees a sheet of cells about its pose, and what lies
//! within reach of the sheet becomes better known: reach is the distance to the nearest pose that was
//! there before. Poses are taken one by one, each time the one that takes away the most; what it
//! will take away is taken off before the next is chosen, so that they do not crowd.

use gonia_brdf::Elementary;
use gonia_brdf::direction::{Vec3, dot, local_direction};
use gonia_brdf::hemisphere::{Ring, directions};
use gonia_brdf::{Direction, Grid, Pose};
use rayon::prelude::*;
use std::cmp::Ordering;
use std::collections::{BinaryHeap, HashMap};

/// How a frame covers directions, and which poses there are to choose from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reach {
    /// Distance of the light from the sample's centre, metres.
    pub light_m: f64,
    /// Distance of the camera, metres.
    pub camera_m: f64,
    /// Radius of the disc that is sampled, metres.
    pub radius_m: f64,
    /// Largest polar angles of light and view to choose from, degrees.
    pub theta_max_deg: [f64; 2],
    /// Light and view are never nearer to each other than this, degrees: one would hide the other.
    pub keep_out_deg: f64,
}

/// Poses that were chosen.
#[derive(Clone, Debug, PartialEq)]
pub struct Proposal {
    /// In the order of their worth, the best first.
    pub poses: Vec<Pose>,
    /// RMS over all cells of the relative standard error, before, and as it is expected with them.
    pub error: [f64; 2],
}

/// Steps of the directions to choose from, degrees: a third of the paper's.
const STEP_DEG: f64 = 5.0;
/// Points of the disc that stand for the sheet of a frame: radius (of the disc's) and number.
const SHEET: [(f64, usize); 3] = [(0.0, 1), (0.5, 5), (0.9, 9)];
/// The sum of these numbers.
const SHEET_POINTS: usize = 15;
/// A point of a sheet beyond the grid.
const OUTSIDE: u32 = u32::MAX;
/// A relative error counts as this at most: what is not known at all is not known, and no more.
const ERROR_MAX: f32 = 1.0;
/// What is farther than this from a frame gains nothing by it, degrees.
const REACH_MAX_DEG: f64 = 20.0;
/// A pose nearer than this to one that was measured is that one again, degrees.
const SAME_DEG: f64 = 2.0;

/// Chooses `n` poses to add to the `measured` ones (fewer when there are no more to choose from).
/// `relative_error` is the standard error of each cell of the grid as a share of its value.
pub fn propose(
    grid: Grid,
    relative_error: &[f32],
    measured: &[Pose],
    n: usize,
    reach: &Reach,
) -> Proposal {
    let mut variance: Vec<f32> = relative_error
        .iter()
        .map(|e| e.clamp(0.0, ERROR_MAX).powi(2))
        .collect();
    let before = rms(&variance);
    let nodes: Vec<Vec3> = (0..grid.n_directions())
        .map(|d| grid.direction(d).to_vec3())
        .collect();
    let mut places: Vec<Place> = measured.iter().map(Place::of).collect();
    let poses = candidates(reach);
    // Which cells each of them would see: gains are asked for again and again.
    let cells: Vec<[u32; SHEET_POINTS]> = poses
        .par_iter()
        .map(|pose| cells_of(grid, &sheet(pose, reach)))
        .collect();
    let mut heap: BinaryHeap<Candidate> = poses
        .par_iter()
        .enumerate()
        .filter_map(|(number, pose)| {
            let nearest = nearest(Place::of(pose), &places);
            let candidate = Candidate {
                gain: 0.0,
                number,
                nearest,
                compared: places.len(),
            };
            (nearest >= SAME_DEG.to_radians()).then(|| candidate.valued(&cells[number], &variance))
        })
        .collect();
    let mut chosen = Vec::with_capacity(n);
    while chosen.len() < n
        && let Some(best) = heap.pop()
    {
        let pose = poses[best.number];
        let place = Place::of(&pose);
        // A gain only falls while others are chosen: the first whose gain is of today is the best.
        if best.compared < places.len() {
            let nearest = best.nearest.min(nearest(place, &places[best.compared..]));
            if nearest >= SAME_DEG.to_radians() {
                let today = Candidate {
                    nearest,
                    compared: places.len(),
                    ..best
                };
                heap.push(today.valued(&cells[best.number], &variance));
            }
            continue;
        }
        lower(
            grid,
            &nodes,
            &mut variance,
            &sheet(&pose, reach),
            best.reach(),
        );
        places.push(place);
        chosen.push(pose);
    }
    Proposal {
        poses: chosen,
        error: [before, rms(&variance)],
    }
}

fn rms(variance: &[f32]) -> f64 {
    let sum: f64 = variance.iter().map(|v| f64::from(*v)).sum();
    (sum / variance.len().max(1) as f64).sqrt()
}

/// Light and view as vectors.
type Place = [Vec3; 2];

trait OfPose {
    fn of(pose: &Pose) -> Self;
}

impl OfPose for Place {
    fn of(pose: &Pose) -> Self {
        [pose.light.to_vec3(), pose.view.to_vec3()]
    }
}

/// Squared distance of two pairs of directions, as chords.
fn squared([l, v]: Place, [light, view]: Place) -> f64 {
    4.0 - 2.0 * (dot(l, light) + dot(v, view))
}

/// Distance to the nearest of some places, which count with light and view exchanged too; radians.
fn nearest(place: Place, others: &[Place]) -> f64 {
    let [light, view] = place;
    others
        .iter()
        .map(|other| squared(place, *other).min(squared([view, light], *other)))
        .fold(f64::INFINITY, f64::min)
        .max(0.0)
        .sqrt()
}

/// All pairs of directions to choose from.
fn candidates(reach: &Reach) -> Vec<Pose> {
    let closest = reach.keep_out_deg.to_radians().cosine();
    let [lights, views] = reach.theta_max_deg.map(|last_deg| {
        let last = (last_deg / STEP_DEG + 1e-9).floor() as usize;
        let ring = |k: usize| {
            let theta = k as f64 * STEP_DEG;
            let around = 360.0 * theta.to_radians().sine() / STEP_DEG;
            (theta, around.round().max(1.0) as usize)
        };
        directions(&(0..=last).map(ring).collect::<Vec<Ring>>())
    });
    lights
        .iter()
        .flat_map(|light| views.iter().map(move |view| (*light, *view)))
        .map(|(light, view)| Pose { light, view })
        .filter(|pose| {
            let [light, view] = Place::of(pose);
            dot(light, view) <= closest
        })
        .collect()
}

/// The directions of light and view at some points of a frame.
fn sheet(pose: &Pose, reach: &Reach) -> [Place; SHEET_POINTS] {
    let mut points = SHEET
        .iter()
        .flat_map(|(radius, n)| (0..*n).map(move |k| (*radius, k as f64 / *n as f64)));
    std::array::from_fn(|_| {
        let (radius, turn) = points.next().unwrap_or_default();
        let (s, c) = (std::f64::consts::TAU * turn).sine_cosine();
        let point = [c, s].map(|x| x * radius * reach.radius_m);
        [
            local_direction(pose.light, reach.light_m, point),
            local_direction(pose.view, reach.camera_m, point),
        ]
    })
}

fn cells_of(grid: Grid, sheet: &[Place; SHEET_POINTS]) -> [u32; SHEET_POINTS] {
    let index = |v: Vec3| {
        let d = Direction::from_vec3(v);
        grid.nearest(d.theta_deg(), d.phi_deg())
    };
    sheet.map(|[light, view]| match (index(light), index(view)) {
        (Some(light), Some(view)) => grid.cell(light, view) as u32,
        _ => OUTSIDE,
    })
}

/// A pose that may be chosen.
#[derive(Clone, Copy)]
struct Candidate {
    /// Mean variance on its sheet, times the area about it that it will be nearest to.
    gain: f64,
    number: usize,
    /// Distance to the nearest measured or chosen pose, radians.
    nearest: f64,
    /// So many places it was compared with.
    compared: usize,
}

impl Candidate {
    fn reach(&self) -> f64 {
        self.nearest.min(REACH_MAX_DEG.to_radians())
    }

    fn valued(self, cells: &[u32; SHEET_POINTS], variance: &[f32]) -> Self {
        // What falls off the grid counts as known.
        let seen = cells.iter().filter(|cell| **cell != OUTSIDE);
        let sum: f64 = seen.map(|cell| f64::from(variance[*cell as usize])).sum();
        Self {
            gain: sum / SHEET_POINTS as f64 * self.reach().powi(2),
            ..self
        }
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Candidate {
    /// By gain; of equal ones the first, so that the same error bars give the same poses.
    fn cmp(&self, other: &Self) -> Ordering {
        let by_gain = self.gain.total_cmp(&other.gain);
        by_gain.then(other.number.cmp(&self.number))
    }
}

/// Lowers the variance of the cells within reach of a sheet, and of their mirrors, with the square of
/// the distance.
fn lower(grid: Grid, nodes: &[Vec3], variance: &mut [f32], sheet: &[Place], reach: f64) {
    let limit = reach * reach;
    let mut factors: HashMap<usize, f32> = HashMap::new();
    for [light, view] in sheet {
        let within = |d: &Vec3| -> Vec<(usize, f64)> {
            nodes
                .iter()
                .enumerate()
                .map(|(k, node)| (k, (2.0 - 2.0 * dot(*node, *d)).max(0.0)))
                .filter(|(_, squared)| *squared < limit)
                .collect()
        };
        let views = within(view);
        for (l, dl) in within(light) {
            for (v, dv) in &views {
                let share = ((dl + dv) / limit) as f32;
                if share < 1.0 {
                    for cell in [grid.cell(l, *v), grid.cell(*v, l)] {
                        let factor = factors.entry(cell).or_insert(1.0);
                        *factor = factor.min(share);
                    }
                }
            }
        }
    }
    for (cell, factor) in factors {
        variance[cell] *= factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::direction::angle_between;

    const REACH: Reach = Reach {
        light_m: 1.1,
        camera_m: 1.8,
        radius_m: 0.277,
        theta_max_deg: [85.0, 75.0],
        keep_out_deg: 8.0,
    };

    fn grid() -> Grid {
        Grid::with_step_deg(6.0).unwrap()
    }

    fn pose(angles: [f64; 4]) -> Pose {
        Pose {
            light: Direction::from_deg(angles[0], angles[1]),
            view: Direction::from_deg(angles[2], angles[3]),
        }
    }

    /// Uncertain within 20° of a pair of directions and of its mirror.
    fn uncertain_near(centre: Pose) -> Vec<f32> {
        let grid = grid();
        let centre = Place::of(&centre);
        (0..grid.n_cells())
            .map(|cell| {
                let (light, view) = grid.light_and_view(cell);
                let place = [light, view].map(|d| grid.direction(d).to_vec3());
                let near = nearest(place, &[centre]) < 20f64.to_radians();
                if near { 0.5 } else { 0.01 }
            })
            .collect()
    }

    #[test]
    fn poses_go_where_the_error_is_and_keep_apart() {
        let centre = pose([45.0, 90.0, 30.0, 200.0]);
        let far = [pose([60.0, 300.0, 10.0, 0.0])];
        let proposal = propose(grid(), &uncertain_near(centre), &far, 12, &REACH);
        assert_eq!(proposal.poses.len(), 12);
        let [before, after] = proposal.error;
        assert!(after < 0.7 * before, "{before} {after}");
        for (k, pose) in proposal.poses.iter().enumerate() {
            let place = Place::of(pose);
            let off = nearest(place, &[Place::of(&centre)]).to_degrees();
            assert!(off < 35.0, "{pose:?} is {off} degrees off");
            let others: Vec<Place> = proposal.poses[..k].iter().map(Place::of).collect();
            assert!(nearest(place, &others) > 5f64.to_radians(), "{pose:?}");
        }
    }

    #[test]
    fn what_was_measured_in_reverse_is_not_proposed_again() {
        let centre = pose([45.0, 90.0, 30.0, 200.0]);
        let reverse = Pose {
            light: centre.view,
            view: centre.light,
        };
        let of_first = |measured: &[Pose]| {
            let chosen = propose(grid(), &uncertain_near(centre), measured, 1, &REACH).poses[0];
            nearest(Place::of(&chosen), &[Place::of(&centre)]).to_degrees()
        };
        let alone = of_first(&[pose([60.0, 300.0, 10.0, 0.0])]);
        let beside = of_first(&[reverse]);
        assert!(alone < 12.0 && beside > alone, "{alone} {beside}");
    }

    #[test]
    fn the_arms_can_go_there() {
        let even = vec![0.1; grid().n_cells()];
        let proposal = propose(grid(), &even, &[], 20, &REACH);
        assert_eq!(proposal.poses.len(), 20);
        for pose in &proposal.poses {
            assert!(pose.light.theta_deg() < 85.1 && pose.view.theta_deg() < 75.1);
            let [light, view] = Place::of(pose);
            assert!(angle_between(light, view).to_degrees() > 7.99, "{pose:?}");
        }
        let again = propose(grid(), &even, &[], 20, &REACH);
        assert_eq!(again, proposal);
    }
}
