//! The table of what makes interpolation fail: every case is put to the default and to other
//! methods, and the rows are docs/src/explanation/stability.md.
//!
//! `GONIA_UPDATE_DOCS=1 cargo test -p gonia-tests --test interpolation_stability` writes the file;
//! without it the test fails when the file says something else. The default has a bound in every
//! row, stated before it was measured.

#![allow(clippy::unwrap_used, clippy::panic)]

use gonia_brdf::Elementary;
use std::fmt::Write as _;
use std::path::Path;

use gonia_brdf::baselines::{BaselineSettings, Predictor, Workspace};
use gonia_brdf::direction::{Vec3, angle_between, dot, local_direction, normalize};
use gonia_brdf::hemisphere::{Ring, directions};
use gonia_brdf::interpolate::{self, Data, FillSettings, Origin};
use gonia_brdf::model::{Kurt, KurtLobe};
use gonia_brdf::progress::silent;
use gonia_brdf::{Bins, Brdf, Direction, Grid, Sample};
use gonia_tests::random::uniform;
use rayon::prelude::*;

/// A small plan: 43 lights and as many views, nine points of the disc each.
const RINGS: [Ring; 5] = [(0.0, 1), (20.0, 6), (40.0, 10), (60.0, 12), (75.0, 14)];
const GRID_STEP_DEG: f64 = 6.0;
/// Places that are tested in a row, at most.
const PLACES: usize = 20;
/// Beyond the measured values and the true one by this factor, a value of the default is out of bounds.
const BEYOND: f32 = 3.0;

/// Methods of the columns, by name; the first is the default.
const METHODS: [&str; 7] = [
    "default",
    "paper",
    "rbf-linear,nugget=0",
    "nearest",
    "shepard",
    "mls1",
    "rbf-thin-plate",
];
/// What the condition number of the default is that of: its kernel, its neighbours, its smallest
/// nugget, cell by cell in double precision.
const LIKE_DEFAULT: &str = "rbf-matern,k=128,half=0.5,log,means,mirrored,nugget=1e-4";

struct Row {
    case: &'static str,
    truth: Box<dyn Brdf>,
    /// Changes the plan's samples.
    samples: fn(&dyn Brdf) -> Vec<Sample>,
    /// Whether a pair of directions belongs to the tested places.
    tested: fn(Direction, Direction) -> bool,
    /// Neighbours, where they are not the methods' own.
    neighbours: Option<usize>,
    /// Largest log-RMS of the default.
    bound: f64,
}

