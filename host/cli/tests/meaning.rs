//! Samples that are not what they are taken for: what `gonia fill` says of them.
#![allow(clippy::unwrap_used)]

#[path = "common/cases.rs"]
mod cases;
mod common;

use cases::{Case, document};
use common::{gonia, text};
use gonia_brdf::Elementary;
use gonia_formats::dense::{read_dense_channels, write_dense_channels};
use gonia_rig::{Budget, Input, KnownFrom, ReferenceCalibration};
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

/// θi, φi, θv, φv in degrees, and a value.
type Row = [f64; 5];

/// Directions all over two hemispheres, of a highlight over a Lambertian base.
fn good() -> Vec<Row> {
    let part = |k: usize, factor: f64| (k as f64 * factor).fract();
    (1..=400)
        .map(|k| {
            let theta = |u: f64| (1.0 - 0.9 * u).arc_cosine().to_degrees();
            let angles = [
                theta(part(k, 0.819_173)),
                360.0 * part(k, 0.671_044),
                theta(part(k, 0.549_700)),
                360.0 * part(k, 0.450_300),
            ];
            with_value(angles)
        })
        .collect()
}

fn with_value([theta_i, phi_i, theta_v, phi_v]: [f64; 4]) -> Row {
    let vector = |theta: f64, phi: f64| {
        let (theta, phi) = (theta.to_radians(), phi.to_radians());
        [
            theta.sine() * phi.cosine(),
            theta.sine() * phi.sine(),
            theta.cosine(),
        ]
    };
    let (l, v) = (vector(theta_i, phi_i), vector(theta_v, phi_v));
    let half = [l[0] + v[0], l[1] + v[1], l[2] + v[2]];
    let cosine = half[2] / half.iter().map(|x| x * x).sum::<f64>().sqrt();
    [theta_i, phi_i, theta_v, phi_v, 0.1 + 0.5 * cosine.powi(80)]
}

/// The same rows, each changed by its number.
fn changed(rows: &[Row], change: impl Fn(usize, &mut Row)) -> Vec<Row> {
    let mut rows = rows.to_vec();
    rows.iter_mut()
        .enumerate()
        .for_each(|(k, row)| change(k, row));
    rows
}

/// Fills rows, with more arguments, and holds what is said against `words`.
fn case(came_in: &str, rows: &[Row], arguments: &[&str], code: i32, words: &[&str]) -> Case {
    let dir = tempfile::tempdir().unwrap();
    let (samples, dense) = (dir.path().join("s.csv"), dir.path().join("d.exr"));
    let mut csv = String::from("theta_i,phi_i,theta_v,phi_v,r,g,b\n");
    for [theta_i, phi_i, theta_v, phi_v, value] in rows {
        let values = format!("{value:.6},{value:.6},{value:.6}");
        writeln!(
            csv,
            "{theta_i:.4},{phi_i:.4},{theta_v:.4},{phi_v:.4},{values}"
        )
        .unwrap();
    }
    fs::write(&samples, csv).unwrap();
    let mut all = vec!["fill", text(&samples), "-o", text(&dense), "--step", "10"];
    all.extend(["--preset", "preview"]);
    all.extend(arguments);
    let output = gonia(&all, "");
    let printed = String::from_utf8_lossy(&output.stdout);
    let case = Case::new(came_in, &output, dir.path(), &[]);
    assert_eq!(case.code(), code, "{came_in}: {}", case.said());
    assert_eq!(dense.exists(), code == 0, "{came_in}");
    for word in words {
        assert!(case.said().contains(word), "{came_in}: {}", case.said());
    }
    assert!(
        !words.is_empty() || case.said().is_empty(),
        "{came_in}: {}",
        case.said()
    );
    if code == 0 {
        for row in ["cells extrapolated", "directional albedo"] {
            assert!(printed.contains(row), "{came_in}: {printed}");
        }
    }
    case
}

