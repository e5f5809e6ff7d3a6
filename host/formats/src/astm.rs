//! Samples of Cornell University's gonioreflectometer, `.astm` (the format of ASTM E1392).
//!
//! Lines `NAME value` up to `VARS name,name,…`, then rows of numbers with commas. The names `theta_i`, `phi_i`, `theta_s`
//! and `phi_s` are angles in **radians** (of an isotropic material `phi_i` may be left out), the others values: `R`, `G`
//! and `B`, or one of any name, in 1/sr. `NUM_POINTS n` says how many rows there are. The layout is known from ALTA's
//! reader; no original file was at hand.

use crate::FileError;
use crate::format::{Content, ForeignContent, ForeignFormat, Format};
use crate::text_file::read_text;
use gonia_brdf::{Direction, Sample};
use gonia_rig::Scale;
use std::path::Path;

/// Cornell's format.
pub(super) static FORMAT: Format = Format {
    name: "Cornell ASTM",
    endings: &["astm"],
    magic: &[],
    content: Content::Foreign(ForeignFormat {
        name: "Cornell .astm",
        content: ForeignContent::Samples {
            scale: Some(Scale::Absolute),
            read: read_astm,
        },
    }),
};

/// Which column holds what.
struct Columns {
    theta_i: usize,
    phi_i: Option<usize>,
    theta_s: usize,
    phi_s: usize,
    /// Of the three colours; one value three times.
    values: [usize; 3],
    /// Columns in all.
    count: usize,
}

fn read_astm(path: &Path) -> Result<Vec<Sample>, FileError> {
    let text = read_text(path)?;
    let mut columns: Option<Columns> = None;
    let mut promised = None;
    let mut samples = Vec::new();
    let mut rows = 0;
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        let wrong = |what: String, remedy: &str| {
            FileError::new(path, what, remedy).at(format_args!("line {}", k + 1))
        };
        let Some(of) = &columns else {
            let (name, value) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
            match name {
                "VARS" => {
                    columns = Some(columns_of(value).map_err(|(what, remedy)| wrong(what, remedy))?)
                }
                "NUM_POINTS" => promised = value.trim().parse::<usize>().ok(),
                _ => {}
            }
            continue;
        };
        if line.is_empty() {
            continue;
        }
        let numbers: Option<Vec<f64>> = line
            .split(',')
            .map(|word| word.trim().parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        let numbers = numbers
            .filter(|numbers| numbers.len() == of.count)
            .ok_or_else(|| {
                let what = format!("is not a row of {} numbers with commas", of.count);
                wrong(what, "write one, or leave the line out")
            })?;
        rows += 1;
        samples.extend(sample(of, &numbers).map_err(|(what, remedy)| wrong(what, remedy))?);
    }
    if columns.is_none() {
        return Err(FileError::new(
            path,
            "has no line VARS",
            "give an .astm file with its header, in which VARS names the columns",
        ));
    }
    match promised {
        Some(n) if n != rows => Err(FileError::new(
            path,
            format_args!("holds {rows} rows, but NUM_POINTS says {n}"),
            "copy the file again",
        )),
        _ if samples.is_empty() => Err(FileError::new(
            path,
            "holds no row of a measurement",
            "copy the file again",
        )),
        _ => Ok(samples),
    }
}