// long: a table, one entry a row.
fn rows() -> Vec<Row> {
    let row = |case, truth: Box<dyn Brdf>, samples, tested, bound| Row {
        case,
        truth,
        samples,
        tested,
        neighbours: None,
        bound,
    };
    let cloth = || {
        let lobe = |specular, mx, my, azimuth_deg| KurtLobe {
            specular: [specular, 0.7 * specular, 0.4 * specular],
            f0: 0.06,
            mx,
            my,
            alpha: 0.3,
            azimuth_deg,
        };
        let lobes = [lobe(1.5, 0.25, 0.5, 23.0), lobe(0.5, 0.3, 0.6, 113.0)];
        Box::new(Kurt::new([0.2, 0.15, 0.1], &lobes)) as Box<dyn Brdf>
    };
    vec![
        row("nothing wrong", cloth(), plan, interior, 0.05),
        row(
            "light or view at the pole",
            cloth(),
            plan,
            |i, v| interior(i, v) && i.theta_deg().min(v.theta_deg()) < 1.0,
            0.05,
        ),
        row(
            "azimuths around 0° = 360°",
            cloth(),
            plan,
            |i, v| interior(i, v) && near_seam(i) && near_seam(v),
            0.05,
        ),
        row(
            "every sample three times",
            cloth(),
            |truth| {
                let samples = plan(truth);
                [&samples[..], &samples, &samples].concat()
            },
            interior,
            0.05,
        ),
        row(
            "pairs of samples 0.0002° apart, in different bins",
            cloth(),
            pairs_across_borders,
            interior,
            0.05,
        ),
        row(
            "5000 samples within 5° of one pose, few elsewhere",
            cloth(),
            clustered,
            interior,
            0.1,
        ),
        row(
            "hole of 8° around view = light",
            cloth(),
            with_retro_hole,
            |i, v| interior(i, v) && apart_deg(i, v) < 8.0,
            0.05,
        ),
        row(
            "retro-reflector 15° wide, and the hole",
            Box::new(RetroReflector),
            with_retro_hole,
            |i, v| interior(i, v) && apart_deg(i, v) < 20.0,
            0.3,
        ),
        row(
            "both polar angles ≥ 78°, beyond all samples",
            cloth(),
            |truth| {
                let samples = plan(truth).into_iter();
                samples
                    .filter(|s| s.theta_i_deg.min(s.theta_v_deg) < 74.0)
                    .collect()
            },
            |i, v| i.theta_deg().min(v.theta_deg()) > 77.0,
            0.3,
        ),
        row(
            "1 % of the samples × 8",
            cloth(),
            |truth| {
                let mut samples = plan(truth);
                for (k, sample) in samples.iter_mut().enumerate() {
                    if uniform(7, k) < 0.01 {
                        sample.rgb = sample.rgb.map(|v| 8.0 * v);
                    }
                }
                samples
            },
            interior,
            0.1,
        ),
        Row {
            neighbours: Some(3),
            ..row("3 neighbours", cloth(), plan, interior, 0.2)
        },
        row(
            "no light measured between φ = 90° and 180°",
            cloth(),
            |truth| {
                let samples = plan(truth).into_iter();
                let empty = 90.0..180.0;
                let empty = |s: &Sample| empty.contains(&s.phi_i_deg) && s.theta_i_deg > 10.0;
                samples.filter(|s| !empty(s)).collect()
            },
            |i, v| interior(i, v) && i.theta_deg() > 15.0 && (110.0..160.0).contains(&i.phi_deg()),
            0.3,
        ),
        row(
            "eight samples",
            cloth(),
            |t| plan(t).into_iter().step_by(2000).take(8).collect(),
            interior,
            1.0,
        ),
        row(
            "one single sample",
            cloth(),
            |t| plan(t)[..1].to_vec(),
            interior,
            0.0,
        ),
        row(
            "the same value everywhere",
            Box::new(Constant),
            plan,
            interior,
            1e-3,
        ),
        row(
            "values over six decades",
            Box::new(SixDecades),
            plan,
            interior,
            0.1,
        ),
        row(
            "2 % of the samples NaN, 2 % negative",
            cloth(),
            |truth| {
                let mut samples = plan(truth);
                for (k, sample) in samples.iter_mut().enumerate() {
                    match uniform(11, k) {
                        x if x < 0.02 => sample.rgb[1] = f32::NAN,
                        x if x < 0.04 => sample.rgb = [-0.05; 3],
                        _ => {}
                    }
                }
                samples
            },
            interior,
            0.1,
        ),
        row(
            "a mirror-like lobe, α = 0.01, no frame sees its whole",
            Box::new(Kurt::new(
                [0.2, 0.15, 0.1],
                &[KurtLobe {
                    specular: [0.3; 3],
                    f0: 0.05,
                    mx: 0.01,
                    my: 0.01,
                    alpha: 0.3,
                    azimuth_deg: 0.0,
                }],
            )),
            plan,
            |i, v| interior(i, v) && half_deg(i, v) < 8.0,
            1.5,
        ),
    ]
}

/// What a method made of a case.
#[derive(Clone)]
struct Verdict {
    log_rms: f64,
    /// Share of the values (before reciprocal averaging) that failed.
    failed: f64,
    /// Share of the values that are not positive.
    negative: f64,
    condition: Option<f64>,
}

