//! Channels of every number, in memory and by rows.

use super::*;
use crate::export::{ExportSource, export};
use crate::progress::silent;
use crate::provenance::Provenance;
use gonia_brdf::direction::local_direction;
use gonia_brdf::hemisphere::directions;
use gonia_brdf::model::Ggx;
use gonia_brdf::random::Random;
use gonia_brdf::{Brdf, Direction, Elementary, Sample, SymmetryKind};
use gonia_formats::dense::read_dense_channels;
use gonia_formats::export::export_format;
use gonia_rig::{ChannelSamples, Channels};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Channel c of a broad lobe is c + 1 times its value, to a power that falls with c.
fn truth(light: Direction, view: Direction, channel: usize, of: usize) -> f32 {
    let (i, v) = (light.to_vec3(), view.to_vec3());
    let along = 0.6 + 0.2 * (i[0] + v[0]) + 0.1 * (i[2] * v[2]);
    let scale = (channel + 1) as f64;
    (scale * along.power(1.0 + channel as f64 / of as f64)) as f32
}

fn samples(channels: Channels) -> ChannelSamples {
    let (n, mut random) = (channels.count(), Random::new(3));
    let mut samples = ChannelSamples {
        channels,
        ..ChannelSamples::default()
    };
    for frame in 0..6000 {
        let mut direction =
            || Direction::from_deg(random.between(0.0, 80.0), random.between(0.0, 360.0));
        let (light, view) = (direction(), direction());
        samples
            .places
            .push(Sample::new(light, view, []).in_frame(frame / 20));
        let values = (0..n).map(|c| truth(light, view, c, n));
        samples.values.extend(values);
    }
    samples
}

/// Blocks, whatever the samples are.
fn options(with_errors: bool) -> FillOptions {
    FillOptions {
        tolerance: Some(0.7),
        symmetry: Some(SymmetryKind::None),
        with_errors,
        ..FillOptions::with_step_deg(15.0)
    }
}

fn bands(n: usize) -> Channels {
    Channels::Bands((0..n).map(|k| 400.0 + k as f64).collect())
}

#[test]
fn channels_of_every_number_have_their_own_values_and_error_bars() {
    for channels in [Channels::Single, bands(2), bands(5), bands(31), bands(40)] {
        let n = channels.count();
        let filled = fill(samples(channels), Scale::Absolute, &options(true), &silent).unwrap();
        let (grid, errors) = (filled.dense.grid, filled.errors.unwrap());
        for c in 0..n {
            let (plane, error) = (&filled.dense.planes[c], &errors.standard_error[c]);
            let (mut sum, mut count) = (0.0, 0.0);
            for light in (0..grid.n_directions()).step_by(7) {
                for view in (0..grid.n_directions()).step_by(5) {
                    let cell = grid.cell(light, view);
                    let truth = truth(grid.direction(light), grid.direction(view), c, n);
                    sum += f64::from(plane[cell] / truth - 1.0).powi(2);
                    count += 1.0;
                    assert!(error[cell] > 0.0 && error[cell] < truth);
                }
            }
            let rms = (sum / count).sqrt();
            assert!(rms < 0.05, "{n} channels, {c}: {rms}");
        }
    }
}

/// What a file by rows and a fill in memory say must be the same.
fn assert_rows_are_those_in_memory(of: impl Into<SampleValues>, options: &FillOptions) {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("d.exr");
    let (of, scale) = (of.into(), Scale::Relative);
    let whole = fill(of.clone(), scale, options, &silent).unwrap();
    let facts = Provenance::from([("rig".to_owned(), "a test".to_owned())]);
    let rows = fill_to_file(of, scale, options, &path, &facts, &silent).unwrap();
    let read = read_dense_channels(&path).unwrap();
    assert_eq!(read.channels, whole.dense.channels);
    assert!(read.planes == whole.dense.planes, "{}", read.channels);
    assert_eq!(read.provenance["rig"], "a test");
    assert_eq!(format!("{rows:?}"), format!("{:?}", whole.account));
}

