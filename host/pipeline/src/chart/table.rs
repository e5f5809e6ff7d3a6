//! The chart as numbers.

use crate::chart::ChartPoint;
use gonia_rig::Stratum;
use std::fmt::Write as _;

/// The points that no other one beats in both cost and error, cheapest first, as indices. Points
/// without a finite error are on no front.
pub fn front(points: &[ChartPoint], error: impl Fn(&ChartPoint) -> Option<f64>) -> Vec<usize> {
    let mut ranked: Vec<(f64, f64, usize)> = points
        .iter()
        .enumerate()
        .filter_map(|(k, p)| Some((p.core_s, error(p)?, k)))
        .filter(|(cost, error, _)| cost.is_finite() && error.is_finite())
        .collect();
    ranked.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1)));
    let mut least = f64::INFINITY;
    ranked.retain(|(_, error, _)| {
        let is_better = *error < least;
        least = least.min(*error);
        is_better
    });
    ranked.into_iter().map(|(_, _, k)| k).collect()
}

/// One row a method and stratum. `front` is 1 where no other method beats it in both core-seconds
/// and this stratum's log-RMS.
pub fn to_csv(points: &[ChartPoint]) -> String {
    let mut text = String::from(
        "method,family,default,front,frames,core_s,share_measured,failed,stratum,tests,log_rms,log_mean,cos_error_mean,cos_error_p99,delta_e,sphere_delta_e\n",
    );
    let optional = |value: Option<f64>| value.map_or(String::new(), |v| format!("{v:.4}"));
    for stratum in Stratum::ALL {
        let of = |point: &ChartPoint| {
            let rows = &point.strata;
            rows.iter().find(|row| row.stratum == stratum).copied()
        };
        let front = front(points, |p| of(p).map(|row| row.log_rms));
        for (k, point) in points.iter().enumerate() {
            let Some(row) = of(point) else { continue };
            let _ = writeln!(
                text,
                "\"{}\",{},{},{},{},{:.3},{:.3e},{:.3e},{stratum},{},{:.5},{:.5},{:.5},{:.5},{},{}",
                point.name,
                point.family.name(),
                u8::from(point.is_default),
                u8::from(front.contains(&k)),
                point.frames,
                point.core_s,
                point.share,
                point.failed,
                row.cells,
                row.log_rms,
                row.log_mean,
                row.cos_error_mean,
                row.cos_error_p99,
                optional(row.delta_e),
                optional(point.sphere_delta_e),
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::chart::Family;

    fn point(core_s: f64, error: f64) -> ChartPoint {
        ChartPoint {
            name: "a,b".into(),
            family: Family::Rbf,
            is_default: false,
            frames: 3,
            core_s,
            share: 1.0,
            failed: 0.0,
            sphere_delta_e: Some(error),
            strata: Vec::new(),
        }
    }

    #[test]
    fn the_front_holds_what_nothing_beats() {
        let points = [
            point(10.0, 0.1),
            point(1.0, 0.5),
            point(5.0, 0.6),
            point(20.0, f64::NAN),
            point(30.0, 0.1),
            point(1.0, 0.7),
            point(40.0, 0.05),
        ];
        assert_eq!(front(&points, |p| p.sphere_delta_e), [1, 0, 6]);
        assert!(front(&points, |_| None).is_empty());
    }
}