// long: a table, one case after the other.
#[test]
fn samples_that_contradict_what_they_are_taken_for_are_refused_or_remarked_on() {
    let good = good();
    let cases = [
        case("400 samples of a BRDF", &good, &[], 0, &[]),
        case(
            "all angles in radians",
            &changed(&good, |_, row| {
                row[..4]
                    .iter_mut()
                    .for_each(|angle| *angle = angle.to_radians());
            }),
            &[],
            1,
            &["they are radians, not degrees", "180/pi"],
        ),
        case(
            "azimuths in radians",
            &changed(&good, |_, row| {
                row[1] = row[1].to_radians();
                row[3] = row[3].to_radians();
            }),
            &[],
            0,
            &["azimuths none is beyond 6.2", "look like radians"],
        ),
        case(
            "polar angles from the surface",
            &changed(&good, |_, row| {
                row[0] = 90.0 - row[0];
                row[2] = 90.0 - row[2];
            }),
            &[],
            0,
            &["measured from the surface", "90 - theta"],
        ),
        case(
            "signed polar angles",
            &changed(&good, |k, row| {
                if k % 4 == 1 {
                    row[2] = -row[2];
                    row[3] = (row[3] + 180.0) % 360.0;
                }
            }),
            &[],
            0,
            &["s.csv, line 3: 100 of 400 samples have a negative polar angle"],
        ),
        case(
            "10 of 400 samples below the horizon",
            &changed(&good, |k, row| {
                if k % 40 == 0 {
                    row[2] = 91.0;
                }
            }),
            &[],
            0,
            &[
                "s.csv, line 2: 10 of 400 samples lie below the horizon",
                "left out",
            ],
        ),
        case(
            "8 of 400 samples without a value",
            &changed(&good, |k, row| {
                if k % 50 == 3 {
                    row[4] = f64::NAN;
                }
            }),
            &[],
            0,
            &[
                "s.csv, line 5: 8 of 400 samples hold a number that is not finite",
                "left out",
            ],
        ),
        case(
            "most samples below the horizon (transmission)",
            &changed(&good, |k, row| {
                if k % 4 > 0 {
                    row[2] = 180.0 - row[2];
                }
            }),
            &[],
            1,
            &["300 of 400 samples lie below the horizon"],
        ),
        case(
            "columns of θ and φ exchanged",
            &changed(&good, |_, row| {
                row.swap(0, 1);
                row.swap(2, 3);
            }),
            &[],
            1,
            &["exchange the columns theta and phi"],
        ),
        case(
            "f·cosθv in place of f",
            &changed(&good, |_, row| row[4] *= row[2].to_radians().cosine()),
            &[],
            0,
            &["look like f cos(theta_v)", "divide them"],
        ),
        case(
            "f·cosθi in place of f",
            &changed(&good, |_, row| row[4] *= row[0].to_radians().cosine()),
            &[],
            0,
            &["look like f cos(theta_i)", "divide them"],
        ),
        case(
            "f·cosθi·cosθv in place of f: nothing can tell",
            &changed(&good, |_, row| {
                row[4] *= row[0].to_radians().cosine() * row[2].to_radians().cosine();
            }),
            &[],
            0,
            &[],
        ),
        case(
            "30 % of the values negative",
            &changed(&good, |k, row| {
                row[4] *= if k % 10 < 3 { -1.0 } else { 1.0 }
            }),
            &[],
            0,
            &["120 of 400 samples are not above zero"],
        ),
        case(
            "all values negative",
            &changed(&good, |_, row| row[4] *= -1.0),
            &[],
            1,
            &["400 of 400 samples are not above zero"],
        ),
        case(
            "one azimuth of light",
            &changed(&good, |_, row| {
                let [theta_i, _, theta_v, phi_v, _] = *row;
                *row = with_value([theta_i, 180.0, theta_v, phi_v]);
            }),
            &[],
            0,
            &[
                "one azimuth of light, 180 degrees",
                "% of the cells are extrapolated",
            ],
        ),
        case(
            "a scan in the plane of incidence",
            &changed(&good, |k, row| {
                let [theta_i, _, theta_v, ..] = *row;
                *row = with_value([theta_i, 0.0, theta_v, 180.0 * (k % 2) as f64]);
            }),
            &[],
            0,
            &[
                "lie in the plane of incidence",
                "% of the cells are extrapolated",
            ],
        ),
        case(
            "one direction of light",
            &changed(&good, |_, row| {
                let [_, _, theta_v, phi_v, _] = *row;
                *row = with_value([30.0, 0.0, theta_v, phi_v]);
            }),
            &[],
            0,
            &["one direction of light"],
        ),
        case(
            "--symmetry isotropic of a material that is not",
            &changed(&good, |_, row| {
                let azimuths = (row[1] + row[3]).to_radians();
                row[4] *= 1.0 + 0.4 * azimuths.cosine();
            }),
            &["--symmetry", "isotropic"],
            0,
            &["contradict the symmetry that was asked for, isotropic"],
        ),
        case(
            "values of π·f said to be absolute",
            &changed(&good, |_, row| row[4] *= 4.0 * std::f64::consts::PI),
            &["--scale", "absolute"],
            0,
            &["more than it receives"],
        ),
    ];
    document("meaning", &cases);
}

