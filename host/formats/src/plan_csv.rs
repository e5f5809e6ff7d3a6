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

    const PLAN: &str =
        "index,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg\n0,15.5,60.25,30,90\n1,45,0,60,180.5\n";

    #[test]
    fn every_dialect_gives_the_same_poses() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("plan.csv");
        let poses = |bytes: &[u8]| -> Vec<[f64; 4]> {
            std::fs::write(&path, bytes).unwrap();
            let of = |Pose { light, view }: &Pose| {
                let angles = [
                    light.theta_deg(),
                    light.phi_deg(),
                    view.theta_deg(),
                    view.phi_deg(),
                ];
                angles.map(|angle| (angle * 1e6).round() * 1e-6)
            };
            read_plan_csv(&path).unwrap().iter().map(of).collect()
        };
        let usual = poses(PLAN.as_bytes());
        assert_eq!(usual.len(), 2);
        let utf16: Vec<u8> = "\u{feff}"
            .encode_utf16()
            .chain(PLAN.encode_utf16())
            .flat_map(u16::to_le_bytes)
            .collect();
        let german = PLAN
            .replace(',', ";")
            .replace('.', ",")
            .replace('\n', ";\r\n");
        let radians = |deg: f64| deg.to_radians();
        let in_radians = format!(
            "index,theta_i_rad,phi_i_rad,theta_v_rad,phi_v_rad\n0,{},{},{},{}\n1,{},0,{},{}\n",
            radians(15.5),
            radians(60.25),
            radians(30.0),
            radians(90.0),
            radians(45.0),
            radians(60.0),
            radians(180.5)
        );
        for bytes in [
            utf16,
            german.into_bytes(),
            PLAN.replace(',', "\t").into_bytes(),
            PLAN.replace(',', "  ").into_bytes(),
            format!("sep=,\n{PLAN}").into_bytes(),
            format!("Plan of Monday\n\n# {PLAN}").into_bytes(),
            PLAN.replace("theta_i_deg", "Theta_In [\u{b0}]")
                .replace("index", "Index")
                .into_bytes(),
            in_radians.into_bytes(),
        ] {
            assert_eq!(poses(&bytes), usual, "{}", String::from_utf8_lossy(&bytes));
        }
    }

    #[test]
    fn what_is_missing_twice_or_out_of_range_is_named_as_the_file_names_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("plan.csv");
        for (text, said) in [
            (
                PLAN.replace("phi_v_deg", "phi"),
                "line 1: there is no column \"phi_v_deg\"; found: index, theta_i_deg, phi_i_deg, theta_v_deg, phi;",
            ),
            (
                PLAN.replace("phi_v_deg", "phi_in")
                    .replace("phi_i_deg", "phi_i"),
                "phi_i and phi_in are columns of the same quantity",
            ),
            (
                PLAN.replace(',', ";").replace("15.5", "15,5"),
                "line 2: phi_i_deg \"60.25\" has a decimal point",
            ),
            (
                PLAN.replace("phi_v_deg\n", "phi_v_deg,phi_in\n")
                    .replace("90\n", "90,1\n"),
                "line 3: 5 fields where line 1 names 6",
            ),
            (
                PLAN.replace("_deg", "_rad"),
                "line 2: theta_i_rad 15.5 radians is not a polar angle",
            ),
            (String::new(), "the file has no header"),
        ] {
            std::fs::write(&path, text).unwrap();
            let error = read_plan_csv(&path).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
            assert_eq!(error.lines().count(), 1);
        }
    }
}