#[test]
fn the_default_keeps_its_bounds_and_the_table_is_what_happens() {
    let mut table = String::new();
    let methods = METHODS.iter().map(|name| match *name {
        "rbf-linear,nugget=0" => "paper without nugget",
        name => name,
    });
    let _ = writeln!(
        table,
        "| case | bound | extrapolated | {} |",
        methods.collect::<Vec<_>>().join(" | ")
    );
    let _ = writeln!(table, "|---|---|---{}|", "|---".repeat(METHODS.len()));
    let mut broken = Vec::new();
    for row in rows() {
        let bins = Bins::new(grid(), &(row.samples)(&*row.truth));
        let places = places(&row, &bins);
        assert!(places.len() >= 10, "{}: {} places", row.case, places.len());
        let beyond = extrapolated(&bins, &places);
        let mut line = format!("| {} | {} | {:.0} % ", row.case, row.bound, 100.0 * beyond);
        for name in METHODS {
            let verdict = if name == "default" {
                judge_default(&row, &bins, &places, &mut broken)
            } else {
                judge_cellwise(&row, &bins, &places, name)
            };
            if let (Some(verdict), "default") = (&verdict, name)
                && verdict.log_rms.is_nan() | (verdict.log_rms > row.bound)
            {
                broken.push(format!(
                    "{}: log RMS {:.4} > {}",
                    row.case, verdict.log_rms, row.bound
                ));
            }
            let _ = write!(
                line,
                "| {} ",
                verdict.map_or("refused".into(), |v| v.to_string())
            );
        }
        let _ = writeln!(table, "{line}|");
    }
    println!("{table}");
    assert!(broken.is_empty(), "{}", broken.join("\n"));
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/src/explanation/stability.md");
    let written = std::fs::read_to_string(&path).unwrap();
    let page = with_rows(&written, "rows", &table);
    if std::env::var_os("GONIA_UPDATE_DOCS").is_some() {
        std::fs::write(&path, &page).unwrap();
        return;
    }
    if let Err(difference) = alike(&written, &page) {
        panic!(
            "docs/src/explanation/stability.md is not what happens: {difference}; GONIA_UPDATE_DOCS=1 writes it"
        );
    }
}

/// The page with these rows between two marks.
fn with_rows(page: &str, mark: &str, rows: &str) -> String {
    let (open, close) = (format!("<!-- {mark} -->\n"), format!("<!-- /{mark} -->"));
    let (before, rest) = page.split_once(&open).unwrap();
    let (_, after) = rest.split_once(&close).unwrap();
    format!("{before}{open}{rows}{close}{after}")
}

fn grid() -> Grid {
    Grid::with_step_deg(GRID_STEP_DEG).unwrap()
}

fn interior(i: Direction, v: Direction) -> bool {
    i.theta_deg().max(v.theta_deg()) < 75.0
}

fn near_seam(d: Direction) -> bool {
    (d.phi_deg() + 180.0).rem_euclid(360.0) - 180.0 < 6.5
        && (d.phi_deg() + 180.0).rem_euclid(360.0) - 180.0 > -6.5
        && d.theta_deg() > 1.0
}

fn apart_deg(i: Direction, v: Direction) -> f64 {
    angle_between(i.to_vec3(), v.to_vec3()).to_degrees()
}

fn half_deg(i: Direction, v: Direction) -> f64 {
    let (i, v) = (i.to_vec3(), v.to_vec3());
    let h = normalize([i[0] + v[0], i[1] + v[1], i[2] + v[2]]);
    h[2].min(1.0).arc_cosine().to_degrees()
}

/// Cells of the case that have neither a bin nor a mirror with one, spread over them.
fn places(row: &Row, bins: &Bins) -> Vec<(usize, usize)> {
    let grid = bins.grid();
    let n = grid.n_directions();
    let mut known = vec![false; grid.n_cells()];
    for bin in bins.bins() {
        let (light, view) = grid.light_and_view(bin.cell as usize);
        known[grid.cell(light, view)] = true;
        known[grid.cell(view, light)] = true;
    }
    let once = |d: usize| !(1..grid.n_phi()).contains(&d);
    let all: Vec<(usize, usize)> = (0..grid.n_cells())
        .map(|cell| (cell / n, cell % n))
        .filter(|(i, v)| once(*i) && once(*v) && !known[grid.cell(*i, *v)])
        .filter(|(i, v)| (row.tested)(grid.direction(*i), grid.direction(*v)))
        .collect();
    let stride = (all.len() as f64 * 0.618_034) as usize;
    (0..all.len().min(PLACES))
        .map(|k| all[k * stride % all.len()])
        .collect()
}

