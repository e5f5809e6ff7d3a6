//! `plan.csv`: the poses of a session in travelling order.

use crate::frames_csv::Degrees;
use crate::named_table::NamedTable;
use crate::{FileError, write_whole};
use gonia_brdf::Pose;
use std::io::Write;
use std::path::Path;

/// Reads the poses of a plan in their order. The index must count from 0, so that a row that got
/// lost or moved is noticed.
///
/// # Errors
/// One line naming the file and its line: a missing column, an index out of order, a number that
/// is none, or a polar angle outside 0° ≤ θ < 90°.
pub fn read_plan_csv(path: &Path) -> Result<Vec<Pose>, FileError> {
    let table = NamedTable::open(path, &["index", "theta_i_deg"], 5)?;
    let (index, angles) = (table.column("index")?, table.angles()?);
    let mut rows = table.rows();
    let mut poses = Vec::new();
    while rows.advance()? {
        let found: usize = rows.number(index)?;
        if found != poses.len() {
            return Err(rows.wrong(
                format_args!("index {found} where {} is due", poses.len()),
                "make the plan anew, or number its rows from 0",
            ));
        }
        poses.push(rows.pose(angles)?);
    }
    Ok(poses)
}

/// Writes a plan whole. Angles keep their nearest millionth of a degree.
///
/// # Errors
/// When the file cannot be written.
pub fn write_plan_csv(path: &Path, poses: &[Pose]) -> Result<(), FileError> {
    write_whole(path, |out| {
        writeln!(out, "index,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg")?;
        for (index, Pose { light, view }) in poses.iter().enumerate() {
            writeln!(
                out,
                "{index},{},{},{},{}",
                Degrees(light.theta_deg()),
                Degrees(light.phi_deg()),
                Degrees(view.theta_deg()),
                Degrees(view.phi_deg()),
            )?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Direction;

    #[test]
    fn a_plan_keeps_its_order() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("plan.csv");
        let poses: Vec<Pose> = [(85.0, 345.0), (0.0, 0.0), (15.0, 60.0)]
            .map(|(t, p)| Pose {
                light: Direction::from_deg(t, p),
                view: Direction::from_deg(75.0, 90.0),
            })
            .to_vec();
        write_plan_csv(&path, &poses).unwrap();
        let back = read_plan_csv(&path).unwrap();
        assert_eq!(back.len(), 3);
        for (a, b) in poses.iter().zip(&back) {
            assert!((a.light.theta - b.light.theta).abs() < 1e-8);
            assert!((a.light.phi - b.light.phi).abs() < 1e-8);
        }

        let text = std::fs::read_to_string(&path)
            .unwrap()
            .replace("\n1,", "\n2,");
        std::fs::write(&path, text).unwrap();
        let error = read_plan_csv(&path).unwrap_err().to_string();
        assert!(error.contains("line 3: index 2 where 1 is due"), "{error}");
    }
}
