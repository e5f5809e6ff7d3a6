use super::read::read;
use super::{EXPORT, about_specular, view_at};
use crate::export::How;
use crate::export::lopsided::{Lopsided, file, median_ln, settings};
use gonia_brdf::direction::{dot, normalize};
use gonia_brdf::{Brdf, Direction, Elementary};
use std::path::Path;

fn write(path: &Path, one: bool) {
    let How::Brdf { write, .. } = &EXPORT.how else {
        panic!()
    };
    write(path, &file(&Lopsided, 6.0), &settings(24, one)).unwrap();
}

#[test]
fn angles_about_the_specular_direction_are_those_of_the_description() {
    let light = Direction::from_deg(40.0, 30.0);
    // Specular; 10 degrees further towards the light, and away from it; to the left as seen from above.
    for (view, radial, azimuth) in [
        ([40.0, 210.0], 0.0, None),
        ([30.0, 210.0], 10.0, Some(0.0)),
        ([60.0, 210.0], 20.0, Some(180.0)),
        ([20.0, 30.0], 60.0, Some(0.0)),
    ] {
        let view = Direction::from_deg(view[0], view[1]).to_vec3();
        let [r, a] = about_specular(light, view).map(f64::to_degrees);
        assert!((r - radial).abs() < 1e-6, "{r}");
        assert!(
            azimuth.is_none_or(|azimuth: f64| (a.abs() - azimuth).abs() < 1e-6),
            "{a}"
        );
    }
    // e2 = z × e1 lies at the light's azimuth and a quarter turn.
    let aside = view_at(light, 0.2, std::f64::consts::FRAC_PI_2);
    let e2 = Direction::from_deg(90.0, 120.0).to_vec3();
    assert!(dot(aside, e2) > 0.19);
    for k in 0..50 {
        let (r, a) = (f64::from(k) * 0.04 + 0.1, f64::from(k) * 0.12 - 3.0);
        let back = about_specular(light, view_at(light, r, a));
        assert!((back[0] - r).abs() < 1e-9 && (back[1] - a).abs() < 1e-9);
    }
}

#[test]
fn colours_and_one_value_come_back_the_right_way_round() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.bsdf");
    write(&path, false);
    let back = read(&path).unwrap();
    assert!(median_ln(back.as_ref(), &Lopsided, 70.0) < 0.02);
    write(&path, true);
    let back = read(&path).unwrap();
    let at = |t, p| Direction::from_deg(t, p).to_vec3();
    let (light, view) = (at(30.0, 45.0), at(52.0, 310.0));
    let [r, g, b] = Lopsided.eval(light, view);
    let wanted = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    for found in back.eval(light, view) {
        assert!((found / wanted - 1.0).abs() < 0.03, "{found} {wanted}");
    }
}

/// A second implementation, from the description alone: looks the value of a node up in the text.
#[test]
fn a_node_of_the_text_has_the_value_of_its_directions() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.bsdf");
    write(&path, true);
    let text = std::fs::read_to_string(&path).unwrap();
    let after = |key: &str| -> Vec<f64> {
        let mut lines = text.lines().skip_while(|line| !line.starts_with(key));
        lines.next();
        let list = lines.next().unwrap();
        list.split_whitespace()
            .map(|word| word.parse().unwrap())
            .collect()
    };
    let [turns, incidences, azimuths, radials] = [
        "SampleRotation",
        "AngleOfIncidence",
        "ScatterAzimuth",
        "ScatterRadial",
    ]
    .map(after);
    let lines: Vec<&str> = text
        .lines()
        .skip_while(|line| *line != "DataBegin")
        .collect();
    let (t, i, a, r) = (5, 8, 7, 11);
    let block = (t * incidences.len() + i) * (azimuths.len() + 1);
    assert!(lines[1 + block].starts_with("TIS "));
    let tis: f64 = lines[1 + block][4..].parse().unwrap();
    let row: Vec<f64> = lines[2 + block + a]
        .split_whitespace()
        .map(|word| word.parse().unwrap())
        .collect();
    assert_eq!(row.len(), radials.len());
    let light = Direction::from_deg(incidences[i], turns[t]).to_vec3();
    // The specular direction, and two axes across it, built by vectors.
    let specular = [-light[0], -light[1], light[2]];
    let e2 = normalize([-light[1], light[0], 0.0]);
    let cross = |a: [f64; 3], b: [f64; 3]| {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    };
    let e1 = cross(e2, specular);
    let (azimuth, radial) = (azimuths[a].to_radians(), radials[r].to_radians());
    let view = [0, 1, 2].map(|k| {
        specular[k] * radial.cosine()
            + radial.sine() * (e1[k] * azimuth.cosine() + e2[k] * azimuth.sine())
    });
    let [red, green, blue] = Lopsided.eval(light, view);
    let wanted = 0.2126 * red + 0.7152 * green + 0.0722 * blue;
    assert!((row[r] / wanted - 1.0).abs() < 0.03, "{} {wanted}", row[r]);
    // What is scattered of 40 degrees: 0.1 to 0.3 of each channel's factor, times about pi.
    assert!((0.2..1.2).contains(&tis), "{tis}");
}

#[test]
fn what_is_no_such_file_is_refused_with_line_and_remedy() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.bsdf");
    write(&path, true);
    let whole = std::fs::read_to_string(&path).unwrap();
    for (from, to, said) in [
        (
            "ScatterType  BRDF",
            "ScatterType  BTDF",
            "\"ScatterType BTDF\" is none",
        ),
        ("Asymmetrical4D", "Odd", "is none of what begins"),
        (
            "SampleRotation  25",
            "SampleRotation  24",
            "25 numbers where 24 are due",
        ),
        ("0\t15\t30", "15\t0\t30", "SampleRotation does not rise"),
        ("TIS ", "TOTAL ", "where TIS is due"),
        ("DataEnd", "", "ends before its values do"),
    ] {
        std::fs::write(&path, whole.replacen(from, to, 1)).unwrap();
        let error = read(&path).err().unwrap().to_string();
        assert!(error.contains(said), "{error}");
        assert_eq!(error.lines().count(), 1);
    }
    for k in 0..30 {
        std::fs::write(&path, &whole[..whole.len() * k / 30]).unwrap();
        assert!(read(&path).is_err(), "{k}");
    }
}
