//! What a fill says of samples that are what they are taken for, and of others.
#![allow(clippy::unwrap_used, clippy::panic)]

use gonia_brdf::Elementary;
use gonia_brdf::hemisphere::{paper_lights, paper_views};
use gonia_brdf::model::{Brdf, Material};
use gonia_brdf::random::Random;
use gonia_brdf::{Direction, Grid, Sample, SymmetryKind};
use gonia_pipeline::{Error, FillOptions, fill, silent};
use gonia_rig::Scale;

/// Pairs of directions as people measure them.
#[derive(Clone, Copy, Debug)]
enum Layout {
    /// All over both hemispheres.
    Scattered(usize),
    /// The paper's plan, one sample a pose.
    Plan,
    /// One azimuth of light.
    OneAzimuth,
}

fn places(layout: Layout) -> Vec<[Direction; 2]> {
    let mut random = Random::new(11);
    let lowest = 85f64.to_radians().cosine();
    let mut theta = || Direction {
        theta: random.between(lowest, 1.0).arc_cosine(),
        phi: random.between(0.0, std::f64::consts::TAU),
    };
    match layout {
        Layout::Scattered(n) => (0..n).map(|_| [theta(), theta()]).collect(),
        Layout::OneAzimuth => (0..1500)
            .map(|k| {
                let light = Direction::from_deg(f64::from(k % 16) * 5.0, 180.0);
                [light, theta()]
            })
            .collect(),
        Layout::Plan => paper_lights()
            .into_iter()
            .flat_map(|light| paper_views().into_iter().map(move |view| [light, view]))
            .collect(),
    }
}

/// Samples of a model with some relative noise.
fn samples(model: &dyn Brdf, layout: Layout, noise: f64) -> Vec<Sample> {
    let mut random = Random::new(3);
    places(layout)
        .into_iter()
        .map(|[light, view]| {
            let value = model.eval(light.to_vec3(), view.to_vec3());
            let rgb = value.map(|v| (v * (1.0 + noise * random.normal())) as f32);
            Sample::new(light, view, rgb)
        })
        .collect()
}

/// All that is said of samples.
fn all_said(samples: &[Sample]) -> Result<Vec<String>, Error> {
    let options = FillOptions {
        method: "nearest".parse().unwrap(),
        ..FillOptions::with_step_deg(30.0)
    };
    let filled = fill(samples.to_vec(), Scale::Relative, &options, &silent)?;
    Ok(filled
        .account
        .remarks
        .iter()
        .map(ToString::to_string)
        .collect())
}

/// The same but for what their layout leaves to guess.
fn said(samples: &[Sample]) -> Vec<String> {
    let mut said = all_said(samples).unwrap();
    said.retain(|said| !said.contains("extrapolated"));
    said
}

/// A mirror lobe and a retro-reflection on a dark base.
struct Retro;

impl Brdf for Retro {
    fn eval(&self, l: [f64; 3], v: [f64; 3]) -> [f64; 3] {
        let along = (l[0] * v[0] + l[1] * v[1] + l[2] * v[2]).max(0.0);
        let mirror = (l[2] * v[2] - l[0] * v[0] - l[1] * v[1]).max(0.0);
        [0.02 + 3.0 * along.powi(300) + 0.5 * mirror.powi(60); 3]
    }
}

const LAYOUTS: [Layout; 4] = [
    Layout::Scattered(400),
    Layout::Scattered(5000),
    Layout::Plan,
    Layout::OneAzimuth,
];

#[test]
fn sound_samples_draw_no_remark() {
    for name in Material::NAMES {
        let material = Material::named(name).unwrap();
        for layout in LAYOUTS {
            for noise in [0.02, 0.2] {
                let said = said(&samples(material.brdf.as_ref(), layout, noise));
                assert!(said.is_empty(), "{name}, {layout:?}, {noise}: {said:?}");
            }
        }
    }
    for layout in LAYOUTS {
        let said = said(&samples(&Retro, layout, 0.02));
        assert!(said.is_empty(), "retro, {layout:?}: {said:?}");
    }
}

