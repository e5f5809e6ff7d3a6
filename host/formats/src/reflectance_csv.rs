//! The table of a reference's reflectance: a CSV with r, g, b (or one value, reflectance) by theta_i, or
//! by theta_i, phi_i, theta_v, phi_v (degrees).

use crate::FileError;
use crate::named_table::{NamedRows, NamedTable};
use gonia_rig::ReflectanceTable;
use std::path::Path;

/// Reflectance factors, π times the BRDF, lie below this even at grazing angles.
const MOST: f64 = 10.0;

/// Reads a table. Columns are found by name.
///
/// # Errors
/// One line naming the file and its line: a missing column, no rows, a polar angle outside
/// 0° ≤ θ < 90°, one given twice, or a reflectance that is not above 0 and at most 10.
pub fn read_reflectance(path: &Path) -> Result<ReflectanceTable, FileError> {
    let table = NamedTable::open(path, &["theta_i"], 2)?;
    let theta_i = table.angle("theta_i")?;
    let others = ["phi_i", "theta_v", "phi_v"];
    let by_pose = others
        .iter()
        .map(|name| table.optional_column(name))
        .collect::<Result<Vec<_>, _>>()?
        .iter()
        .any(Option::is_some);
    let [r, g, b] = match table.optional_column("reflectance")? {
        Some(grey) => [grey; 3],
        None => [table.column("r")?, table.column("g")?, table.column("b")?],
    };
    let rho = |table: &mut NamedRows<'_>| {
        let rho: [f64; 3] = [table.number(r)?, table.number(g)?, table.number(b)?];
        match rho.iter().find(|rho| !(**rho > 0.0 && **rho <= MOST)) {
            None => Ok(rho),
            Some(wrong) => Err(table.wrong(
                format_args!("{wrong} is no reflectance"),
                format_args!("give more than 0 and at most {MOST}"),
            )),
        }
    };
    if by_pose {
        let angles = table.angles()?;
        let mut rows = Vec::new();
        let mut lines = table.rows();
        while lines.advance()? {
            rows.push((lines.pose(angles)?, rho(&mut lines)?));
        }
        return some(path, rows.is_empty(), ReflectanceTable::ByPose(rows));
    }
    let mut rows: Vec<(f64, [f64; 3])> = Vec::new();
    let mut lines = table.rows();
    while lines.advance()? {
        let (_, theta) = lines.angle(theta_i)?;
        if !(0.0..90.0).contains(&theta) {
            return Err(lines.wrong(
                format_args!("theta_i {theta} is not a polar angle"),
                "give degrees from the normal, from 0 to below 90",
            ));
        }
        if rows.iter().any(|row| row.0 == theta) {
            return Err(lines.wrong(
                format_args!("theta_i {theta} is there twice"),
                "give each polar angle once",
            ));
        }
        rows.push((theta, rho(&mut lines)?));
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    some(path, rows.is_empty(), ReflectanceTable::ByIncidence(rows))
}

fn some(path: &Path, empty: bool, table: ReflectanceTable) -> Result<ReflectanceTable, FileError> {
    if empty {
        return Err(FileError::new(path, "has no rows", "give at least one"));
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<ReflectanceTable, FileError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("t.csv");
        std::fs::write(&path, text).unwrap();
        read_reflectance(&path)
    }

    #[test]
    fn tables_by_incidence_are_put_in_order_and_those_by_pose_keep_theirs() {
        let table = read("theta_i,r,g,b\n60,.9,.9,.9\n8,.99,.98,.97\n").unwrap();
        let expected = vec![(8.0, [0.99, 0.98, 0.97]), (60.0, [0.9; 3])];
        assert_eq!(table, ReflectanceTable::ByIncidence(expected));
        let grey = read("Theta_i [deg];Reflectance\n60;0,9\n").unwrap();
        assert_eq!(grey, ReflectanceTable::ByIncidence(vec![(60.0, [0.9; 3])]));
        let table = read("theta_i,phi_i,theta_v,phi_v,r,g,b\n45,0,0,0,1.01,1,1\n").unwrap();
        assert!(matches!(table, ReflectanceTable::ByPose(rows) if rows.len() == 1));
    }

    #[test]
    fn what_is_no_reflectance_names_its_line() {
        for (rows, said) in [
            ("8,.9,0,.9", "line 2: 0 is no reflectance"),
            ("8,.9,nan,.9", "NaN is no reflectance"),
            ("90,.9,.9,.9", "theta_i 90 is not a polar angle"),
            ("8,1,1,1\n8,1,1,1", "line 3: theta_i 8 is there twice"),
            ("", "has no rows"),
        ] {
            let error = read(&format!("theta_i,r,g,b\n{rows}\n"))
                .unwrap_err()
                .to_string();
            assert!(error.contains(said), "{error}");
        }
        let error = read("theta_i,theta_v,r,g,b\n1,2,1,1,1\n")
            .unwrap_err()
            .to_string();
        assert!(error.contains("no column \"phi_i_deg\""), "{error}");
    }
}
