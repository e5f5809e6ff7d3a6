//! The whole chain from frames to samples against the simulator's truth.
#![allow(clippy::unwrap_used, clippy::panic)]

use gonia_brdf::Elementary;
use gonia_brdf::direction::angle_between;
use gonia_brdf::model::Kurt;
use gonia_brdf::{Brdf, Direction, Pose, Sample};
use gonia_formats::FileError;
use gonia_pipeline::process::*;
use gonia_rig::{Frame, FrameRow, Reference, Reflectance, Rig, Role};
use gonia_sim::scene::{Beam, Scene, SceneGeometry};
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

/// A source that renders its frames, at shaft angles a little off the reading.
struct Rendered {
    scene: Scene,
    rows: Vec<FrameRow>,
    error_deg: f64,
}

impl Rendered {
    fn new(scene: Scene) -> Self {
        Self {
            scene,
            rows: Vec::new(),
            error_deg: 0.01,
        }
    }

    fn add(&mut self, role: Role, angles: [f64; 4]) {
        let frame = self.rows.len() as u32;
        self.rows.push(FrameRow {
            frame,
            role,
            pose: Pose::from_deg(angles),
            file: format!("frames/{frame:06}.exr"),
        });
    }

    fn run(&self) -> Result<Processed, ProcessError> {
        process(
            &self.scene.geometry.to_rig(),
            self,
            &Masks::default(),
            &|_, _| ControlFlow::Continue(()),
        )
    }
}

impl FrameSource for Rendered {
    fn rows(&self) -> &[FrameRow] {
        &self.rows
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        if row.pose == Pose::from_deg(UNREADABLE) {
            return Err(FileError::new(
                std::path::Path::new(&row.file),
                "the file is truncated",
                "copy it again",
            ));
        }
        #[cfg(unix)]
        if row.pose == Pose::from_deg(NO_MORE_FILES) {
            let none_left = std::io::Error::from_raw_os_error(24);
            return Err(FileError::reading(
                std::path::Path::new(&row.file),
                &none_left,
            ));
        }
        if row.pose == Pose::from_deg(BLIND) {
            let [width, height] = [self.scene.geometry.width_px, self.scene.geometry.height_px];
            return Ok(Frame {
                width,
                height,
                rgb: vec![[0.2; 3]; width * height],
            });
        }
        // ±1 or 0 times the error, different for each shaft and frame.
        let wobble =
            |k: u32| (f64::from((row.frame * 7 + k * 5) % 3) - 1.0) * self.error_deg.to_radians();
        let mut at = row.pose;
        at.light.theta += wobble(0);
        at.light.phi += wobble(1);
        at.view.theta += wobble(2);
        at.view.phi += wobble(3);
        Ok(self.scene.frame(row.role, at, u64::from(row.frame)))
    }
}

/// A pose at which the source shows a blank wall.
const BLIND: [f64; 4] = [10.0, 10.0, 10.0, 10.0];
/// A pose whose frame cannot be read.
const UNREADABLE: [f64; 4] = [20.0, 20.0, 20.0, 20.0];
/// A pose at whose frame the system has no more files to open.
#[cfg(unix)]
const NO_MORE_FILES: [f64; 4] = [25.0, 20.0, 20.0, 20.0];

const POSES: [[f64; 4]; 6] = [
    [0.0, 0.0, 30.0, 300.0],
    [30.0, 60.0, 15.0, 180.0],
    [45.0, 200.0, 60.0, 20.0],
    [60.0, 90.0, 45.0, 250.0],
    [75.0, 15.0, 75.0, 120.0],
    [15.0, 120.0, 75.0, 300.0],
];

/// Logarithmic errors of one frame's samples, green channel.
struct FrameError {
    frame: u32,
    samples: usize,
    bias: f64,
    scatter: f64,
}