#[test]
fn a_peak_that_is_narrower_than_pairs_are_apart_is_no_cosine() {
    // Across a retro-reflection of a third of a degree, in steps of a tenth.
    let light = Direction::from_deg(30.0, 0.0);
    let across = (100..500).map(|k| 0.1 * f64::from(k)).map(|theta| {
        let value = 0.1 + 2.0 * (-0.5 * ((theta - 30.27) / 0.34).powi(2)).exponential();
        Sample::new(light, Direction::from_deg(theta, 0.0), [value as f32; 3])
    });
    let options = FillOptions::with_step_deg(6.0);
    let filled = fill(
        across.collect::<Vec<_>>(),
        Scale::Relative,
        &options,
        &silent,
    )
    .unwrap();
    let said = filled.account.remarks.iter().map(ToString::to_string);
    let of_a_cosine: Vec<String> = said.filter(|s| s.contains("cosines")).collect();
    assert!(of_a_cosine.is_empty(), "{of_a_cosine:?}");
}

#[test]
fn a_cosine_in_the_values_is_seen_in_reciprocal_pairs_and_a_symmetric_one_is_not() {
    let mut missed = Vec::new();
    for name in Material::NAMES {
        let material = Material::named(name).unwrap();
        for layout in LAYOUTS {
            let good = samples(material.brdf.as_ref(), layout, 0.02);
            for (view, light, word) in [(1, 0, "f cos(theta_v)"), (0, 1, "f cos(theta_i)")] {
                let said = said(&times_cosines(&good, view, light));
                if said.is_empty() {
                    missed.push(format!("{name}, {layout:?}, {word}"));
                } else {
                    // Never the other one.
                    assert!(
                        said.len() == 1 && said[0].contains(word),
                        "{name}: {said:?}"
                    );
                }
            }
            assert!(said(&times_cosines(&good, 1, 1)).is_empty(), "{name}");
        }
    }
    // Few samples of narrow highlights, and anisotropic materials in one azimuth of light, have too few reciprocal
    // pairs.
    println!("{missed:#?}");
    assert!(missed.len() <= 6, "{missed:#?}");
}

fn times_cosines(samples: &[Sample], view: i32, light: i32) -> Vec<Sample> {
    samples
        .iter()
        .map(|s| {
            let cos = |deg: f32, power| deg.to_radians().cosine().powi(power);
            let factor = cos(s.theta_v_deg, view) * cos(s.theta_i_deg, light);
            Sample {
                rgb: s.rgb.map(|v| v * factor),
                ..*s
            }
        })
        .collect()
}

#[test]
fn radians_are_refused_and_azimuths_in_radians_remarked_on() {
    let material = Material::named("fabric").unwrap();
    for layout in LAYOUTS {
        let good = samples(material.brdf.as_ref(), layout, 0.0);
        let in_radians = |s: &Sample, polar: bool| Sample {
            theta_i_deg: if polar {
                s.theta_i_deg.to_radians()
            } else {
                s.theta_i_deg
            },
            theta_v_deg: if polar {
                s.theta_v_deg.to_radians()
            } else {
                s.theta_v_deg
            },
            phi_i_deg: s.phi_i_deg.to_radians(),
            phi_v_deg: s.phi_v_deg.to_radians(),
            ..*s
        };
        let all: Vec<Sample> = good.iter().map(|s| in_radians(s, true)).collect();
        let refusal = all_said(&all).unwrap_err().to_string();
        assert!(
            refusal.contains("they are radians") && refusal.contains("180/pi"),
            "{refusal}"
        );
        let azimuths: Vec<Sample> = good.iter().map(|s| in_radians(s, false)).collect();
        let said = said(&azimuths)[0].clone();
        assert!(said.contains("look like radians"), "{said}");
    }
}

#[test]
fn angles_from_the_surface_are_seen_where_the_material_shows_them() {
    let mut seen = Vec::new();
    for name in Material::NAMES {
        let material = Material::named(name).unwrap();
        for layout in LAYOUTS {
            let mut samples = samples(material.brdf.as_ref(), layout, 0.02);
            for s in &mut samples {
                s.theta_i_deg = 90.0 - s.theta_i_deg;
                s.theta_v_deg = 90.0 - s.theta_v_deg;
            }
            let said = said(&samples);
            if said.iter().any(|s| s.contains("from the surface")) {
                seen.push((name, format!("{layout:?}")));
            }
            // Of a Lambertian surface nothing can be seen.
            assert!(name != "lambert" || said.is_empty(), "{said:?}");
        }
    }
    println!("{seen:?}");
    assert!(seen.iter().any(|(name, _)| *name == "white"), "{seen:?}");
}