/// Two processes, the second of which finds what the first has left, must write what one process exports.
fn assert_parts_are_the_whole(of: impl Into<SampleValues>, options: &FillOptions) {
    let dir = tempfile::tempdir().unwrap();
    let [whole, parts, folder] = ["whole.zarr", "parts.zarr", "parts"].map(|n| dir.path().join(n));
    let (of, scale) = (of.into(), Scale::Relative);
    let facts = Provenance::new();
    let filled = fill(of.clone(), scale, options, &silent).unwrap();
    let source = ExportSource {
        dense: filled.dense,
        path: Path::new("the fill"),
        errors: None,
        scale_by: None,
        allow_coarse: false,
    };
    let zarr = export_format(&whole, None).unwrap();
    export(source, &whole, zarr, 0).unwrap();
    let begin = |of: SampleValues| FillInParts::begin(of, scale, options, &folder, &facts, &silent);
    let Begun::Parts { fill: first, .. } = begin(of.clone()).unwrap() else {
        panic!("blocks are wanted");
    };
    let (groups, patches, bands) = (first.groups(), first.patches(), first.bands());
    first.solve(0, 0..patches / 2, &silent).unwrap();
    assert!(first.write(0, 0, &silent).is_err(), "a patch is missing");
    let error = first.finish(&parts).unwrap_err().to_string();
    assert!(error.contains("is not written yet"), "{error}");
    // It has died; another one takes up the folder.
    let Begun::Parts { fill, remarks } = begin(of.clone()).unwrap() else {
        panic!("blocks are wanted");
    };
    assert!(remarks.is_empty());
    for group in 0..groups {
        fill.solve(group, 0..patches, &silent).unwrap();
        for band in (0..bands).rev() {
            fill.write(group, band, &silent).unwrap();
        }
    }
    for wrong in [
        fill.solve(groups, 0..1, &silent),
        fill.solve(0, 0..patches + 1, &silent),
        fill.write(0, bands, &silent),
    ] {
        assert!(wrong.unwrap_err().to_string().contains("there are"));
    }
    let error = begin(of.of_channels([0; 3]).into())
        .unwrap_err()
        .to_string();
    assert!(error.contains("another fill"), "{error}");
    fill.finish(&parts).unwrap();
    assert!(!folder.exists());
    assert_eq!(files(&parts), files(&whole));
}

fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in std::fs::read_dir(next).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).unwrap().to_owned();
                files.insert(name, std::fs::read(path).unwrap());
            }
        }
    }
    files
}

#[test]
fn parts_of_several_processes_are_a_fill_in_memory_byte_for_byte() {
    for channels in [Channels::Single, bands(5), bands(40)] {
        assert_parts_are_the_whole(samples(channels), &options(false));
    }
    let colours = samples(bands(3)).of_channels([0, 1, 2]);
    assert_parts_are_the_whole(colours, &options(false));
}

#[test]
fn a_fit_of_few_samples_is_no_work_to_share_and_a_failed_beginning_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("parts");
    let mut few: Vec<Sample> = samples(bands(3)).of_channels([0, 1, 2]);
    few.truncate(200);
    // Places of one frame each: samples of frames are images of many.
    (0..).zip(&mut few).for_each(|(k, sample)| sample.frame = k);
    let begin = |samples: Vec<Sample>, options: &FillOptions| {
        let facts = Provenance::new();
        FillInParts::begin(samples, Scale::Relative, options, &folder, &facts, &silent)
    };
    let begun = begin(few.clone(), &FillOptions::with_step_deg(15.0)).unwrap();
    assert!(matches!(begun, Begun::OneFit));
    assert!(begin(few[..5].to_vec(), &options(false)).is_err());
    let error = begin(few, &options(true)).unwrap_err().to_string();
    assert!(error.contains("no error bars"), "{error}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    // What is something else's is not touched.
    std::fs::create_dir(&folder).unwrap();
    let many = samples(bands(3)).of_channels([0, 1, 2]);
    let error = begin(many, &options(false)).unwrap_err().to_string();
    assert!(error.contains("holds no fill that could go on"), "{error}");
    assert!(folder.is_dir());
}