#[test]
fn samples_are_asked_without_a_grid_and_keep_a_peak_that_a_grid_would_lose() {
    let dir = tempfile::tempdir().unwrap();
    let samples = dir.path().join("peak.csv");
    // A retro-reflector's peak of one degree, one azimuth of light.
    let value = |theta: f64| 0.1 + 2.0 * (-((theta - 30.3) / 0.5).powi(2)).exponential();
    let mut csv = String::from("theta_i,phi_i,theta_v,phi_v,brdf\n");
    for k in 0..600 {
        let theta = f64::from(k) * 0.1 + 5.0;
        writeln!(csv, "30,0,{theta},0,{}", value(theta)).unwrap();
    }
    fs::write(&samples, csv).unwrap();
    let asked = "theta_i,phi_i,theta_v,phi_v\n30,0,30.33,0\n30,77,30.33,77\n";
    let output = gonia(&["query", text(&samples)], asked);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(0), "{said}");
    assert!(said.contains("assumed to be isotropic"), "{said}");
    let printed = String::from_utf8_lossy(&output.stdout);
    let values: Vec<f64> = printed
        .lines()
        .skip(1)
        .map(|line| line.rsplit(',').next().unwrap().parse().unwrap())
        .collect();
    assert_eq!(values.len(), 2, "{printed}");
    for got in values {
        assert!((got / value(30.33) - 1.0).abs() < 0.05, "{printed}");
    }
}

