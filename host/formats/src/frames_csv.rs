//! `frames.csv`: which frame was taken of what, and where the arms were.

use crate::named_table::{NamedRows, NamedTable};
use crate::{FileError, dng, write_whole};
use gonia_brdf::direction::angle_between;
use gonia_brdf::{Direction, Pose, Sample};
use gonia_rig::{Exposure, FrameRow, Role};
use std::collections::HashMap;
use std::collections::hash_map::Entry;
use std::io::Write;
use std::path::{Component, Path};

/// The frames of a capture folder.
#[derive(Clone, Debug, Default)]
pub struct FrameList {
    /// One row a frame, in the order of their first rows.
    pub rows: Vec<FrameRow>,
    /// The raw exposures of each of them; none for a frame of linear radiance.
    pub exposures: Vec<Vec<Exposure>>,
}

/// Exposures of one frame must have been taken at one pose, to this many degrees.
const SAME_POSE_DEG: f64 = 0.03;

/// Reads `frames.csv`. Columns are found by name, in any order; others are ignored. Rows with a
/// number in the optional column `exposure_s` are raw exposures, and so are DNGs, which say their own; those
/// of one frame and role make a bracket.
///
/// # Errors
/// One line naming the file and its line: a missing column, a number that is none, a polar angle
/// outside 0° ≤ θ < 90°, an unknown role, a frame named twice that is no bracket or whose arms
/// moved, an exposure time that is not positive, or a path that leaves the folder.
pub fn read_frames_csv(path: &Path) -> Result<FrameList, FileError> {
    let table = NamedTable::open(path, &["frame", "role", "file"], 5)?;
    // First: where angles are missing, that is no table of poses at all.
    let angles = table.angles()?;
    let [frame, role, file] = [
        table.column("frame")?,
        table.column("role")?,
        table.column("file")?,
    ];
    let exposure = table.optional_column("exposure_s")?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut list = FrameList::default();
    let mut places = HashMap::new();
    let mut table_rows = table.rows();
    while table_rows.advance()? {
        let table = &mut table_rows;
        let row = FrameRow {
            frame: parse_frame(table, frame)?,
            role: parse_role(table, role)?,
            pose: table.pose(angles)?,
            file: parse_file(table, file, folder)?,
        };
        let exposure = exposure_of(table, exposure, &row.file, folder)?;
        let name = format!("{} frame {}", row.role.name(), row.frame);
        match places.entry((row.frame, row.role)) {
            Entry::Vacant(place) => {
                place.insert(list.rows.len());
                list.rows.push(row);
                list.exposures.push(exposure.into_iter().collect());
            }
            Entry::Occupied(place) => {
                let place = *place.get();
                let bracket = &mut list.exposures[place];
                let (Some(exposure), false) = (exposure, bracket.is_empty()) else {
                    return Err(table.wrong(
                        format_args!("{name} is there twice"),
                        "number the frames of a role differently, or give each exposure of a bracket its exposure_s",
                    ));
                };
                if !is_same(list.rows[place].pose, row.pose) {
                    return Err(table.wrong(
                        format_args!("the arms moved between the exposures of {name}"),
                        "give the exposures of a bracket one pose, and other poses another number",
                    ));
                }
                bracket.push(exposure);
            }
        }
    }
    Ok(list)
}

fn exposure_of(
    table: &mut NamedRows<'_>,
    column: Option<usize>,
    file: &str,
    folder: &Path,
) -> Result<Option<Exposure>, FileError> {
    let given = column.filter(|column| !table.text(*column).is_empty());
    let Some(column) = given else {
        return own_exposure(table, file, folder);
    };
    let exposure_s: f64 = table.number(column)?;
    if !(exposure_s > 0.0 && exposure_s.is_finite()) {
        return Err(table.wrong(
            format_args!("exposure_s {exposure_s} is not a time"),
            "give seconds above 0, or nothing for a frame of linear radiance",
        ));
    }
    Ok(Some(Exposure {
        file: file.to_owned(),
        exposure_s,
    }))
}