#[test]
fn values_that_are_mostly_below_zero_are_refused_and_some_are_counted() {
    let material = Material::named("lambert").unwrap();
    let mut samples = samples(material.brdf.as_ref(), Layout::Scattered(400), 0.0);
    for s in samples.iter_mut().take(40) {
        s.rgb = s.rgb.map(|v| -v);
    }
    let some = said(&samples);
    assert!(
        some[0].contains("40 of 400 samples are not above zero"),
        "{some:?}"
    );
    for s in samples.iter_mut().skip(40) {
        s.rgb = s.rgb.map(|v| -v);
    }
    samples[0].rgb = [0.1; 3];
    let said = all_said(&samples).unwrap_err().to_string();
    assert!(
        said.contains("399 of 400 samples are not above zero"),
        "{said}"
    );
}

#[test]
fn slices_of_the_four_angles_are_named() {
    let sample = |theta_i: f64, phi_i: f64, theta_v: f64, phi_v: f64| {
        let (light, view) = (
            Direction::from_deg(theta_i, phi_i),
            Direction::from_deg(theta_v, phi_v),
        );
        Sample::new(light, view, [0.1; 3])
    };
    let angles = || (0..60).map(f64::from);
    let cases: [(Vec<Sample>, Option<&str>); 6] = [
        (
            angles().map(|k| sample(30.0, 50.0, k, 6.0 * k)).collect(),
            Some("one direction of light"),
        ),
        (
            angles()
                .map(|k| sample(k, 6.0 * k, 0.2, 90.0 * k))
                .collect(),
            Some("one direction of view"),
        ),
        (
            angles()
                .map(|k| {
                    sample(
                        7.0 * k % 80.0,
                        30.0,
                        11.0 * k % 80.0,
                        30.0 + 180.0 * (k % 2.0),
                    )
                })
                .collect(),
            Some("in the plane of incidence"),
        ),
        (
            angles()
                .map(|k| sample(7.0 * k % 80.0, 30.0, 11.0 * k % 80.0, 37.0 * k))
                .collect(),
            Some("one azimuth of light, 30 degrees"),
        ),
        (
            angles()
                .map(|k| sample(7.0 * k % 80.0, 37.0 * k, 11.0 * k % 80.0, 0.0))
                .collect(),
            Some("one azimuth of view, 0 degrees"),
        ),
        (
            angles()
                .map(|k| sample(7.0 * k % 80.0, 37.0 * k, 11.0 * k % 80.0, 59.0 * k))
                .collect(),
            None,
        ),
    ];
    for (samples, words) in cases {
        let said = all_said(&samples)
            .unwrap()
            .into_iter()
            .find(|said| said.contains("extrapolated"));
        match (&said, words) {
            (Some(said), Some(words)) => assert!(
                said.contains(words) && said.contains("% of the cells are extrapolated"),
                "{said}"
            ),
            (None, None) => (),
            _ => panic!("{said:?} for {words:?}"),
        }
    }
}

/// A highlight over a Lambertian base; the lobe's height goes with twice the half vector's azimuth by a share.
fn with_highlight(layout: Layout, share: f64) -> Vec<Sample> {
    let value = |light: Direction, view: Direction| {
        let (i, v) = (light.to_vec3(), view.to_vec3());
        let h = gonia_brdf::direction::normalize([0, 1, 2].map(|k| i[k] + v[k]));
        let wave = 1.0 + share * (h[0] * h[0] - h[1] * h[1]) / (h[0] * h[0] + h[1] * h[1]);
        (0.1 + 0.3 * h[2].power(20.0)) * wave
    };
    places(layout)
        .into_iter()
        .map(|[light, view]| Sample::new(light, view, [value(light, view) as f32; 3]))
        .collect()
}