fn errors(processed: &Processed, truth: &dyn Brdf) -> Vec<FrameError> {
    let mut frames: Vec<u32> = processed.samples.iter().map(|s| s.frame).collect();
    frames.dedup();
    let of_frame = |frame: u32| {
        let logs: Vec<f64> = processed
            .samples
            .iter()
            .filter(|s| s.frame == frame)
            .map(|s| {
                let at = |t: f32, p: f32| Direction::from_deg(t.into(), p.into()).to_vec3();
                let light = at(s.theta_i_deg, s.phi_i_deg);
                let f = truth.eval(light, at(s.theta_v_deg, s.phi_v_deg));
                (f64::from(s.rgb[1]) / f[1]).natural_log()
            })
            .collect();
        let n = logs.len() as f64;
        let bias = logs.iter().sum::<f64>() / n;
        FrameError {
            frame,
            samples: logs.len(),
            bias,
            scatter: (logs.iter().map(|l| (l - bias).powi(2)).sum::<f64>() / n).sqrt(),
        }
    };
    frames.into_iter().map(of_frame).collect()
}

/// The paper's rings up to `theta_max`, every `thin`-th direction of each.
fn rings(theta_max: f64, thin: usize) -> Vec<[f64; 2]> {
    [
        (0.0, 1),
        (15.0, 6),
        (30.0, 12),
        (45.0, 18),
        (60.0, 20),
        (75.0, 24),
        (85.0, 24),
    ]
    .into_iter()
    .filter(|(theta, _)| *theta <= theta_max)
    .flat_map(|(theta, n)| {
        (0..n)
            .step_by(thin.min(n))
            .map(move |i| [theta, 360.0 * i as f64 / n as f64])
    })
    .collect()
}

const ALBEDO: [f64; 3] = [0.9, 0.85, 0.8];

/// A scene with a Lambertian reference, its rig that knows the albedo, and one frame of material
/// and reference at each pose.
fn lambertian(px: usize) -> (Rendered, Rig) {
    let mut scene = Scene::of_fabric(px);
    scene.reference = Arc::new(Kurt::new(ALBEDO, &[]));
    let mut rig = scene.geometry.to_rig();
    rig.reference = Some(Reference::lambertian(ALBEDO));
    let mut source = Rendered::new(scene);
    for angles in POSES {
        source.add(Role::Reference, angles);
        source.add(Role::Material, angles);
    }
    (source, rig)
}