/// The share of places that are said to be extrapolated.
fn extrapolated(bins: &Bins, places: &[(usize, usize)]) -> f64 {
    let origins = interpolate::origins(bins);
    let beyond = |(light, view): &&(usize, usize)| {
        origins[bins.grid().cell(*light, *view)] == Origin::Extrapolated as u8
    };
    places.iter().filter(beyond).count() as f64 / places.len() as f64
}

fn log_rms(row: &Row, places: &[(usize, usize)], values: &[[f64; 3]], floor: [f32; 3]) -> f64 {
    let mut sum = 0.0;
    for ((light, view), value) in places.iter().zip(values) {
        let at = |d: &usize| grid().direction(*d).to_vec3();
        let truth = row.truth.eval(at(light), at(view));
        for c in 0..3 {
            sum += (value[c].max(floor[c].into()) / truth[c])
                .natural_log()
                .powi(2);
        }
    }
    (sum / (3 * places.len()) as f64).sqrt()
}

/// The default fills the grid; every cell of it is checked. What no row may be is `unsound`.
fn judge_default(
    row: &Row,
    bins: &Bins,
    places: &[(usize, usize)],
    unsound: &mut Vec<String>,
) -> Option<Verdict> {
    let base = FillSettings {
        block_deg: 2.0 * GRID_STEP_DEG,
        neighbours: row.neighbours.unwrap_or(FillSettings::DEFAULT.neighbours),
        ..FillSettings::DEFAULT
    };
    let known = Data::new(bins);
    let settings = interpolate::select(&known, base).settings;
    let dense = interpolate::fill(&known, &settings, &silent).ok()?;
    let measured = |c: usize| {
        bins.bins()
            .iter()
            .map(move |b| b.median[c])
            .filter(|v| *v > 0.0)
    };
    let n = grid().n_directions();
    for (c, plane) in dense.planes().iter().enumerate() {
        let low = measured(c).fold(f32::INFINITY, f32::min) / BEYOND;
        let high = measured(c).fold(0.0, f32::max) * BEYOND;
        if let Some(bad) = plane.iter().find(|v| !(v.is_finite() && **v > 0.0)) {
            unsound.push(format!("{}: the default gives {bad}", row.case));
        }
        // Where the truth itself leaves the measured range, it widens it.
        let far = (0..n * n).find(|cell| {
            let value = plane[*cell];
            (value < low || value > high) && {
                let [light, view] = [cell / n, cell % n].map(|d| grid().direction(d).to_vec3());
                let truth = row.truth.eval(light, view)[c] as f32;
                value < truth / BEYOND || value > truth * BEYOND
            }
        });
        if let Some(cell) = far {
            unsound.push(format!(
                "{}: the default gives {}, out of {low} ..= {high} and beyond {BEYOND} times the truth",
                row.case, plane[cell]
            ));
        }
        let residual = (0..n * n).find(|cell| plane[*cell] != plane[cell % n * n + cell / n]);
        if let Some(cell) = residual {
            unsound.push(format!("{}: cell {cell} is not reciprocal", row.case));
        }
    }
    let values: Vec<[f64; 3]> = places
        .iter()
        .map(|(light, view)| dense.at(*light, *view).map(f64::from))
        .collect();
    let like = judge_cellwise(row, bins, places, LIKE_DEFAULT)?;
    Some(Verdict {
        log_rms: log_rms(row, places, &values, [0.0; 3]),
        failed: 0.0,
        negative: 0.0,
        condition: like.condition,
    })
}