#[test]
fn values_have_uncertainties_that_hold_what_the_samples_say_of_their_rig() {
    let dir = tempfile::tempdir().unwrap();
    let known = ReferenceCalibration::KnownReference;
    let small = |input: Input| (input.default_value() * 1e-3, KnownFrom::Stated);
    let budget = Budget::new(known, 0.3, [1100.0, 1800.0, 1.0], small);
    let write = |name: &str, note: &str| {
        let mut csv = format!("# scale = absolute\n{note}theta_i,phi_i,theta_v,phi_v,brdf\n");
        for [ti, pi, tv, pv, value] in good() {
            writeln!(csv, "{ti},{pi},{tv},{pv},{value}").unwrap();
        }
        let path = dir.path().join(name);
        fs::write(&path, csv).unwrap();
        path
    };
    // An error of the reference of 5 % is the same everywhere; one of the light's direction shows in the highlight.
    let noted = |budget: &Budget| format!("# uncertainties = {budget}\n");
    let scale = write(
        "scale.csv",
        &noted(&budget.clone().with(Input::Reference, 0.05)),
    );
    let direction = budget.clone().with(Input::LightDirection, 1.0);
    let direction = write("direction.csv", &noted(&direction));
    let alone = write("alone.csv", "");
    let asked = "theta_i,phi_i,theta_v,phi_v\n30,45,38,225\n40,10,20,90\n";
    let query = |arguments: &[&str]| {
        let output = gonia(arguments, asked);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{said}");
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        let (header, rows) = printed.split_once('\n').unwrap();
        assert!(header.ends_with(",Y,u_Y,U_Y"), "{header}");
        let rows = rows.lines().map(|line| {
            let cells: Vec<f64> = line.split(',').map(|cell| cell.parse().unwrap()).collect();
            assert!(
                (cells[6] - 2.0 * cells[5]).abs() < 1e-6 * cells[6],
                "{line}"
            );
            [cells[4], cells[5]]
        });
        (rows.collect::<Vec<[f64; 2]>>(), said)
    };
    let of = |path: &Path| query(&["query", text(path), "--uncertainty"]);
    let (noise, said) = of(&alone);
    assert!(said.contains("noise and interpolation alone"), "{said}");
    let (scaled, _) = of(&scale);
    let (directed, _) = of(&direction);
    for k in 0..2 {
        let share = |u: f64| (u * u - noise[k][1] * noise[k][1]).max(0.0).sqrt() / noise[k][0];
        assert!(
            (share(scaled[k][1]) - 0.05).abs() < 2e-3,
            "{k} {scaled:?} {noise:?}"
        );
    }
    let added = [0, 1].map(|k| directed[k][1] - noise[k][1]);
    assert!(added[0] > 3.0 * added[1], "{directed:?} {noise:?}");

    a_grid_has_them_too(dir.path(), &scale, asked, &query);
}

/// What a question on the command line gives: values with u, and what is said.
type Asks<'a> = &'a dyn Fn(&[&str]) -> (Vec<[f64; 2]>, String);

fn a_grid_has_them_too(dir: &Path, scale: &Path, asked: &str, query: Asks) {
    let (dense, error) = (dir.join("d.exr"), dir.join("e.exr"));
    let fill = [
        "fill",
        text(scale),
        "--step",
        "10",
        "-o",
        text(&dense),
        "--error",
        text(&error),
    ];
    let output = gonia(&fill, "");
    let printed = String::from_utf8_lossy(&output.stdout);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert!(printed.contains("u (k = 1), interior"), "{printed}");
    assert!(printed.contains("reference 5.00 %"), "{printed}");
    let (by_grid, _) = query(&["query", text(&dense), "--error", text(&error)]);
    for [value, u] in by_grid.iter().copied() {
        assert!(u > 0.05 * value && u < 0.2 * value, "{value} {u}");
    }
    assert!(printed.contains("albedo and U (k = 2)"), "{printed}");
    // Error bars of other values are none of these.
    let other = dir.join("other.exr");
    let scaled: String = std::fs::read_to_string(scale).unwrap();
    let (head, rows) = scaled.split_once("brdf\n").unwrap();
    let rows = rows.lines().map(|row| {
        let (angles, value) = row.rsplit_once(',').unwrap();
        format!("{angles},{}\n", 1.5 * value.parse::<f64>().unwrap())
    });
    let samples = dir.join("other.csv");
    std::fs::write(
        &samples,
        format!("{head}brdf\n{}", rows.collect::<String>()),
    )
    .unwrap();
    let fill = ["fill", text(&samples), "--step", "10", "-o", text(&other)];
    assert_eq!(gonia(&fill, "").status.code(), Some(0));
    let output = gonia(&["query", text(&other), "--error", text(&error)], asked);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(said.contains("is not of the values of"), "{said}");
    let output = gonia(&["query", text(&dense), "--uncertainty", "--grid"], asked);
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(
        said.contains("--error ERR.exr") && said.lines().count() == 1,
        "{said}"
    );
    // One that lies beside it by the usual name needs no words.
    std::fs::copy(&error, dir.join("error.exr")).unwrap();
    let (beside, said) = query(&["query", text(&dense), "--uncertainty", "--grid"]);
    assert_eq!(beside, by_grid);
    assert!(said.contains("error.exr"), "{said}");
}