#[test]
fn rows_of_any_number_of_channels_are_those_of_a_fill_in_memory() {
    for channels in [Channels::Single, bands(5), bands(40)] {
        assert_rows_are_those_in_memory(samples(channels), &options(false));
    }
    let colours = samples(bands(3)).of_channels([0, 1, 2]);
    assert_rows_are_those_in_memory(colours, &options(false));
}

#[test]
fn a_fit_of_few_samples_is_what_rows_are_made_of_too() {
    let few = few(bands(4), 300);
    let isotropic = FillOptions {
        symmetry: Some(SymmetryKind::Isotropic),
        ..FillOptions::with_step_deg(15.0)
    };
    assert_rows_are_those_in_memory(few, &isotropic);
}

/// The first of the samples, of no frame.
fn few(channels: Channels, n: usize) -> ChannelSamples {
    let mut few = samples(channels);
    few.places.truncate(n);
    few.values.truncate(n * few.channels.count());
    for place in &mut few.places {
        place.frame = Sample::NO_FRAME;
    }
    few
}

#[test]
fn what_rows_cannot_hold_is_refused_and_leaves_no_file() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("d.exr");
    let refused = |of: ChannelSamples, options: &FillOptions| {
        let (scale, facts) = (Scale::Relative, Provenance::new());
        let made = fill_to_file(of, scale, options, &path, &facts, &silent);
        made.unwrap_err().to_string()
    };
    let said = refused(samples(bands(2)), &options(true));
    assert!(said.starts_with("--error with 2 channels"), "{said}");
    let said = refused(few(bands(5), 2), &options(false));
    assert!(said.contains("only 2 bins"), "{said}");
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

#[test]
fn samples_that_cannot_stand_count_as_outside_in_every_channel() {
    let mut odd = samples(bands(2));
    odd.values[7] = f32::NAN;
    let n = odd.places.len();
    let filled = fill(odd, Scale::Relative, &options(false), &silent).unwrap();
    let counts = filled.account.counts;
    assert_eq!((counts.binned + counts.outside, counts.outside), (n, 1));
}

#[test]
fn about_a_plane_that_is_known_one_side_is_enough() {
    let mut one_side = samples(Channels::Single);
    let both = one_side.clone();
    let is_kept: Vec<bool> = both.places.iter().map(|s| s.phi_i_deg < 180.0).collect();
    let mut kept = is_kept.iter();
    one_side.places.retain(|_| kept.next() == Some(&true));
    let mut kept = is_kept.iter();
    one_side.values.retain(|_| kept.next() == Some(&true));
    // The largest error under lights of the other side.
    let error = |plane_deg: Option<f64>| {
        let options = FillOptions {
            symmetry: Some(SymmetryKind::Bilateral),
            plane_deg,
            ..options(false)
        };
        let filled = fill(one_side.clone(), Scale::Absolute, &options, &silent).unwrap();
        let grid = filled.dense.grid;
        let off = (0..grid.n_cells()).filter_map(|cell| {
            let (light, view) = grid.light_and_view(cell);
            let (light, view) = (grid.direction(light), grid.direction(view));
            let is_there = light.phi_deg() > 195.0
                && (15.0..=60.0).contains(&light.theta_deg())
                && view.theta_deg() <= 60.0;
            let found = filled.dense.planes[0][cell] / truth(light, view, 0, 1);
            is_there.then(|| f64::from(found).natural_log().abs())
        });
        off.fold(0.0, f64::max)
    };
    let (right, wrong) = (error(Some(0.0)), error(Some(50.0)));
    assert!(right < 0.05 && wrong > 0.15, "{right} {wrong}");
    for (symmetry, plane) in [
        (SymmetryKind::HalfTurn, 0.0),
        (SymmetryKind::Bilateral, 400.0),
        (SymmetryKind::Bilateral, f64::NAN),
    ] {
        let options = FillOptions {
            symmetry: Some(symmetry),
            plane_deg: Some(plane),
            ..options(false)
        };
        let said = options.check().unwrap_err().to_string();
        assert!(said.starts_with("--plane"), "{said}");
    }
}

