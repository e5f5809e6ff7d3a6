//! Samples of ALTA (Belcour, Courtès and Pacanowski), text.
//!
//! Lines of `#NAME value`, then rows of numbers. `#DIM n m` says how many columns are of directions and how many of
//! values, `#PARAM_IN` how directions are given, `#PARAM_OUT` what the values are; `#VS` how many columns of
//! uncertainties or weights follow the values, which are not read. Angles are radians. What is read:
//!
//! | `#PARAM_IN` | columns |
//! |---|---|
//! | `SPHERICAL_TL_PL_TV_PV` | θl, φl, θv, φv |
//! | `ISOTROPIC_TV_TL_DPHI`, `ISOTROPIC_TL_TV_DPHI` | the two polar angles in this order, φv − φl |
//! | `ISOTROPIC_TL_TV_PROJ_DPHI` | θl, θv cos Δφ, θv sin Δφ |
//! | `CARTESIAN` | the vectors of view and light, in this order |
//!
//! | `#PARAM_OUT` | value |
//! |---|---|
//! | `INV_STERADIAN`, `RGB_COLOR` | f in 1/sr |
//! | `INV_STERADIAN_COSINE_FACTOR` | f cos θv: the cosine is that of the outgoing direction, as ALTA's sources say; a measured file is reciprocal so, and with the light's cosine it is not |
//!
//! Where a row has no azimuth of the light, φl is 0.

use crate::FileError;
use crate::format::{Content, ForeignContent, ForeignFormat, Format};
use crate::text_file::read_text;
use gonia_brdf::{Direction, Elementary, Sample};
use gonia_rig::Scale;
use std::path::Path;

/// ALTA's format.
pub(super) static FORMAT: Format = Format {
    name: "ALTA",
    endings: &["dat", "alta"],
    magic: b"#",
    content: Content::Foreign(ForeignFormat {
        name: "ALTA text",
        content: ForeignContent::Samples {
            scale: Some(Scale::Absolute),
            read: read_alta,
        },
    }),
};

/// How directions are given.
#[derive(Clone, Copy)]
enum Input {
    Spherical,
    ViewLightAzimuth,
    LightViewAzimuth,
    Projected,
    Cartesian,
}