/// What is wrong and what to do about it.
type Wrong = (String, &'static str);

fn columns_of(names: &str) -> Result<Columns, Wrong> {
    let names: Vec<&str> = names.split(',').map(str::trim).collect();
    let find = |name: &str| names.iter().position(|n| *n == name);
    let angle = |name: &str| {
        find(name).ok_or_else(|| {
            let remedy = "VARS names theta_i, theta_s and phi_s, mostly phi_i too";
            (format!("VARS without {name}"), remedy)
        })
    };
    let (theta_i, theta_s, phi_s) = (angle("theta_i")?, angle("theta_s")?, angle("phi_s")?);
    let angles = ["theta_i", "phi_i", "theta_s", "phi_s"];
    let others: Vec<usize> = (0..names.len())
        .filter(|k| !angles.contains(&names[*k]))
        .collect();
    let values = match (find("R"), find("G"), find("B"), &others[..]) {
        (Some(r), Some(g), Some(b), _) => [r, g, b],
        (_, _, _, [one]) if !["X", "Y", "Z"].contains(&names[*one]) => [*one; 3],
        _ => {
            let remedy = "of values R, G and B are read, or one alone";
            return Err((format!("VARS {}", names.join(",")), remedy));
        }
    };
    Ok(Columns {
        theta_i,
        phi_i: find("phi_i"),
        theta_s,
        phi_s,
        values,
        count: names.len(),
    })
}

/// The sample of a row; none where a direction is not above the surface.
fn sample(of: &Columns, x: &[f64]) -> Result<Option<Sample>, Wrong> {
    let [theta_i, theta_s] = [x[of.theta_i], x[of.theta_s]].map(f64::to_degrees);
    if !(0.0..=180.0).contains(&theta_i) || !(0.0..=180.0).contains(&theta_s) {
        let what = format!("polar angles of {theta_i:.1} and {theta_s:.1} degrees");
        return Err((what, "angles of .astm are radians"));
    }
    if theta_i >= 90.0 || theta_s >= 90.0 {
        return Ok(None);
    }
    let phi_i = of.phi_i.map_or(0.0, |k| x[k]).to_degrees();
    let (light, view) = (
        Direction::from_deg(theta_i, phi_i),
        Direction::from_deg(theta_s, x[of.phi_s].to_degrees()),
    );
    Ok(Some(Sample::new(
        light,
        view,
        of.values.map(|k| x[k] as f32),
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::lopsided::Lopsided;
    use gonia_brdf::Brdf;

    fn read(text: &str) -> Result<Vec<Sample>, FileError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.astm");
        std::fs::write(&path, text).unwrap();
        read_astm(&path)
    }

    #[test]
    fn rows_are_samples_whatever_the_order_of_columns() {
        let mut text =
            "TITLE blue\nNUM_POINTS 3\nVARS theta_i,phi_i,theta_s,phi_s,R,G,B\n".to_owned();
        let mut other = "NUM_POINTS 3\nVARS R,G,B,phi_s,theta_s,phi_i,theta_i\n".to_owned();
        let pairs = [
            [0.3, 0.5, 1.1, 4.0],
            [1.2, 3.0, 0.2, 6.0],
            [0.9, 5.5, 0.9, 5.4],
        ];
        for [ti, pi, ts, ps] in pairs {
            let at = |theta, phi| Direction { theta, phi }.to_vec3();
            let [r, g, b] = Lopsided.eval(at(ti, pi), at(ts, ps));
            text += &format!("{ti},{pi}, {ts},{ps},{r},{g},{b}\n");
            other += &format!("{r},{g},{b},{ps},{ts},{pi},{ti}\n");
        }
        let samples = read(&text).unwrap();
        assert_eq!(samples, read(&other).unwrap());
        for (s, [ti, pi, ts, ps]) in samples.iter().zip(pairs) {
            let found = [s.theta_i_deg, s.phi_i_deg, s.theta_v_deg, s.phi_v_deg];
            for (found, wanted) in found.into_iter().zip([ti, pi, ts, ps]) {
                assert!(
                    (f64::from(found) - wanted.to_degrees()).abs() < 1e-3,
                    "{s:?}"
                );
            }
            let at = |theta, phi| Direction { theta, phi }.to_vec3();
            let wanted = Lopsided.eval(at(ti, pi), at(ts, ps));
            assert!((f64::from(s.rgb[1]) / wanted[1] - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn one_value_without_azimuth_of_the_light_is_a_grey_and_odd_files_are_refused() {
        let good = "NUM_POINTS 1\nVARS theta_i,theta_s,phi_s,Integrated\n.1,.2,.3,.5\n";
        let samples = read(good).unwrap();
        assert_eq!((samples[0].phi_i_deg, samples[0].rgb), (0.0, [0.5; 3]));
        for (from, to, said) in [
            ("VARS", "COLUMNS", "has no line VARS"),
            ("theta_s", "theta", "VARS without theta_s"),
            (
                "Integrated",
                "X,Y,Z",
                "VARS theta_i,theta_s,phi_s,X,Y,Z; of values R",
            ),
            (
                "NUM_POINTS 1",
                "NUM_POINTS 2",
                "holds 1 rows, but NUM_POINTS says 2",
            ),
            (".3,.5", ".3", "line 3: is not a row of 4 numbers"),
            (
                ".1,.2",
                "10,.2",
                "line 3: polar angles of 573.0 and 11.5 degrees; angles of .astm are radians",
            ),
            (".1,.2", ".1,1.6", "holds no row"),
        ] {
            let error = read(&good.replace(from, to)).unwrap_err().to_string();
            assert!(
                error.contains(said) && error.lines().count() == 1,
                "{error}"
            );
        }
    }
}