#[test]
fn a_fit_about_a_stated_plane_is_made_again_about_it() {
    let dir = tempfile::tempdir().unwrap();
    let [csv, dense] = ["s.csv", "d.exr"].map(|name| dir.path().join(name));
    // Lights and views on one side of the plane, which they do not show.
    let mut random = Random::new(5);
    let mut direction =
        || Direction::from_deg(random.between(0.0, 80.0), random.between(20.0, 200.0));
    let one_side: Vec<Sample> = (0..120)
        .map(|_| {
            let (light, view) = (direction(), direction());
            let along = truth(light, view, 0, 1);
            Sample::new(light, view, [along; 3])
        })
        .collect();
    gonia_formats::samples::write_samples(&csv, &one_side).unwrap();
    let options = FillOptions {
        symmetry: Some(SymmetryKind::Bilateral),
        plane_deg: Some(20.0),
        ..FillOptions::with_step_deg(15.0)
    };
    let facts = gonia_formats::fit_source::files_of_samples(&dense, std::slice::from_ref(&csv));
    let (scale, facts) = (Scale::Relative, facts.unwrap());
    let channels = gonia_formats::samples::read_channels(&csv).unwrap().values;
    fill_to_file(channels, scale, &options, &dense, &facts, &silent).unwrap();
    let mut lookup = gonia_formats::dense::DenseLookup::open(&dense).unwrap();
    let Behind::Fit { fit, .. } = Behind::of(&dense, &mut lookup).unwrap() else {
        panic!("the grid is evaluated");
    };
    let plane = fit.choice().settings.symmetry.plane();
    assert_eq!(plane.map(gonia_brdf::MirrorPlane::azimuth_deg), Some(20.0));
}

/// Frames of 49 points of an isotropic gloss, with lights at some azimuths.
fn frames_of_gloss(
    gloss: &Ggx,
    lights: &[(f64, usize)],
    lights_at_deg: impl Fn(f64) -> f64,
) -> Vec<Sample> {
    let (lights, views) = (
        directions(lights),
        directions(&[(0.0, 1), (25.0, 6), (50.0, 12), (72.0, 16)]),
    );
    let mut samples = Vec::new();
    for (k, light) in lights.iter().enumerate() {
        let light = Direction::from_deg(light.theta_deg(), lights_at_deg(light.phi_deg()));
        for (m, view) in views.iter().enumerate() {
            for (x, y) in (-3..=3).flat_map(|x| (-3..=3).map(move |y| (f64::from(x), f64::from(y))))
            {
                let point = [0.07 * x, 0.07 * y];
                let (l, v) = (
                    local_direction(light, 1.1, point),
                    local_direction(*view, 1.8, point),
                );
                let rgb = gloss.eval(l, v).map(|value| value as f32);
                let (l, v) = (Direction::from_vec3(l), Direction::from_vec3(v));
                samples.push(Sample::new(l, v, rgb).in_frame((k * views.len() + m) as u32));
            }
        }
    }
    samples
}