#[test]
fn a_dense_brdf_of_few_samples_is_asked_by_their_fit_and_its_grid_where_they_are_not_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let (samples, dense) = (at("peak.csv"), at("d.exr"));
    let value = |theta: f64| 0.1 + 2.0 * (-((theta - 30.3) / 0.5).powi(2)).exponential();
    let mut csv = String::from("theta_i,phi_i,theta_v,phi_v,brdf\n");
    let mut asked = String::from("theta_i,phi_i,theta_v,phi_v\n");
    for k in 0..400 {
        let theta = f64::from(k) * 0.1 + 10.0;
        // Every fifth is held out.
        match k % 5 {
            4 => writeln!(asked, "30,0,{theta},0").unwrap(),
            _ => writeln!(csv, "30,0,{theta},0,{}", value(theta)).unwrap(),
        }
    }
    fs::write(&samples, &csv).unwrap();
    let fill = ["fill", text(&samples), "-o", text(&dense), "--step", "6"];
    assert_eq!(gonia(&fill, "").status.code(), Some(0));
    // What is printed, the largest error at the held-out directions, and what is said.
    let query = |arguments: &[&str]| {
        let output = gonia(&[&["query"], arguments].concat(), &asked);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(0), "{said}");
        let printed = String::from_utf8_lossy(&output.stdout).into_owned();
        let off = printed.lines().skip(1).map(|line| {
            let row: Vec<f64> = line.split(',').map(|v| v.parse().unwrap()).collect();
            (row[4] / value(row[2])).natural_log().abs()
        });
        let off = off.fold(0.0, f64::max);
        (printed, off, said)
    };
    let (of_samples, off, _) = query(&[text(&samples)]);
    assert!(off < 0.05, "{off}");
    let (printed, _, said) = query(&[text(&dense)]);
    assert_eq!(printed, of_samples);
    assert!(
        said.contains("evaluated: the fit of") && said.contains("peak.csv"),
        "{said}"
    );
    let (of_grid, off, said) = query(&[text(&dense), "--grid"]);
    assert!(off > 0.5 && !said.contains("evaluated"), "{off} {said}");
    // The same values times 1.5, with what was said of them.
    let mut file = read_dense_channels(&dense).unwrap();
    file.planes[0].iter_mut().for_each(|value| *value *= 1.5);
    let scaled = at("scaled.exr");
    write_dense_channels(&scaled, &file).unwrap();
    let (printed, _, said) = query(&[text(&scaled)]);
    assert_ne!(printed, of_samples);
    assert!(
        said.contains("its values are not those of its samples"),
        "{said}"
    );
    fs::write(&samples, csv + "30,0,60,0,0.1\n").unwrap();
    let (printed, _, said) = query(&[text(&dense)]);
    assert_eq!(printed, of_grid);
    assert!(said.contains("peak.csv has changed"), "{said}");
    fs::remove_file(&samples).unwrap();
    let (printed, _, said) = query(&[text(&dense)]);
    assert_eq!(printed, of_grid);
    assert!(
        said.contains("is not there") && !said.contains("warning"),
        "{said}"
    );
    for (arguments, word) in [
        (["query", text(&dense), "--symmetry=none"], "--symmetry"),
        (["query", text(&at("peak.csv")), "--grid"], "--grid"),
    ] {
        let output = gonia(&arguments, &asked);
        assert_eq!(output.status.code(), Some(1));
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(said.contains(word) && said.lines().count() == 1, "{said}");
    }
}