fn judge_cellwise(
    row: &Row,
    bins: &Bins,
    places: &[(usize, usize)],
    name: &str,
) -> Option<Verdict> {
    let mut settings: BaselineSettings = name.parse().unwrap();
    // The nearest one is the nearest one.
    settings.neighbours = row.neighbours.unwrap_or(settings.neighbours);
    let predictor = Predictor::new(bins, &settings).ok()?;
    let at = |d: usize| grid().direction(d).to_vec3();
    let found: Vec<([f64; 3], usize, Option<f64>)> = places
        .par_iter()
        .map_init(Workspace::measuring_condition, |work, (light, view)| {
            let mut failed = 0;
            let mut condition: Option<f64> = None;
            let mut of = |i: Vec3, v: Vec3| {
                let value = predictor.at(i, v, work);
                if let Some(c) = work.system.condition() {
                    condition = Some(condition.map_or(c, |known| known.max(c)));
                }
                value.unwrap_or_else(|_| {
                    failed += 1;
                    predictor.nearest(i, v, work)
                })
            };
            let (a, b) = (of(at(*light), at(*view)), of(at(*view), at(*light)));
            ([0, 1, 2].map(|c| 0.5 * (a[c] + b[c])), failed, condition)
        })
        .collect();
    let values: Vec<[f64; 3]> = found.iter().map(|f| f.0).collect();
    let negative = values.iter().flatten().filter(|v| **v <= 0.0).count();
    Some(Verdict {
        log_rms: log_rms(row, places, &values, predictor.floor()),
        failed: found.iter().map(|f| f.1).sum::<usize>() as f64 / (2 * places.len()) as f64,
        negative: negative as f64 / (3 * places.len()) as f64,
        condition: found.iter().filter_map(|f| f.2).reduce(f64::max),
    })
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.log_rms < 5e-4 {
            f.write_str("0.000")?;
        } else {
            write!(f, "{:.3}", self.log_rms)?;
        }
        match self.condition {
            // Beyond the precision of the numbers it has no digits.
            Some(condition) if condition > 1e15 => f.write_str("; ∞")?,
            Some(condition) => write!(f, "; 1e{}", condition.decimal_log().round())?,
            None => {}
        }
        if self.failed > 0.0 {
            write!(f, "; fails {:.0} %", 100.0 * self.failed)?;
        }
        if self.negative > 0.0 {
            write!(f, "; ≤ 0 {:.0} %", 100.0 * self.negative)?;
        }
        Ok(())
    }
}

/// Whether two tables say the same but for the rounding of processors of different width: numbers
/// may differ by a tenth, powers of ten by one power, shares by three per cent of the values.
fn alike(written: &str, made: &str) -> Result<(), String> {
    let (a, b): (Vec<&str>, Vec<&str>) = (
        written.split_whitespace().collect(),
        made.split_whitespace().collect(),
    );
    for (a, b) in a.iter().zip(&b) {
        let number = |word: &str| word.trim_end_matches(';').parse::<f64>().ok();
        let same = match (number(a), number(b)) {
            (Some(x), Some(y)) if b.starts_with("1e") => (x / y).decimal_log().abs() < 1.5,
            (Some(x), Some(y)) if y.fract() == 0.0 && y > 0.0 => (x - y).abs() < 3.5,
            (Some(x), Some(y)) => (x - y).abs() <= 0.1 * y.abs() + 0.001,
            _ => a == b,
        };
        if !same {
            return Err(format!("'{a}' is '{b}'"));
        }
    }
    if a.len() == b.len() {
        Ok(())
    } else {
        Err(format!("{} words are {}", a.len(), b.len()))
    }
}

#[test]
fn tables_are_alike_within_rounding_only() {
    let table = "| a case | 0.03 | 0.012; 1e5 | 0.400; ∞; fails 50 % |";
    assert!(alike(table, table).is_ok());
    for (from, to, same) in [
        ("0.012", "0.0125", true),
        ("0.012", "0.020", false),
        ("1e5", "1e6", true),
        ("1e5", "1e8", false),
        ("50", "52", true),
        ("50", "60", false),
        ("fails 50 %", "", false),
        ("a case", "a row", false),
    ] {
        assert_eq!(
            alike(table, &table.replace(from, to)).is_ok(),
            same,
            "{from} {to}"
        );
    }
}