#[test]
fn an_isotropic_material_seen_from_all_around_is_the_mean_over_turns_and_nearer_than_without() {
    let gloss = Ggx {
        diffuse: [0.1, 0.2, 0.3],
        specular: [1.0; 3],
        f0: 0.04,
        alpha_x: 0.25,
        alpha_y: 0.25,
        azimuth_deg: 0.0,
    };
    let rings = [(0.0, 1), (25.0, 6), (50.0, 12), (72.0, 16), (85.0, 16)];
    let all_around = frames_of_gloss(&gloss, &rings, |phi| phi);
    let error_with = |samples: &[Sample], symmetry| {
        let options = FillOptions {
            symmetry: Some(symmetry),
            ..FillOptions::with_step_deg(6.0)
        };
        let filled = fill(samples.to_vec(), Scale::Absolute, &options, &silent).unwrap();
        let (grid, plane) = (filled.dense.grid, &filled.dense.planes[1]);
        let (mut sum, mut count) = (0.0, 0.0);
        for light in (0..grid.n_directions()).step_by(7) {
            for view in (0..grid.n_directions()).step_by(5) {
                let (i, v) = (grid.direction(light), grid.direction(view));
                if i.theta_deg().max(v.theta_deg()) < 75.0 {
                    let truth = gloss.eval(i.to_vec3(), v.to_vec3())[1];
                    let off = (f64::from(plane[grid.cell(light, view)]) / truth).natural_log();
                    sum += off * off;
                    count += 1.0;
                }
            }
        }
        ((sum / count).sqrt(), filled)
    };
    let (none, _) = error_with(&all_around, SymmetryKind::None);
    let (isotropic, filled) = error_with(&all_around, SymmetryKind::Isotropic);
    assert!(
        isotropic < none,
        "{isotropic} with, {none} without: {}",
        filled.account.settings
    );
    assert!(
        filled.account.settings.ends_with("mean over turns"),
        "{}",
        filled.account.settings
    );
    assert!(filled.account.symmetry.starts_with("isotropic"));
    let (grid, plane) = (filled.dense.grid, &filled.dense.planes[1]);
    let n_phi = grid.n_phi();
    let at = |light: usize, view: usize| {
        plane[grid.cell(5 * n_phi + light % n_phi, 7 * n_phi + view % n_phi)]
    };
    for turn in 1..n_phi {
        assert_eq!(at(0, 9), at(turn, 9 + turn));
        assert_eq!(at(0, 9), at(turn, turn + n_phi - 9));
    }
    // Of lights at one azimuth the frames themselves say nothing of the others.
    let (_, filled) = error_with(
        &frames_of_gloss(&gloss, &rings, |_| 40.0),
        SymmetryKind::Isotropic,
    );
    assert!(!filled.account.settings.contains("turns"));
}

#[test]
fn the_uncertainty_of_a_fit_of_samples_is_that_of_the_side_on_which_they_lie() {
    let mut random = Random::new(5);
    // Light from near the horizon, views near the normal.
    let samples: Vec<Sample> = (0..300)
        .map(|_| {
            let light = Direction::from_deg(random.between(55.0, 65.0), random.between(0.0, 360.0));
            let view = Direction::from_deg(random.between(5.0, 20.0), random.between(0.0, 360.0));
            let along = light.to_vec3()[0] + view.to_vec3()[0];
            Sample::new(light, view, [(0.3 + 0.05 * along) as f32; 3])
        })
        .collect();
    let (fit, _) = FitOfSamples::new(samples, Some(SymmetryKind::None)).unwrap();
    let (light, view) = (
        Direction::from_deg(60.0, 10.0),
        Direction::from_deg(12.0, 200.0),
    );
    let pairs = [(light, view), (view, light)];
    let tilt = crate::budget::fixture::uncertain_of(&[(gonia_rig::Input::ReferenceTilt, 1.0)]);
    let squares = |budget| {
        let found = fit.with_uncertainty(&pairs, budget);
        [0, 1].map(|k| {
            let [value, u] = found[k][0];
            f64::from(u / value).powi(2)
        })
    };
    let (noise, with) = (squares(None), squares(Some(&tilt)));
    // One degree about either axis, times tan 60°, at both places: the second one's value is of the same samples.
    let expected = 1f64.to_radians() * 60f64.to_radians().tangent();
    for k in 0..2 {
        let by_tilt = (with[k] - noise[k]).sqrt();
        assert!(
            (by_tilt / expected - 1.0).abs() < 0.05,
            "{by_tilt} {expected}"
        );
    }
}