/// The exposure time that a DNG says itself; `None` for files of radiance.
fn own_exposure(
    table: &NamedRows<'_>,
    file: &str,
    folder: &Path,
) -> Result<Option<Exposure>, FileError> {
    let ending = Path::new(file).extension().unwrap_or_default();
    let path = folder.join(file);
    // A file that is not there is named where all are looked for.
    if !ending.eq_ignore_ascii_case("dng") || !path.is_file() {
        return Ok(None);
    }
    let Some(exposure_s) = dng::exposure_s(&path)? else {
        return Err(table.wrong(
            format_args!("\"{file}\" does not say how long it was exposed"),
            "give seconds in the column exposure_s",
        ));
    };
    Ok(Some(Exposure {
        file: file.to_owned(),
        exposure_s,
    }))
}

fn is_same(a: Pose, b: Pose) -> bool {
    let apart = |a: Direction, b: Direction| angle_between(a.to_vec3(), b.to_vec3()).to_degrees();
    apart(a.light, b.light) <= SAME_POSE_DEG && apart(a.view, b.view) <= SAME_POSE_DEG
}

fn parse_frame(table: &mut NamedRows<'_>, column: usize) -> Result<u32, FileError> {
    match table.number(column)? {
        Sample::NO_FRAME => Err(table.wrong(
            format_args!("frame {} stands for none", Sample::NO_FRAME),
            "number the frames from 0",
        )),
        frame => Ok(frame),
    }
}

fn parse_role(table: &NamedRows<'_>, column: usize) -> Result<Role, FileError> {
    let word = table.text(column);
    let role = Role::ALL
        .into_iter()
        .find(|role| word.eq_ignore_ascii_case(role.name()));
    role.ok_or_else(|| {
        table.wrong(
            format_args!("role \"{word}\" is unknown"),
            "write material, reference or mirror",
        )
    })
}

fn parse_file(table: &NamedRows<'_>, column: usize, folder: &Path) -> Result<String, FileError> {
    let file = table.text(column);
    if file.is_empty() {
        return Err(table.wrong("the file is not named", "give its path inside the folder"));
    }
    inside(file, folder).ok_or_else(|| {
        table.wrong(
            format_args!("\"{file}\" is not inside the capture folder"),
            "give a path relative to it, without \"..\"",
        )
    })
}

/// A path of `frames.csv` relative to its folder, with `/` between its parts whatever system wrote it.
/// An absolute path counts when it leads into the folder, here or, by the folder's name, on the
/// computer that it was written on.
fn inside(file: &str, folder: &Path) -> Option<String> {
    let file = file.replace('\\', "/");
    let has_drive = file.as_bytes().get(1) == Some(&b':');
    let relative = if file.starts_with('/') || has_drive {
        let here = std::path::absolute(folder).ok()?;
        let within = Path::new(&file).strip_prefix(&here).ok();
        let name = here.file_name()?.to_str()?;
        let by_name = || file.rsplit_once(&format!("/{name}/")).map(|(_, rest)| rest);
        within.and_then(Path::to_str).or_else(by_name)?
    } else {
        &file
    };
    let stays = Path::new(relative)
        .components()
        .all(|part| matches!(part, Component::Normal(_) | Component::CurDir));
    stays.then(|| relative.to_owned())
}

/// Writes `frames.csv` whole. Angles keep their nearest millionth of a degree.
///
/// # Errors
/// When the file cannot be written.
pub fn write_frames_csv(path: &Path, rows: &[FrameRow]) -> Result<(), FileError> {
    write_whole(path, |out| {
        writeln!(
            out,
            "frame,role,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg,file"
        )?;
        for row in rows {
            let Pose { light, view } = row.pose;
            writeln!(
                out,
                "{},{},{},{},{},{},{}",
                row.frame,
                row.role.name(),
                Degrees(light.theta_deg()),
                Degrees(light.phi_deg()),
                Degrees(view.theta_deg()),
                Degrees(view.phi_deg()),
                Quoted(&row.file),
            )?;
        }
        Ok(())
    })
}