impl Input {
    const NAMES: [(&'static str, Self); 5] = [
        ("SPHERICAL_TL_PL_TV_PV", Self::Spherical),
        ("ISOTROPIC_TV_TL_DPHI", Self::ViewLightAzimuth),
        ("ISOTROPIC_TL_TV_DPHI", Self::LightViewAzimuth),
        ("ISOTROPIC_TL_TV_PROJ_DPHI", Self::Projected),
        ("CARTESIAN", Self::Cartesian),
    ];

    /// Columns.
    fn columns(self) -> usize {
        match self {
            Self::Spherical => 4,
            Self::Cartesian => 6,
            _ => 3,
        }
    }

    /// Light and view of a row.
    fn directions(self, x: &[f64]) -> [Direction; 2] {
        let at = |theta: f64, phi: f64| Direction::from_deg(theta.to_degrees(), phi.to_degrees());
        match (self, x) {
            (Self::Spherical, [tl, pl, tv, pv]) => [at(*tl, *pl), at(*tv, *pv)],
            (Self::ViewLightAzimuth, [tv, tl, between]) => [at(*tl, 0.0), at(*tv, *between)],
            (Self::LightViewAzimuth, [tl, tv, between]) => [at(*tl, 0.0), at(*tv, *between)],
            (Self::Projected, [tl, x, y]) => {
                let (tv, between) = (x.hypotenuse(*y), y.arc_tangent2(*x));
                [at(*tl, 0.0), at(tv, between)]
            }
            (Self::Cartesian, [vx, vy, vz, lx, ly, lz]) => {
                [[*lx, *ly, *lz], [*vx, *vy, *vz]].map(Direction::from_vec3)
            }
            _ => [Direction::from_deg(f64::NAN, 0.0); 2],
        }
    }
}

/// What the header says.
struct Header {
    input: Input,
    /// Columns of values: one or three.
    values: usize,
    has_cosine: bool,
}

fn read_alta(path: &Path) -> Result<Vec<Sample>, FileError> {
    let text = read_text(path)?;
    let header = header(path, &text)?;
    let n = header.input.columns();
    let mut samples = Vec::new();
    for (k, line) in text.lines().enumerate() {
        let line = line.trim();
        if line.is_empty() || line.starts_with('#') {
            continue;
        }
        let wrong = |what: String, remedy: &str| {
            FileError::new(path, what, remedy).at(format_args!("line {}", k + 1))
        };
        let numbers: Result<Vec<f64>, _> = line.split_whitespace().map(str::parse).collect();
        let numbers = numbers
            .ok()
            .filter(|numbers| numbers.len() >= n + header.values)
            .filter(|numbers| numbers.iter().all(|x| x.is_finite()))
            .ok_or_else(|| {
                let what = format!("is not a row of {} numbers", n + header.values);
                wrong(what, "write one, or leave the line out")
            })?;
        let [light, view] = header.input.directions(&numbers[..n]);
        let is_above = |d: Direction| (0.0..90.0 - 1e-9).contains(&d.theta_deg());
        if !is_above(light) || !is_above(view) {
            // A direction in the plane of the surface, or behind it, has no BRDF.
            continue;
        }
        let by = if header.has_cosine {
            1.0 / view.to_vec3()[2]
        } else {
            1.0
        };
        let value = |c: usize| (by * numbers[n + c.min(header.values - 1)]) as f32;
        samples.push(Sample::new(light, view, [0, 1, 2].map(value)));
    }
    if samples.is_empty() {
        return Err(FileError::new(
            path,
            "holds no row of a measurement",
            "copy the file again",
        ));
    }
    Ok(samples)
}

fn header(path: &Path, text: &str) -> Result<Header, FileError> {
    let find = |name: &str| {
        let of_line = |(k, line): (usize, &'_ str)| {
            let mut words = line.strip_prefix('#')?.split_whitespace();
            (words.next()? == name).then(|| (k + 1, words.map(str::to_owned).collect::<Vec<_>>()))
        };
        text.lines().enumerate().find_map(of_line)
    };
    let missing = |name: &str| {
        FileError::new(
            path,
            format_args!("has no line #{name}"),
            "give a file of ALTA with its header",
        )
    };
    let known = || Input::NAMES.map(|(name, _)| name).join(", ");
    let (line, words) = find("PARAM_IN").ok_or_else(|| missing("PARAM_IN"))?;
    let word = words.first().map_or("", String::as_str);
    let input = Input::NAMES.into_iter().find(|(name, _)| *name == word);
    let (_, input) = input.ok_or_else(|| {
        FileError::new(
            path,
            format_args!("#PARAM_IN {word}"),
            format_args!("of these it is read: {}", known()),
        )
        .at(format_args!("line {line}"))
    })?;
    let (line, words) = find("PARAM_OUT").ok_or_else(|| missing("PARAM_OUT"))?;
    let word = words.first().map_or("", String::as_str);
    let has_cosine = match word {
        "INV_STERADIAN" | "RGB_COLOR" => false,
        "INV_STERADIAN_COSINE_FACTOR" => true,
        _ => {
            let remedy =
                "of these it is read: INV_STERADIAN, RGB_COLOR, INV_STERADIAN_COSINE_FACTOR";
            return Err(
                FileError::new(path, format_args!("#PARAM_OUT {word}"), remedy)
                    .at(format_args!("line {line}")),
            );
        }
    };
    let (line, words) = find("DIM").ok_or_else(|| missing("DIM"))?;
    let numbers: Vec<usize> = words.iter().filter_map(|word| word.parse().ok()).collect();
    match numbers[..] {
        [n, values @ (1 | 3)] if n == input.columns() => Ok(Header {
            input,
            values,
            has_cosine,
        }),
        _ => Err(FileError::new(
            path,
            format_args!("#DIM {}", words.join(" ")),
            format_args!(
                "its directions take {} columns and its values 1 or 3",
                input.columns()
            ),
        )
        .at(format_args!("line {line}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::export::lopsided::Lopsided;
    use gonia_brdf::Brdf;

    const PAIRS: [[f64; 4]; 4] = [
        [0.3, 0.5, 1.1, 4.0],
        [1.2, 3.0, 0.2, 6.0],
        [0.0, 0.0, 0.7, 2.0],
        [0.9, 5.5, 0.9, 5.4],
    ];

    fn read(text: &str) -> Result<Vec<Sample>, FileError> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.dat");
        std::fs::write(&path, text).unwrap();
        read_alta(&path)
    }

    fn value(tl: f64, pl: f64, tv: f64, pv: f64) -> ([f64; 3], f64) {
        let at = |t: f64, p: f64| Direction { theta: t, phi: p }.to_vec3();
        (Lopsided.eval(at(tl, pl), at(tv, pv)), tv.cosine())
    }

    #[test]
    fn every_way_to_give_directions_is_the_same_sample() {
        for [tl, pl, tv, pv] in PAIRS {
            let (f, cos) = value(tl, pl, tv, pv);
            let [l, v] =
                [(tl, pl), (tv, pv)].map(|(theta, phi)| Direction { theta, phi }.to_vec3());
            let between = pv - pl;
            let (px, py) = (tv * between.cosine(), tv * between.sine());
            let rows = [
                ("SPHERICAL_TL_PL_TV_PV", format!("{tl} {pl} {tv} {pv}"), 0.0),
                (
                    "CARTESIAN",
                    format!("{} {} {} {} {} {}", v[0], v[1], v[2], l[0], l[1], l[2]),
                    0.0,
                ),
                ("ISOTROPIC_TV_TL_DPHI", format!("{tv} {tl} {between}"), pl),
                ("ISOTROPIC_TL_TV_DPHI", format!("{tl} {tv} {between}"), pl),
                ("ISOTROPIC_TL_TV_PROJ_DPHI", format!("{tl} {px} {py}"), pl),
            ];
            for (name, row, turn) in rows {
                for (out, by) in [("INV_STERADIAN", 1.0), ("INV_STERADIAN_COSINE_FACTOR", cos)] {
                    let n = row.split(' ').count();
                    let [r, g, b] = f.map(|f| f * by);
                    let text = format!(
                        "#DIM {n} 3\n#PARAM_IN {name}\n#PARAM_OUT {out}\n{row} {r} {g} {b}\n"
                    );
                    let samples = read(&text).unwrap();
                    let s = samples[0];
                    let found = [
                        (s.theta_i_deg, tl.to_degrees()),
                        (s.theta_v_deg, tv.to_degrees()),
                    ];
                    for (found, wanted) in found {
                        assert!((f64::from(found) - wanted).abs() < 1e-4, "{name}: {s:?}");
                    }
                    let apart = f64::from(s.phi_v_deg - s.phi_i_deg) - (between.to_degrees());
                    let apart = (apart + 180.0).rem_euclid(360.0) - 180.0;
                    assert!(tl == 0.0 || apart.abs() < 1e-3, "{name}: {s:?}");
                    let at = (f64::from(s.phi_i_deg) - (pl - turn).to_degrees()).rem_euclid(360.0);
                    assert!(tl == 0.0 || at.min(360.0 - at) < 1e-3, "{name}: {s:?}");
                    assert!(
                        (f64::from(s.rgb[2]) / f[2] - 1.0).abs() < 1e-5,
                        "{name} {out}: {s:?}"
                    );
                }
            }
        }
    }

    #[test]
    fn one_value_is_a_grey_and_what_is_below_the_surface_is_left_out() {
        let text = "#DIM 3 1\n#VS 0\n#PARAM_IN ISOTROPIC_TL_TV_PROJ_DPHI\n#PARAM_OUT INV_STERADIAN\n\
                    0.2 -1.5707963267948966 0 0.3\n0.2 0.1 -0.3 0.5\n";
        let samples = read(text).unwrap();
        assert_eq!(samples.len(), 1);
        assert_eq!(samples[0].rgb, [0.5; 3]);
        assert!((samples[0].phi_v_deg - 288.434_95).abs() < 1e-3);
    }

    #[test]
    fn what_cannot_be_read_is_refused_in_a_line() {
        let good =
            "#DIM 4 1\n#PARAM_IN SPHERICAL_TL_PL_TV_PV\n#PARAM_OUT INV_STERADIAN\n.1 .2 .3 .4 .5\n";
        assert_eq!(read(good).unwrap().len(), 1);
        for (from, to, said) in [
            (
                "#DIM 4 1",
                "#DIM 3 1",
                "line 1: #DIM 3 1; its directions take 4 columns",
            ),
            ("#DIM 4 1\n", "", "has no line #DIM"),
            (
                "SPHERICAL_TL_PL_TV_PV",
                "RUSIN_TH_TD",
                "line 2: #PARAM_IN RUSIN_TH_TD; of these it is read: SPHERICAL",
            ),
            (
                "INV_STERADIAN",
                "COLOR_XYZ",
                "line 3: #PARAM_OUT COLOR_XYZ; of these",
            ),
            (".3 .4 .5", ".3 .4", "line 4: is not a row of 5 numbers"),
            (".3 .4 .5", ".3 nan .5", "line 4: is not a row of 5 numbers"),
            (".1 .2 .3 .4 .5", "", "holds no row"),
        ] {
            let error = read(&good.replace(from, to)).unwrap_err().to_string();
            assert!(
                error.contains(said) && error.lines().count() == 1,
                "{error}"
            );
        }
    }
}