/// The plan's samples of a material, without noise.
fn plan(truth: &dyn Brdf) -> Vec<Sample> {
    let arms = directions(&RINGS);
    let offsets = [-0.24, 0.0, 0.24];
    let points = offsets.iter().flat_map(|x| offsets.map(|y| [*x, y]));
    let points: Vec<[f64; 2]> = points.collect();
    arms.iter()
        .flat_map(|light| arms.iter().map(move |view| (*light, *view)))
        .enumerate()
        .flat_map(|(frame, (light, view))| {
            points
                .iter()
                .map(move |point| {
                    let i = local_direction(light, 1.1, *point);
                    let v = local_direction(view, 1.8, *point);
                    (frame, i, v)
                })
                .collect::<Vec<_>>()
        })
        .map(|(frame, i, v)| {
            sample(
                truth,
                Direction::from_vec3(i),
                Direction::from_vec3(v),
                frame,
            )
        })
        .collect()
}

fn sample(truth: &dyn Brdf, i: Direction, v: Direction, frame: usize) -> Sample {
    Sample::new(i, v, truth.eval(i.to_vec3(), v.to_vec3()).map(|x| x as f32)).in_frame(frame as u32)
}

fn with_retro_hole(truth: &dyn Brdf) -> Vec<Sample> {
    let of = |theta: f32, phi: f32| Direction::from_deg(theta.into(), phi.into());
    let apart = |s: &Sample| {
        apart_deg(
            of(s.theta_i_deg, s.phi_i_deg),
            of(s.theta_v_deg, s.phi_v_deg),
        )
    };
    plan(truth).into_iter().filter(|s| apart(s) > 8.0).collect()
}

/// Samples on either side of the border between two bins' polar angles.
fn pairs_across_borders(truth: &dyn Brdf) -> Vec<Sample> {
    let mut samples = plan(truth);
    let border = |theta: f32| 6.0 * (theta / 6.0).floor() + 3.0;
    let pairs: Vec<Sample> = samples
        .iter_mut()
        .map(|s| {
            let theta = border(s.theta_i_deg);
            let at = |theta: f32| {
                let i = Direction::from_deg(theta.into(), s.phi_i_deg.into());
                let v = Direction::from_deg(s.theta_v_deg.into(), s.phi_v_deg.into());
                sample(truth, i, v, s.frame as usize)
            };
            let twin = at(theta + 1e-4);
            *s = at(theta - 1e-4);
            twin
        })
        .collect();
    samples.extend(pairs);
    samples
}

fn clustered(truth: &dyn Brdf) -> Vec<Sample> {
    let mut samples: Vec<Sample> = plan(truth).into_iter().step_by(5).collect();
    for k in 0..5000 {
        let off = |axis| 10.0 * uniform(axis, k) - 5.0;
        let i = Direction::from_deg(40.0 + off(1), 100.0 + off(2));
        let v = Direction::from_deg(30.0 + off(3), 250.0 + off(4));
        samples.push(sample(truth, i, v, 100_000));
    }
    samples
}

struct Constant;
impl Brdf for Constant {
    fn eval(&self, _: Vec3, _: Vec3) -> [f64; 3] {
        [0.3, 0.2, 0.1]
    }
}

/// From 1 at the half vector along the normal to a millionth at the horizon.
struct SixDecades;
impl Brdf for SixDecades {
    fn eval(&self, i: Vec3, v: Vec3) -> [f64; 3] {
        let h = normalize([i[0] + v[0], i[1] + v[1], i[2] + v[2]]);
        [10f64.power(-6.0 * (1.0 - h[2] * h[2])); 3]
    }
}

/// Ten times as bright where light and view coincide.
struct RetroReflector;
impl Brdf for RetroReflector {
    fn eval(&self, i: Vec3, v: Vec3) -> [f64; 3] {
        let apart = dot(i, v).min(1.0).arc_cosine() / 15f64.to_radians();
        [0.1 + 0.9 * (-apart * apart).exponential(); 3]
    }
}
