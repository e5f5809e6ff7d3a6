//! The reflectance of a known reference: a number, or a table over directions.

use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{Direction, Pose};
use gonia_rig::{Reference, Reflectance, ReflectanceTable};
use std::f64::consts::PI;

/// Steps of the lattice on which a table is tabulated again, degrees: of θi and θv, and of the
/// azimuth between them.
const STEPS_DEG: [f64; 3] = [3.0, 3.0, 7.5];
const NODES: [usize; 3] = [31, 31, 25];
/// Rows of a table closer than this to a node are averaged, degrees.
const CORE_DEG: f64 = 1.0;

/// ρ/π of a reference for any pair of directions.
pub enum KnownReference {
    /// The same everywhere.
    Lambertian([f32; 3]),
    /// By θi, θv and the azimuth between light and view.
    Tabled(Vec<[f32; 3]>),
}

impl KnownReference {
    /// Of a rig's reference.
    pub fn new(reference: &Reference) -> Self {
        match &reference.reflectance {
            Reflectance::Lambertian(rho) => Self::Lambertian(rho.map(|rho| (rho / PI) as f32)),
            Reflectance::Table { table, .. } => Self::Tabled(tabulate(table)),
        }
    }

    /// ρ/π for unit vectors towards light and view.
    pub fn at(&self, light: Vec3, view: Vec3) -> [f32; 3] {
        match self {
            Self::Lambertian(value) => *value,
            Self::Tabled(nodes) => lookup(nodes, light, view),
        }
    }
}

fn tabulate(table: &ReflectanceTable) -> Vec<[f32; 3]> {
    let rows = match table {
        ReflectanceTable::ByIncidence(_) => Vec::new(),
        ReflectanceTable::ByPose(rows) => both_ways(rows),
    };
    let mut nodes = Vec::with_capacity(NODES.iter().product());
    for i in 0..NODES[0] {
        for v in 0..NODES[1] {
            for p in 0..NODES[2] {
                let [theta_i, theta_v, phi] = [i, v, p].map(|n| n as f64);
                let (theta_i, theta_v) = (theta_i * STEPS_DEG[0], theta_v * STEPS_DEG[1]);
                let rho = match table {
                    ReflectanceTable::ByIncidence(rows) => between(rows, theta_i),
                    ReflectanceTable::ByPose(_) => {
                        // The azimuth is the view's alone here, and distances know it: both ways.
                        let mean = |light_deg, view_deg| {
                            let light = Direction::from_deg(light_deg, 0.0).to_vec3();
                            let view = Direction::from_deg(view_deg, phi * STEPS_DEG[2]).to_vec3();
                            weighted_mean(&rows, light, view)
                        };
                        let (a, b) = (mean(theta_i, theta_v), mean(theta_v, theta_i));
                        [0, 1, 2].map(|c| 0.5 * (a[c] + b[c]))
                    }
                };
                nodes.push(rho.map(|rho| (rho / PI) as f32));
            }
        }
    }
    nodes
}

/// Rows with the light at azimuth zero and the view at up to 180°: a reference is the same whichever
/// way it is turned, mirrored, and with light and view exchanged.
fn both_ways(rows: &[(Pose, [f64; 3])]) -> Vec<(Vec3, Vec3, [f64; 3])> {
    let turned = |a: Direction, b: Direction, rho| {
        let apart = (a.phi_deg() - b.phi_deg() + 180.0).rem_euclid(360.0) - 180.0;
        let view = Direction::from_deg(b.theta_deg(), apart.abs());
        (
            Direction::from_deg(a.theta_deg(), 0.0).to_vec3(),
            view.to_vec3(),
            rho,
        )
    };
    rows.iter()
        .flat_map(|(pose, rho)| {
            [
                turned(pose.light, pose.view, *rho),
                turned(pose.view, pose.light, *rho),
            ]
        })
        .collect()
}

/// Shepard's mean: weights 1/d⁶, so that in three dimensions the near rows outweigh the many far
/// ones.
fn weighted_mean(rows: &[(Vec3, Vec3, [f64; 3])], light: Vec3, view: Vec3) -> [f64; 3] {
    let core2 = CORE_DEG.to_radians().powi(2);
    let (mut sum, mut total) = ([0.0; 3], 0.0);
    for (l, v, rho) in rows {
        let distance2 = 4.0 - 2.0 * (dot(*l, light) + dot(*v, view)) + core2;
        let weight = distance2.powi(-3);
        total += weight;
        for c in 0..3 {
            sum[c] += weight * rho[c];
        }
    }
    sum.map(|s| s / total)
}