#[test]
fn a_known_reference_gives_absolute_values_within_the_noise() {
    // A patch of n pixels with 1 % noise has a median good to 1.25 % / √n; two frames √2 of that.
    for (px, limits) in [(400, [0.012; 2]), (1024, [0.005; 2])] {
        let (source, rig) = lambertian(px);
        let done = process(&rig, &source, &Masks::default(), &|_, _| {
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(done.calibration, ReferenceCalibration::KnownReference);
        assert_eq!(done.samples.len(), POSES.len() * 1225);
        assert_eq!(done.left_out, LeftOutCounts::default());
        for error in errors(&done, source.scene.material.as_ref()) {
            assert_eq!(error.samples, 1225);
            assert!(
                error.bias.abs() < 0.002,
                "{px} {}: {}",
                error.frame,
                error.bias
            );
            assert!(
                error.scatter < limits[0],
                "{px} {}: {}",
                error.frame,
                error.scatter
            );
        }
        assert_eq!(done.offsets.unwrap().frames, 2 * POSES.len());
        assert!(done.offsets.unwrap().largest_deg < 0.03);
    }
}

#[test]
fn without_a_reference_an_ideal_light_is_assumed() {
    let (mut source, mut rig) = lambertian(400);
    source.rows.retain(|row| row.role == Role::Material);
    source.scene.beam = None;
    for reference in [rig.reference.take(), None] {
        rig.reference = reference;
        let done = process(&rig, &source, &Masks::default(), &|_, _| {
            ControlFlow::Continue(())
        })
        .unwrap();
        assert_eq!(done.calibration, ReferenceCalibration::GeometricModel);
        for error in errors(&done, source.scene.material.as_ref()) {
            assert!(error.bias.abs() < 0.002, "{}: {}", error.frame, error.bias);
            assert!(error.scatter < 0.01, "{}: {}", error.frame, error.scatter);
        }
    }
}

#[test]
fn an_unknown_reference_over_the_plan_gives_equation_3() {
    let mut source = Rendered::new(Scene::of_fabric(256));
    let directions = rings(85.0, 3);
    for light in &directions {
        for view in directions.iter().filter(|v| v[0] < 80.0) {
            source.add(Role::Reference, [light[0], light[1], view[0], view[1]]);
        }
    }
    let material = source.rows.iter().map(|row| row.pose).collect::<Vec<_>>();
    for pose in material.iter().step_by(79) {
        let angles = [
            pose.light.theta_deg(),
            pose.light.phi_deg(),
            pose.view.theta_deg(),
            pose.view.phi_deg(),
        ];
        source.add(Role::Material, angles);
    }
    let done = source.run().unwrap();
    assert_eq!(done.calibration, ReferenceCalibration::UnknownReference);
    assert!(done.reference.occluded > 0 && done.reference.mask_bytes > 0);
    assert!(done.reference.central > 500, "{:?}", done.reference);
    for error in errors(&done, source.scene.material.as_ref()) {
        // A third of the plan in each azimuth: the reference's own interpolation shows.
        assert!(error.bias.abs() < 0.02, "{}: {}", error.frame, error.bias);
        assert!(error.scatter < 0.02, "{}: {}", error.frame, error.scatter);
    }
}

#[test]
fn an_unknown_reference_must_cover_the_plan() {
    let mut source = Rendered::new(Scene::of_fabric(200));
    for angles in POSES {
        source.add(Role::Reference, angles);
        source.add(Role::Material, angles);
    }
    let error = source.run().unwrap_err();
    assert!(
        matches!(
            error,
            ProcessError::Coverage(coverage::CoverageError::TooFewPoses { poses: 6 })
        ),
        "{error}"
    );
    source.add(Role::Material, [75.0, 100.0, 0.0, 0.0]);
    let error = source.run().unwrap_err().to_string();
    assert!(
        error.starts_with("1 of 7 frames of the material"),
        "{error}"
    );
    assert!(error.contains("the first is frame 12"), "{error}");
}

#[test]
fn frames_that_cannot_be_used_are_refused_and_counted() {
    let (mut source, rig) = lambertian(200);
    source.add(Role::Material, [75.0, 100.0, 0.0, 0.0]);
    let blind = source.rows.len() as u32;
    source.add(Role::Material, BLIND);
    source.add(Role::Reference, BLIND);
    let done = process(&rig, &source, &Masks::default(), &|_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    let outcome = |frame: u32| {
        let of = |f: &&FrameReport| f.frame == frame;
        done.frames.iter().find(of).unwrap().outcome
    };
    assert_eq!(outcome(blind - 1), Outcome::Refused(Refusal::NoReference));
    assert!(matches!(
        outcome(blind),
        Outcome::Refused(Refusal::NotTheTarget(_))
    ));
    assert_eq!(done.frames.len(), source.rows.len());
    assert_eq!(done.samples.len(), POSES.len() * 1225);
    assert!(done.samples.iter().all(|s| s.frame < blind - 1));

    source
        .rows
        .retain(|row| row.role == Role::Material || row.frame > blind);
    let error = process(&rig, &source, &Masks::default(), &|_, _| {
        ControlFlow::Continue(())
    })
    .unwrap_err();
    assert!(matches!(
        error,
        ProcessError::ReferenceRefused { refused: 1, .. }
    ));
}

#[test]
fn a_frame_that_cannot_be_read_or_has_another_size_is_named() {
    let (mut source, mut rig) = lambertian(200);
    rig.camera.width_px = 100;
    let error = process(&rig, &source, &Masks::default(), &|_, _| {
        ControlFlow::Continue(())
    })
    .unwrap_err()
    .to_string();
    assert!(
        error.starts_with("frame 0 (frames/000000.exr) has 200 x 200 pixels"),
        "{error}"
    );
    rig.camera.width_px = 200;
    let run = |source: &Rendered| {
        process(&rig, source, &Masks::default(), &|_, _| {
            ControlFlow::Continue(())
        })
    };
    let sound = run(&source).unwrap();
    assert_eq!(sound.remarks, []);
    source.add(Role::Reference, UNREADABLE);
    source.add(Role::Material, UNREADABLE);
    let rest = run(&source).unwrap();
    assert_eq!(rest.samples, sound.samples);
    let said: Vec<String> = rest.remarks.iter().map(ToString::to_string).collect();
    assert_eq!(
        said,
        [
            "reference frame 12: is left out; frames/000012.exr: the file is truncated; copy it again",
            "material frame 13: is left out; frames/000013.exr: the file is truncated; copy it again",
        ]
    );
    let refused = |f: &&FrameReport| f.outcome == Outcome::Refused(Refusal::Unusable);
    assert_eq!(rest.frames.iter().filter(refused).count(), 2);
    // Nothing is left of the reference, or of the material.
    for (role, frame) in [(Role::Material, 12), (Role::Reference, 13)] {
        let all = source.rows.clone();
        source
            .rows
            .retain(|row| row.role == role || row.frame == frame);
        let error = run(&source).unwrap_err().to_string();
        source.rows = all;
        assert_eq!(
            error,
            format!("frame {frame}: frames/{frame:06}.exr: the file is truncated; copy it again")
        );
    }
    source.rows.clear();
    let error = process(&rig, &source, &Masks::default(), &|_, _| {
        ControlFlow::Continue(())
    })
    .unwrap_err();
    assert!(matches!(error, ProcessError::NoMaterial { rows: 0 }));
}

#[test]
fn samples_do_not_depend_on_the_number_of_threads_and_progress_counts_to_the_end() {
    let (source, rig) = lambertian(200);
    let run = |threads| {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .unwrap();
        let heard = AtomicUsize::new(0);
        let progress = |_, _| {
            heard.fetch_add(1, Ordering::Relaxed);
            ControlFlow::Continue(())
        };
        let masks = Masks::default();
        let done = pool.install(|| process(&rig, &source, &masks, &progress));
        assert_eq!(heard.into_inner(), source.rows().len());
        let done = done.unwrap();
        done.samples
    };
    assert_eq!(run(1), run(3));
}

/// Gives only the rows that are asked for, and counts them and the frames of which all are wanted.
struct ByRows<'a> {
    rendered: &'a Rendered,
    given: AtomicUsize,
    whole: AtomicUsize,
}

impl FrameSource for ByRows<'_> {
    fn rows(&self) -> &[FrameRow] {
        self.rendered.rows()
    }

    fn load(&self, row: &FrameRow) -> Result<Frame, FileError> {
        self.whole.fetch_add(1, Ordering::Relaxed);
        self.rendered.load(row)
    }

    fn load_rows(
        &self,
        row: &FrameRow,
        rows: std::ops::Range<usize>,
        _: &mut gonia_formats::frame_exr::SpareFrame,
    ) -> Result<Option<Frame>, FileError> {
        self.given.fetch_add(rows.len(), Ordering::Relaxed);
        let mut frame = self.rendered.load(row)?;
        for (k, line) in frame.rgb.chunks_mut(frame.width).enumerate() {
            if !rows.contains(&k) {
                line.fill([f32::NAN; 3]);
            }
        }
        Ok(Some(frame))
    }
}

#[test]
fn rows_that_show_the_target_give_the_samples_of_the_whole_frames() {
    let (mut source, rig) = lambertian(300);
    // A light's head in the way, and a frame that does not show the target.
    source.add(Role::Reference, [75.0, 165.0, 75.0, 345.0]);
    source.add(Role::Material, [75.0, 165.0, 75.0, 345.0]);
    source.add(Role::Material, BLIND);
    let going = |_, _| ControlFlow::Continue(());
    let whole = process(&rig, &source, &Masks::default(), &going).unwrap();
    let by_rows = ByRows {
        rendered: &source,
        given: AtomicUsize::new(0),
        whole: AtomicUsize::new(0),
    };
    let some = process(&rig, &by_rows, &Masks::default(), &going).unwrap();
    assert_eq!(some.samples, whole.samples);
    assert_eq!(some.frames, whole.frames);
    assert!(whole.samples.len() > 5000, "{}", whole.samples.len());
    // Only the blank wall was looked at as a whole.
    assert_eq!(by_rows.whole.into_inner(), 1);
    let share = by_rows.given.into_inner() as f64 / (300 * source.rows.len()) as f64;
    assert!(share < 0.75, "{share}");
}

#[test]
fn frames_that_are_sampled_by_shares_give_what_one_process_gives() {
    let (mut source, rig) = lambertian(300);
    // A light's head in the way, a material without a reference, and frames that cannot be used.
    source.add(Role::Reference, [75.0, 165.0, 75.0, 345.0]);
    source.add(Role::Material, [75.0, 165.0, 75.0, 345.0]);
    source.add(Role::Material, [75.0, 100.0, 0.0, 0.0]);
    source.add(Role::Reference, BLIND);
    source.add(Role::Material, BLIND);
    source.add(Role::Reference, UNREADABLE);
    source.add(Role::Material, UNREADABLE);
    let going = |_, _| ControlFlow::Continue(());
    let whole = process(&rig, &source, &Masks::default(), &going).unwrap();
    assert!(!whole.remarks.is_empty());
    let n = source.rows.len();
    let mut shares: Vec<Vec<u8>> = [0..5, 5..n, n..n + 3]
        .map(|rows| sample_share(&rig, &source, rows).unwrap())
        .into();
    let counted = ByRows {
        rendered: &source,
        given: AtomicUsize::new(0),
        whole: AtomicUsize::new(0),
    };
    let shared = process_shared(&rig, &counted, &shares, &going).unwrap();
    assert_eq!(shared.samples, whole.samples);
    assert_eq!(shared.frames, whole.frames);
    assert_eq!(shared.remarks, whole.remarks);
    assert_eq!(shared.left_out, whole.left_out);
    // Only what cannot be read, and a frame whose reference is refused, was looked at here.
    assert_eq!(counted.whole.into_inner(), 3);
    // A share that is cut, or missing, is made up for.
    shares[1].truncate(30_000);
    shares.remove(0);
    let shared = process_shared(&rig, &source, &shares, &going).unwrap();
    assert_eq!(shared.samples, whole.samples);
}

#[test]
fn masks_of_a_references_frames_serve_a_material_without_them() {
    let mut scene = Scene::of_fabric(400);
    scene.beam = None;
    let rig = scene.geometry.to_rig();
    // The head in front of the material, and a material too dark to tell by itself what hides it.
    let hidden = [30.0, 60.0, 30.0, 60.0];
    let mut with_reference = Rendered::new(scene.clone());
    with_reference.add(Role::Reference, hidden);
    with_reference.add(Role::Material, hidden);
    let mut known = rig.clone();
    known.reference = Some(Reference::lambertian([0.5; 3]));
    let first = process(&known, &with_reference, &Masks::default(), &|_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(first.masks.len(), 1);
    let occluded = first.left_out.occlusion;
    assert!(occluded > 50, "{occluded}");

    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("masks.csv");
    first.masks.write(&path, &rig).unwrap();
    let masks = Masks::read(&path, &rig).unwrap();
    scene.material = Arc::new(Kurt::new([0.02; 3], &[]));
    let mut alone = Rendered::new(scene);
    alone.add(Role::Material, hidden);
    alone.rows[0].frame = 1;
    let done = process(&rig, &alone, &masks, &|_, _| ControlFlow::Continue(())).unwrap();
    let off = done.left_out.occlusion.abs_diff(occluded);
    assert!(off <= 5, "{occluded}, and {}", done.left_out.occlusion);
    let without = process(&rig, &alone, &Masks::default(), &|_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(without.left_out.occlusion, 0);
}

#[test]
fn a_reference_with_a_table_gives_absolute_values_by_its_directions() {
    use gonia_rig::ReflectanceTable;
    let (source, mut rig) = lambertian(400);
    // The truth is Lambertian: a table of twice the albedo at 60° gives twice the value there.
    let rows = vec![
        (0.0, ALBEDO),
        (40.0, ALBEDO),
        (58.0, ALBEDO.map(|a| 2.0 * a)),
    ];
    rig.reference = Some(Reference::from(Reflectance::Table {
        file: "white.csv".into(),
        table: ReflectanceTable::ByIncidence(rows),
    }));
    let done = process(&rig, &source, &Masks::default(), &|_, _| {
        ControlFlow::Continue(())
    })
    .unwrap();
    assert_eq!(done.calibration, ReferenceCalibration::KnownReference);
    for (theta, factor) in [(30.0f32, 1.0f64), (75.0, 2.0)] {
        let truth = source.scene.material.as_ref();
        let near = |s: &&Sample| (s.theta_i_deg - theta).abs() < 2.0;
        let logs: Vec<f64> = done
            .samples
            .iter()
            .filter(near)
            .map(|s| {
                let at = |t: f32, p: f32| Direction::from_deg(t.into(), p.into()).to_vec3();
                let f = truth.eval(
                    at(s.theta_i_deg, s.phi_i_deg),
                    at(s.theta_v_deg, s.phi_v_deg),
                );
                (f64::from(s.rgb[1]) / f[1] / factor).natural_log()
            })
            .collect();
        let mean = logs.iter().sum::<f64>() / logs.len() as f64;
        assert!(logs.len() > 100 && mean.abs() < 0.002, "{theta}: {mean}");
    }
}

/// Frames that are sound are not left out because the system could not open them.
#[cfg(unix)]
#[test]
fn the_systems_own_shortage_ends_the_work_and_is_named() {
    let (mut source, rig) = lambertian(200);
    source.add(Role::Material, NO_MORE_FILES);
    let going = |_, _| ControlFlow::Continue(());
    let error = process(&rig, &source, &Masks::default(), &going).unwrap_err();
    let said = error.to_string();
    assert!(
        said.contains(".exr: cannot be read (Too many open files") && said.contains("ulimit -n"),
        "{said}"
    );
}

#[test]
fn a_break_ends_the_work() {
    let (source, rig) = lambertian(200);
    let heard = AtomicUsize::new(0);
    let result = process(&rig, &source, &Masks::default(), &|_, _| {
        heard.fetch_add(1, Ordering::Relaxed);
        ControlFlow::Break(())
    });
    assert!(matches!(result, Err(ProcessError::Cancelled(_))));
    // The material's frames, which come after the reference's, are not looked at.
    assert!(heard.into_inner() < source.rows().len());
}

/// Frames of material and known reference of a rig that was built with `change`, at poses over the paper's
/// plan; and the rig that it is said to be.
fn crooked(px: usize, poses: usize, change: impl Fn(&mut Rig)) -> (Rendered, Rig) {
    let mut rig = Rig::paper(px);
    rig.reference = Some(Reference::lambertian(ALBEDO));
    let mut built = rig.clone();
    change(&mut built);
    let mut scene = Scene::of_fabric(px);
    scene.geometry = SceneGeometry::of_rig(&built);
    scene.reference = Arc::new(Kurt::new(ALBEDO, &[]));
    let mut source = Rendered::new(scene);
    let (lights, views) = (rings(85.0, 1), rings(75.0, 1));
    for k in 0..poses {
        // Steps that share no factor with the numbers of directions.
        let (light, view) = (lights[(41 * k + 3) % 105], views[(23 * k + 7) % 81]);
        for role in [Role::Reference, Role::Material] {
            source.add(role, [light[0], light[1], view[0], view[1]]);
        }
    }
    (source, rig)
}

fn said(source: &Rendered, rig: &Rig) -> String {
    let heard = &|_, _| ControlFlow::Continue(());
    match process(rig, source, &Masks::default(), heard) {
        Ok(done) => done.remarks.iter().map(|r| format!("{r}\n")).collect(),
        Err(error) => format!("error: {error}"),
    }
}

#[test]
fn a_camera_that_is_off_in_all_frames_is_said_to_be_in_one_line() {
    type Change = fn(&mut Rig);
    let cases: [(&str, usize, Change, &str); 4] = [
        (
            "rolled by 0.7 degrees",
            400,
            |rig| rig.camera.mount.roll_deg = 0.7,
            "degrees clockwise",
        ),
        (
            "aims 15 mm beside",
            400,
            |rig| rig.camera.mount.aim_mm = [15.0, 0.0],
            "the rig is not what it says",
        ),
        (
            "principal point 4 px off",
            400,
            |rig| rig.camera.centre_px[0] += 4.0,
            "about +4.0 pixels to the right",
        ),
        (
            "principal point 2 px off in small frames",
            240,
            |rig| rig.camera.centre_px[1] -= 2.0,
            "the rig is not what it says",
        ),
    ];
    for (what, px, change, word) in cases {
        let (source, rig) = crooked(px, 8, change);
        let said = said(&source, &rig);
        let about = said.matches("the rig is not what it says").count();
        assert!(about == 1 && said.contains(word), "{what}: {said}");
        assert!(said.contains("gonia calibrate"), "{what}: {said}");
    }
}

/// Median angle between directions of the light of two rigs at the frames' poses, degrees.
fn light_apart_deg(source: &Rendered, [a, b]: [&Rig; 2]) -> f64 {
    let apart = |row: &FrameRow| {
        let [a, b] = [a, b].map(|rig| rig.light_at(row.pose.light).direction_from([0.0; 2]));
        angle_between(a, b).to_degrees()
    };
    let mut all: Vec<f64> = source.rows().iter().map(apart).collect();
    all.sort_by(f64::total_cmp);
    all[all.len() / 2]
}

#[test]
fn a_light_that_is_off_shows_in_the_shading_of_a_known_reference_and_by_how_much() {
    type Change = fn(&mut Rig);
    let off: [(&str, usize, Change); 4] = [
        ("3 mm beside and 1 % too far", 240, |rig| {
            rig.light.arm.right_mm = 3.0;
            rig.light.distance_m *= 1.01;
        }),
        ("zeros 0.3 degrees off", 240, |rig| {
            rig.light.arm.theta_zero_deg = 0.3;
            rig.light.arm.phi_zero_deg = -0.3;
        }),
        ("zero of theta 0.12 degrees off", 320, |rig| {
            rig.light.arm.theta_zero_deg = 0.12;
        }),
        ("target 1 mm high and tilted by 0.2 degrees", 320, |rig| {
            rig.target.place.height_mm = 1.0;
            rig.target.place.tilt_deg = [0.2, 0.0];
        }),
    ];
    let mut wrong = Vec::new();
    for (what, px, change) in off {
        let (source, rig) = crooked(px, 40, change);
        let mut truth = rig.clone();
        change(&mut truth);
        let is = light_apart_deg(&source, [&rig, &truth]);
        let said = said(&source, &rig);
        let numbers = said
            .split_once("are off by ")
            .and_then(|(_, rest)| rest.split_once(" degrees in the median frame"))
            .and_then(|(numbers, _)| numbers.split_once(" ± "));
        let is_right = numbers.is_some_and(|(deg, u)| {
            let [deg, u]: [f64; 2] = [deg, u].map(|text| text.parse().unwrap());
            u < 0.05 && (deg - is).abs() < 0.02 + 2.0 * u
        });
        wrong.extend((!is_right).then(|| format!("{what}: {is:.3} {said}")));
    }
    // The lines show that first: few frames have them in their places.
    let (source, rig) = crooked(240, 40, |rig| rig.target.place.height_mm = 4.0);
    let said = said(&source, &rig);
    wrong.extend((!said.contains("the rig is not what it says")).then_some(said));
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn a_rig_as_it_is_said_to_be_is_left_in_peace_by_small_frames_too() {
    let (source, rig) = crooked(160, 60, |_| {});
    assert_eq!(said(&source, &rig), "");
}

#[test]
fn a_light_in_its_place_is_left_in_peace() {
    // Uneven beams, a lens that darkens, a reference that is uneven or not quite Lambertian: all of them are
    // as usual.
    let (source, rig) = crooked(240, 60, |_| {});
    assert_eq!(said(&source, &rig), "");
    let (mut source, rig) = crooked(240, 60, |_| {});
    source.scene.beam = Some(Beam {
        width_deg: 20.0,
        axis_deg: [-4.0, 3.0],
    });
    assert_eq!(said(&source, &rig), "");
}