#[test]
fn one_azimuth_is_assumed_to_be_isotropic_and_the_result_says_so() {
    let samples = with_highlight(Layout::OneAzimuth, 0.0);
    let options = FillOptions {
        with_errors: true,
        ..FillOptions::with_step_deg(30.0)
    };
    let filled = fill(samples.clone(), Scale::Relative, &options, &silent).unwrap();
    let said: Vec<String> = filled
        .account
        .remarks
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(
        said.iter().any(|s| s.contains("assumed to be isotropic")),
        "{said:?}"
    );
    let symmetry = &filled.dense.provenance["symmetry"];
    assert!(
        symmetry.contains("isotropic") && symmetry.contains("assumed"),
        "{symmetry}"
    );
    assert!(filled.errors.is_some());
    // What was measured at 180 degrees holds at 60.
    let at = |phi: f64| {
        (
            Direction::from_deg(30.0, phi),
            Direction::from_deg(60.0, phi + 150.0),
        )
    };
    let lookup = |(light, view)| f64::from(filled.dense.lookup(light, view)[1]);
    assert_eq!(lookup(at(180.0)), lookup(at(60.0)));
    let n = Grid::with_step_deg(30.0).unwrap().n_cells() as u64;
    assert!(filled.account.origins.extrapolated < n / 2);

    let none = FillOptions {
        symmetry: Some(SymmetryKind::None),
        ..FillOptions::with_step_deg(30.0)
    };
    let filled = fill(samples, Scale::Relative, &none, &silent).unwrap();
    let said: Vec<String> = filled
        .account
        .remarks
        .iter()
        .map(ToString::to_string)
        .collect();
    assert!(
        said.iter().any(|s| s.contains("was not measured")),
        "{said:?}"
    );
    assert!(filled.dense.provenance["symmetry"].starts_with("none"));
}

#[test]
fn a_symmetry_that_samples_contradict_is_remarked_on_and_one_that_they_show_is_not() {
    for (share, contradicted) in [(0.0, false), (0.1, true)] {
        let samples = with_highlight(Layout::Scattered(600), share);
        let (fit, remarks) =
            gonia_pipeline::FitOfSamples::new(samples, Some(SymmetryKind::Isotropic)).unwrap();
        assert!(fit.choice().settings.symmetry.is_isotropic());
        let said: Vec<String> = remarks.iter().map(ToString::to_string).collect();
        let found = said.iter().any(|s| s.contains("contradict the symmetry"));
        assert_eq!(found, contradicted, "{share}: {said:?}");
    }
}

#[test]
fn a_stated_plane_that_samples_contradict_is_remarked_on_with_by_how_much() {
    // Wide along x: its planes lie at azimuths 0 and 90.
    let material = |light: Direction, view: Direction| {
        let [i, v] = [light, view].map(Direction::to_vec3);
        let sum = [0, 1, 2].map(|k| i[k] + v[k]);
        let slope2 = (sum[0] / 1.5).powi(2) + (1.5 * sum[1]).powi(2);
        0.05 + 0.2 * (-slope2 / (0.3 * sum[2] * sum[2])).exponential()
    };
    let mut random = Random::new(5);
    let mut direction =
        || Direction::from_deg(random.between(0.0, 75.0), random.between(0.0, 360.0));
    let scattered: Vec<Sample> = (0..900)
        .map(|_| {
            let (light, view) = (direction(), direction());
            Sample::new(light, view, [material(light, view) as f32; 3])
        })
        .collect();
    // In frames of many samples, they are not few and blocks fill them.
    let framed = scattered.iter().zip(0..).map(|(s, k)| s.in_frame(k / 20));
    for samples in [scattered.clone(), framed.collect()] {
        for (plane_deg, contradicted) in [(90.0, false), (40.0, true)] {
            let options = FillOptions {
                symmetry: Some(SymmetryKind::Bilateral),
                plane_deg: Some(plane_deg),
                ..FillOptions::with_step_deg(30.0)
            };
            let filled = fill(samples.clone(), Scale::Absolute, &options, &silent).unwrap();
            let said: Vec<String> = filled
                .account
                .remarks
                .iter()
                .map(ToString::to_string)
                .collect();
            let found = said.iter().find(|s| s.contains("contradict the symmetry"));
            assert_eq!(found.is_some(), contradicted, "{plane_deg}: {said:?}");
            assert!(found.is_none_or(|s| s.contains("azimuth 40.0") && s.contains(" % off")));
            let symmetry = &filled.dense.provenance["symmetry"];
            assert!(
                symmetry.starts_with("bilateral about azimuth"),
                "{symmetry}"
            );
        }
    }
}