/// Linear between the rows, which are in order, and constant beyond them.
fn between(rows: &[(f64, [f64; 3])], theta_deg: f64) -> [f64; 3] {
    let after = rows.partition_point(|row| row.0 <= theta_deg);
    let (a, b) = match (after.checked_sub(1), rows.get(after)) {
        (Some(before), Some(b)) => (rows[before], *b),
        (Some(before), None) => return rows[before].1,
        (None, _) => return rows[0].1,
    };
    let t = (theta_deg - a.0) / (b.0 - a.0);
    [0, 1, 2].map(|c| a.1[c] + t * (b.1[c] - a.1[c]))
}

fn lookup(nodes: &[[f32; 3]], light: Vec3, view: Vec3) -> [f32; 3] {
    let (i, v) = (Direction::from_vec3(light), Direction::from_vec3(view));
    let apart = ((i.phi_deg() - v.phi_deg() + 180.0).rem_euclid(360.0) - 180.0).abs();
    let place = [i.theta_deg(), v.theta_deg(), apart];
    let (mut low, mut share) = ([0; 3], [0.0f32; 3]);
    for axis in 0..3 {
        let at = (place[axis] / STEPS_DEG[axis]).clamp(0.0, (NODES[axis] - 1) as f64);
        low[axis] = (at as usize).min(NODES[axis] - 2);
        share[axis] = (at - low[axis] as f64) as f32;
    }
    let mut value = [0.0; 3];
    for corner in 0..8 {
        let (mut index, mut weight) = (0, 1.0);
        for axis in 0..3 {
            let up = corner >> axis & 1;
            index = index * NODES[axis] + low[axis] + up;
            weight *= if up == 1 {
                share[axis]
            } else {
                1.0 - share[axis]
            };
        }
        for c in 0..3 {
            value[c] += weight * nodes[index][c];
        }
    }
    value
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Elementary;

    fn known(table: ReflectanceTable) -> KnownReference {
        KnownReference::new(&Reference::from(Reflectance::Table {
            file: "t.csv".into(),
            table,
        }))
    }

    fn at(reference: &KnownReference, a: [f64; 4]) -> f64 {
        let light = Direction::from_deg(a[0], a[1]).to_vec3();
        let view = Direction::from_deg(a[2], a[3]).to_vec3();
        f64::from(reference.at(light, view)[1]) * PI
    }

    #[test]
    fn a_table_by_incidence_is_linear_between_its_rows_and_constant_beyond() {
        let reference = known(ReflectanceTable::ByIncidence(vec![
            (9.0, [0.9, 0.99, 0.9]),
            (60.0, [0.9, 0.95, 0.9]),
        ]));
        for (theta, rho) in [
            (0.0, 0.99),
            (9.0, 0.99),
            (34.5, 0.97),
            (60.0, 0.95),
            (85.0, 0.95),
        ] {
            assert!(
                (at(&reference, [theta, 40.0, 30.0, 200.0]) - rho).abs() < 1e-5,
                "{theta}"
            );
        }
    }

    #[test]
    fn a_table_over_poses_is_isotropic_reciprocal_and_true_at_its_rows() {
        // A smooth reflectance factor, higher towards grazing and in the forward direction.
        let truth = |theta_i: f64, theta_v: f64, apart: f64| {
            let [i, v] = [theta_i, theta_v].map(|t| t.to_radians().sine());
            0.98 + 0.1 * i * v * (1.0 - apart.to_radians().cosine()) / 2.0
        };
        let mut rows = Vec::new();
        for (i, v, p) in
            (0..7).flat_map(|i| (0..7).flat_map(move |v| (0..7).map(move |p| (i, v, p))))
        {
            let [theta_i, theta_v, apart] = [i as f64 * 12.0, v as f64 * 12.0, p as f64 * 30.0];
            let pose = Pose {
                light: Direction::from_deg(theta_i, 77.0),
                view: Direction::from_deg(theta_v, 77.0 + apart),
            };
            rows.push((pose, [truth(theta_i, theta_v, apart); 3]));
        }
        let reference = known(ReflectanceTable::ByPose(rows));
        for [i, v, p] in [
            [12.0, 36.0, 60.0],
            [36.0, 60.0, 90.0],
            [42.0, 30.0, 135.0],
            [66.0, 54.0, 165.0],
        ] {
            let value = at(&reference, [i, 10.0, v, 10.0 + p]);
            assert!(
                (value - truth(i, v, p)).abs() < 0.005,
                "{i} {v} {p}: {value}"
            );
            let mirrored = at(&reference, [i, 200.0, v, 200.0 - p]);
            assert!((value - mirrored).abs() < 1e-5);
            let exchanged = at(&reference, [v, 10.0, i, 10.0 + p]);
            assert!((value - exchanged).abs() < 1e-5);
        }
    }
}
