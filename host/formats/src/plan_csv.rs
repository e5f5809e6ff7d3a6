//! `plan.csv`: the poses of a session in travelling order.

use crate::csv_table::CsvTable;
use crate::frames_csv::Degrees;
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
    let mut table = CsvTable::open(path)?;
    let [index, theta_i, phi_i, theta_v, phi_v] = [
        table.column("index")?,
        table.column("theta_i_deg")?,
        table.column("phi_i_deg")?,
        table.column("theta_v_deg")?,
        table.column("phi_v_deg")?,
    ];
    let mut poses = Vec::new();
    while table.next_row()? {
        let found: usize = table.number(index)?;
        if found != poses.len() {
            return Err(table.wrong(
                format_args!("index {found} where {} is due", poses.len()),
                "make the plan anew, or number its rows from 0",
            ));
        }
        poses.push(Pose {
            light: table.arm_direction(theta_i, phi_i)?,
            view: table.arm_direction(theta_v, phi_v)?,
        });
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