/// Degrees as people write them: no more than six decimals, and none that say nothing.
pub(super) struct Degrees(pub f64);

impl std::fmt::Display for Degrees {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", (self.0 * 1e6).round() / 1e6)
    }
}

/// A text field, quoted where CSV needs it.
struct Quoted<'a>(&'a str);

impl std::fmt::Display for Quoted<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0.contains([',', '"', '\n', '\r', '#']) {
            write!(f, "\"{}\"", self.0.replace('"', "\"\""))
        } else {
            f.write_str(self.0)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: &str = "frame,role,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg,file\n";

    fn read_text(text: &str) -> Result<Vec<FrameRow>, FileError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frames.csv");
        std::fs::write(&path, text).unwrap();
        Ok(read_frames_csv(&path)?.rows)
    }

    #[test]
    fn rows_come_back_as_they_were_written() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frames.csv");
        let row = |frame, role, theta, phi: f64, file: &str| FrameRow {
            frame,
            role,
            pose: Pose {
                light: Direction::from_deg(theta, phi),
                view: Direction::from_deg(30.0, 90.0),
            },
            file: file.into(),
        };
        let rows = vec![
            row(0, Role::Material, 15.0, 60.0, "frames/000000.exr"),
            row(0, Role::Reference, 85.123457, 359.9, "frames/a, b.exr"),
        ];
        write_frames_csv(&path, &rows).unwrap();
        let back = read_frames_csv(&path).unwrap().rows;
        for (a, b) in rows.iter().zip(&back) {
            assert_eq!((a.frame, a.role, &a.file), (b.frame, b.role, &b.file));
            assert!((a.pose.light.theta - b.pose.light.theta).abs() < 1e-8);
            assert!((a.pose.light.phi - b.pose.light.phi).abs() < 1e-8);
        }
        assert_eq!(rows.len(), back.len());
        assert!(
            std::fs::read_to_string(&path)
                .unwrap()
                .contains("\n0,material,15,60,30,90,")
        );
    }

    #[test]
    fn columns_are_found_by_name_and_azimuths_wrap() {
        let rows = read_text(
            "note,file,phi_v_deg,theta_v_deg,phi_i_deg,theta_i_deg,role,frame\n\
             x, f/1.exr, -90, 0, 420, 89.9, reference, 7\n",
        )
        .unwrap();
        assert_eq!((rows[0].frame, rows[0].role), (7, Role::Reference));
        assert_eq!(rows[0].file, "f/1.exr");
        assert!((rows[0].pose.light.phi_deg() - 60.0).abs() < 1e-9);
        assert!((rows[0].pose.view.phi_deg() - 270.0).abs() < 1e-9);
    }

    #[test]
    fn paths_of_other_systems_and_absolute_ones_lead_into_the_folder() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("run 7");
        std::fs::create_dir(&folder).unwrap();
        let path = folder.join("frames.csv");
        let file = |name: &str| {
            std::fs::write(&path, format!("{HEADER}0, Material ,1,2,3,4,{name}\n")).unwrap();
            read_frames_csv(&path).map(|list| list.rows[0].file.clone())
        };
        let absolute = folder.join("frames/1.exr");
        for name in [
            "frames/1.exr",
            "frames\\1.exr",
            " frames/1.exr\t",
            absolute.to_str().unwrap(),
            "C:\\data\\run 7\\frames\\1.exr",
            "/home/else/run 7/frames/1.exr",
        ] {
            assert_eq!(file(name).unwrap(), "frames/1.exr", "{name}");
        }
        for name in [
            "C:\\data\\frames\\1.exr",
            "..\\1.exr",
            "\\\\host\\share\\1.exr",
            "/data/run 7/../1.exr",
            "C:1.exr",
        ] {
            let error = file(name).unwrap_err().to_string();
            assert!(error.contains("not inside the capture folder"), "{error}");
        }
    }

    #[test]
    fn rows_with_exposure_times_make_brackets() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frames.csv");
        let header = HEADER.replace("file", "file,exposure_s");
        let read = |rows: &str| {
            std::fs::write(&path, format!("{header}{rows}")).unwrap();
            read_frames_csv(&path)
        };
        let list = read(
            "0,material,1,2,3,4,a.png,0.1\n\
             1,material,5,2,3,4,b.exr,\n\
             0,reference,1,2,3,4,r.png,1\n\
             0,material,1,2,3,4.02,c.png,0.4\n",
        )
        .unwrap();
        assert_eq!(list.rows.len(), 3);
        let files = |i: usize| -> Vec<(&str, f64)> {
            list.exposures[i]
                .iter()
                .map(|e| (e.file.as_str(), e.exposure_s))
                .collect()
        };
        assert_eq!(files(0), [("a.png", 0.1), ("c.png", 0.4)]);
        assert_eq!(files(1), []);
        assert_eq!(files(2), [("r.png", 1.0)]);
        for (row, said) in [
            ("0,material,1,2,3,4,c.png,0", "exposure_s 0 is not a time"),
            (
                "0,material,1,2,3,4,c.png,",
                "material frame 0 is there twice",
            ),
            (
                "0,material,1,2,3.1,4,c.png,1",
                "the arms moved between the exposures of material frame 0",
            ),
        ] {
            let error = read(&format!("0,material,1,2,3,4,a.png,0.1\n{row}\n")).unwrap_err();
            let error = error.to_string();
            assert!(error.contains("line 3") && error.contains(said), "{error}");
        }
    }

    #[test]
    fn what_cannot_be_trusted_is_refused_with_its_line() {
        for (row, said) in [
            (
                "1,material,90,0,0,0,a.exr",
                "theta_i_deg 90 is not a polar angle",
            ),
            (
                "1,material,0,0,-1,0,a.exr",
                "theta_v_deg -1 is not a polar angle",
            ),
            ("1,material,nan,0,0,0,a.exr", "theta_i_deg is NaN"),
            ("1,material,0,inf,0,0,a.exr", "phi_i_deg is inf"),
            ("-1,material,0,0,0,0,a.exr", "frame \"-1\""),
            (
                "4294967295,material,0,0,0,0,a.exr",
                "frame 4294967295 stands for none",
            ),
            ("1,dust,0,0,0,0,a.exr", "role \"dust\""),
            (
                "1,material,0,0,0,0,/etc/a.exr",
                "not inside the capture folder",
            ),
            (
                "1,material,0,0,0,0,b/../../a.exr",
                "not inside the capture folder",
            ),
            ("1,material,0,0,0,0,", "the file is not named"),
            ("1,material,0,0,0,a.exr", "6 fields where line 1 names 7"),
            (
                "0,material,0,0,0,0,b.exr",
                "material frame 0 is there twice",
            ),
        ] {
            let text = format!("{HEADER}0,material,1,2,3,4,a.exr\n{row}\n");
            let error = read_text(&text).unwrap_err().to_string();
            assert!(error.contains("frames.csv, line 3: "), "{error}");
            assert!(error.contains(said), "{error}");
            assert_eq!(error.lines().count(), 1);
        }
        let error = read_text("frame,role\n").unwrap_err().to_string();
        assert!(error.contains("no column \"theta_i_deg\""), "{error}");
    }

    #[test]
    fn a_spreadsheets_list_of_frames_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("frames.csv");
        let text = "Frame;Role;Theta_i [\u{b0}];Phi_i;Theta_v;Phi_v;File;Exposure_s [s]\r\n0;Material;15,5;60;30;90;\"a, b.png\";0,25\r\n;;;;;;;\r\n";
        let latin1: Vec<u8> = text.chars().map(|c| c as u8).collect();
        std::fs::write(&path, latin1).unwrap();
        let list = read_frames_csv(&path).unwrap();
        assert_eq!(
            (list.rows.len(), list.rows[0].file.as_str()),
            (1, "a, b.png")
        );
        assert_eq!(list.exposures[0][0].exposure_s, 0.25);
        assert!((list.rows[0].pose.light.theta_deg() - 15.5).abs() < 1e-9);
    }
}
