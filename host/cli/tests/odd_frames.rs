//! Frames as people have them, and frames that contradict themselves, through the program.
#![allow(clippy::unwrap_used)]

#[path = "common/cases.rs"]
mod cases;
mod common;

use cases::{Case, document};
use common::{gonia, text};
use exr::prelude::{
    AnyChannel, AnyChannels, Encoding, FlatSamples, Image, ImageAttributes, IntegerBounds, Layer,
    LayerAttributes, Vec2, WritableImage,
};
use gonia_brdf::Elementary;
use gonia_brdf::model::Kurt;
use gonia_brdf::{Pose, Sample};
use gonia_formats::frame_exr::write_frame;
use gonia_formats::raw_frame::write_raw;
use gonia_formats::rig_toml::write_rig;
use gonia_formats::samples::read_samples;
use gonia_rig::{Bayer, Frame, RawFrame, Reference, Rig, Role, Sensor};
use gonia_sim::scene::{RawSensor, Scene, SceneGeometry};
use std::fs::{self, File};
use std::path::Path;
use std::sync::{Arc, LazyLock, Mutex};
use tiff::encoder::TiffEncoder;
use tiff::tags::Tag;

const PX: usize = 200;
const ALBEDO: [f64; 3] = [0.5, 0.9, 0.7];
/// Counts a second of a radiance of one.
const COUNTS: f32 = 12_000.0;
const POSES: [[f64; 4]; 4] = [
    [30.0, 60.0, 30.0, 185.0],
    [60.0, 90.0, 45.0, 250.0],
    [10.0, 300.0, 60.0, 20.0],
    [45.0, 10.0, 0.0, 0.0],
];
const ROLES: [Role; 2] = [Role::Material, Role::Reference];

/// The material's frame and the reference's of every pose.
static FRAMES: LazyLock<Vec<[Frame; 2]>> = LazyLock::new(|| {
    let mut scene = Scene::new(
        SceneGeometry::paper(PX),
        Arc::new(Kurt::two_thread_fabric()),
        Arc::new(Kurt::new(ALBEDO, &[])),
        3,
    );
    scene.noise = None;
    let render = |pose: [f64; 4]| ROLES.map(|role| scene.frame(role, Pose::from_deg(pose), 0));
    POSES.into_iter().map(render).collect()
});

fn rig() -> Rig {
    let mut rig = Rig::paper(PX);
    rig.reference = Some(Reference::lambertian(ALBEDO));
    rig.sensor = Some(sensor(None));
    rig
}

fn sensor(bayer: Option<Bayer>) -> Sensor {
    Sensor {
        black_counts: 64.0,
        saturation_counts: 3900.0,
        gain_e_per_count: 2.5,
        read_noise_e: 4.0,
        bayer,
    }
}

/// A capture folder whose frames are EXRs `role_N.exr`.
fn write_exrs(folder: &Path) {
    write_rig(&folder.join("rig.toml"), &rig()).unwrap();
    let mut csv = "frame,role,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg,file\n".to_owned();
    for (number, ([a, b, c, d], frames)) in POSES.iter().zip(FRAMES.iter()).enumerate() {
        for (role, frame) in ROLES.iter().zip(frames) {
            let role = role.name();
            let file = format!("{role}_{number}.exr");
            write_frame(&folder.join(&file), frame).unwrap();
            csv += &format!("{number},{role},{a},{b},{c},{d},{file}\n");
        }
    }
    fs::write(folder.join("frames.csv"), csv).unwrap();
}

/// A capture folder of raw exposures `role_N_K.png` of these seconds.
fn write_raws(folder: &Path, times: &[f64], pattern: Option<Bayer>, told: Option<Bayer>) {
    let mut rig = rig();
    rig.sensor = Some(sensor(told));
    write_rig(&folder.join("rig.toml"), &rig).unwrap();
    let header = "frame,role,theta_i_deg,phi_i_deg,theta_v_deg,phi_v_deg,file,exposure_s\n";
    let mut csv = header.to_owned();
    for (number, ([a, b, c, d], frames)) in POSES.iter().zip(FRAMES.iter()).enumerate() {
        for (role, frame) in ROLES.iter().zip(frames) {
            let role = role.name();
            for (k, time) in times.iter().enumerate() {
                let file = format!("{role}_{number}_{k}.png");
                write_raw(&folder.join(&file), &expose(frame, *time, pattern)).unwrap();
                csv += &format!("{number},{role},{a},{b},{c},{d},{file},{time}\n");
            }
        }
    }
    fs::write(folder.join("frames.csv"), csv).unwrap();
}

/// The same of a mosaic, as DNGs of half a second each, which say this black level.
fn write_dngs(folder: &Path, black: u16) {
    write_raws(folder, &[0.5], Some(Bayer::Grbg), None);
    let list = folder.join("frames.csv");
    let csv = fs::read_to_string(&list).unwrap();
    fs::write(&list, csv.replace(".png,0.5", ".dng,")).unwrap();
    for path in fs::read_dir(folder)
        .unwrap()
        .map(|item| item.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "png"))
    {
        let raw = gonia_formats::raw_frame::read_raw(&path, PX, PX)
            .unwrap()
            .raw;
        let file = File::create(path.with_extension("dng")).unwrap();
        let mut file = TiffEncoder::new(file).unwrap();
        let mut image = file
            .new_image::<tiff::encoder::colortype::Gray16>(PX as u32, PX as u32)
            .unwrap();
        let tags = image.encoder();
        let tag = Tag::Unknown;
        let range = 3900.0 - f64::from(black);
        let gain = 2.5;
        // Shot and read noise of the sensor, of values from 0 to 1.
        let noise = [1.0 / (gain * range), (4.0 / gain / range).powi(2)];
        tags.write_tag(tag(50_706), &[1u8, 4, 0, 0][..]).unwrap();
        tags.write_tag(Tag::PhotometricInterpretation, 32_803u16)
            .unwrap();
        tags.write_tag(tag(33_421), &[2u16, 2][..]).unwrap();
        tags.write_tag(tag(33_422), &[1u8, 0, 2, 1][..]).unwrap();
        tags.write_tag(tag(50_714), black).unwrap();
        tags.write_tag(tag(50_717), 3900u16).unwrap();
        tags.write_tag(tag(51_041), &noise[..]).unwrap();
        tags.write_tag(tag(33_434), tiff::encoder::Rational { n: 1, d: 2 })
            .unwrap();
        image.write_data(&raw.counts).unwrap();
        fs::remove_file(path).unwrap();
    }
}

fn expose(frame: &Frame, time: f64, pattern: Option<Bayer>) -> RawFrame {
    let site = |(i, rgb): (usize, &[f32; 3])| match pattern {
        Some(pattern) => vec![rgb[pattern.colors()[i / PX % 2][i % PX % 2]]],
        None => rgb.to_vec(),
    };
    let rates = frame.rgb.iter().enumerate().flat_map(site);
    let rates: Vec<f32> = rates.map(|v| v * COUNTS).collect();
    let device = RawSensor {
        black_counts: 64.0,
        white_counts: 4095.0,
        gain_e_per_count: 2.5,
        read_noise_e: 4.0,
    };
    RawFrame {
        width: PX,
        height: PX,
        channels: rates.len() / (PX * PX),
        counts: device.expose(&rates, time, 1),
    }
}

fn channel(frame: &Frame, window: [usize; 4], of: impl Fn(&[f32; 3]) -> f32) -> FlatSamples {
    let [left, top, width, height] = window;
    let rows = top..top + height;
    let pixels = rows.flat_map(|y| frame.rgb[y * PX + left..][..width].iter());
    FlatSamples::F32(pixels.map(of).collect())
}

/// Writes an EXR of the frame's pixels in `window` (left, top, width, height), at `at`.
fn write_channels(path: &Path, channels: Vec<(&str, FlatSamples)>, size: [usize; 2], at: [i32; 2]) {
    let list = channels
        .into_iter()
        .map(|(n, data)| AnyChannel::new(n, data));
    let layer = Layer::new(
        (size[0], size[1]),
        LayerAttributes::default().with_position(Vec2(at[0], at[1])),
        Encoding::SMALL_LOSSLESS,
        AnyChannels::sort(list.collect()),
    );
    let display = IntegerBounds::from_dimensions((PX, PX));
    Image::new(ImageAttributes::new(display), layer)
        .write()
        .to_file(path)
        .unwrap();
}

const WHOLE: [usize; 4] = [0, 0, PX, PX];

/// Writes every frame of a folder of EXRs again, with other channels.
fn rename_channels(folder: &Path, names: [&'static str; 3], more: &[&'static str]) {
    for (number, frames) in FRAMES.iter().enumerate() {
        for (role, frame) in ROLES.iter().zip(frames) {
            let of = |c: usize| channel(frame, WHOLE, move |rgb| rgb[c]);
            let mut list: Vec<_> = (0..3).map(|c| (names[c], of(c))).collect();
            list.extend(more.iter().map(|name| (*name, of(1))));
            let path = folder.join(format!("{}_{number}.exr", role.name()));
            write_channels(&path, list, [PX, PX], [0, 0]);
        }
    }
}

/// Writes every PNG of a folder again: `encode` makes its bytes, `set` its chunks.
fn rewrite_pngs(
    folder: &Path,
    depth: png::BitDepth,
    encode: impl Fn(u16) -> Vec<u8>,
    set: impl Fn(&mut png::Info<'_>),
) {
    for path in fs::read_dir(folder)
        .unwrap()
        .map(|item| item.unwrap().path())
    {
        if path.extension().is_some_and(|e| e == "png") {
            let raw = gonia_formats::raw_frame::read_raw(&path, PX, PX)
                .unwrap()
                .raw;
            let mut info = png::Info::with_size(PX as u32, PX as u32);
            info.color_type = png::ColorType::Rgb;
            info.bit_depth = depth;
            set(&mut info);
            let out = File::create(&path).unwrap();
            let mut writer = png::Encoder::with_info(out, info)
                .unwrap()
                .write_header()
                .unwrap();
            let bytes: Vec<u8> = raw.counts.iter().flat_map(|c| encode(*c)).collect();
            writer.write_image_data(&bytes).unwrap();
        }
    }
}

fn wide(counts: u16) -> Vec<u8> {
    counts.to_be_bytes().to_vec()
}

/// What `process` made of it: the case, and the samples if there are any.
struct Run {
    case: Case,
    samples: Option<Vec<Sample>>,
}

/// Makes a folder, breaks it, and processes it.
fn process(came_in: &str, make: impl FnOnce(&Path)) -> Run {
    let dir = tempfile::tempdir().unwrap();
    // A name that does not change from run to run, for paths that hold it.
    let folder = dir.path().join("capture");
    fs::create_dir(&folder).unwrap();
    make(&folder);
    let output = gonia(&["process", text(&folder)], "");
    let case = Case::new(came_in, &output, &folder, &["refused"]);
    let made = folder.join("samples.npy");
    assert_eq!(
        made.exists(),
        case.code() == 0,
        "{came_in}: {}",
        case.said()
    );
    let samples = made.exists().then(|| read_samples(&made).unwrap().samples);
    Run { case, samples }
}

/// The samples of an untouched folder.
fn sound() -> Vec<Sample> {
    let run = process("", write_exrs);
    assert_eq!(run.case.said(), "");
    run.samples.unwrap()
}

/// What went otherwise, of all cases: a run of the test shows all of it.
static WRONG: Mutex<Vec<String>> = Mutex::new(Vec::new());

fn expect(is_so: bool, what: &str) {
    if !is_so {
        WRONG.lock().unwrap().push(what.to_owned());
    }
}

impl Run {
    /// It was read in silence, and has the same samples.
    fn read_as(self, sound: &[Sample]) -> Case {
        expect(self.case.said().is_empty(), self.case.said());
        expect_same(self.samples.as_deref().unwrap_or_default(), sound);
        self.case
    }

    /// It ended with exit code 1 and these words.
    fn refused(self, words: &[&str]) -> Case {
        expect(self.case.code() == 1, self.case.said());
        self.says(words)
    }

    /// It was used, and these words were said.
    fn used(self, words: &[&str]) -> Case {
        expect(self.case.code() == 0, self.case.said());
        self.says(words)
    }

    fn says(self, words: &[&str]) -> Case {
        let said = self.case.said();
        let all = words.iter().all(|word| said.contains(word));
        expect(all, &format!("{words:?}: {said}"));
        self.case
    }
}

fn expect_same(samples: &[Sample], sound: &[Sample]) {
    expect(samples.len() == sound.len(), "another number of samples");
    let close = |(a, b): (&Sample, &Sample)| {
        a.frame == b.frame && (0..3).all(|c| (a.rgb[c] / b.rgb[c] - 1.0).abs() < 5e-3)
    };
    expect(samples.iter().zip(sound).all(close), "other values");
}

// long: one folder after another, each with what is to be said of it.
fn channels_and_windows(sound: &[Sample]) -> Vec<Case> {
    let one = |folder: &Path, window: [usize; 4], at: [i32; 2]| {
        let frame = &FRAMES[0][0];
        let list = ["R", "G", "B"].into_iter().enumerate();
        let list = list.map(|(c, name)| (name, channel(frame, window, move |rgb| rgb[c])));
        let path = folder.join("material_0.exr");
        write_channels(&path, list.collect(), [window[2], window[3]], at);
    };
    let layered = process(
        "EXR with channels `beauty.r`, `beauty.g`, `beauty.b` beside `depth.Z` and `A`",
        |folder| {
            write_exrs(folder);
            rename_channels(
                folder,
                ["beauty.r", "beauty.g", "beauty.b"],
                &["depth.Z", "A"],
            );
        },
    );
    let grey = process("EXR with `Y` alone", |folder| {
        write_exrs(folder);
        for (number, frames) in FRAMES.iter().enumerate() {
            for (role, frame) in ROLES.iter().zip(frames) {
                let green = channel(frame, WHOLE, |rgb| rgb[1]);
                let path = folder.join(format!("{}_{number}.exr", role.name()));
                write_channels(&path, vec![("Y", green)], [PX, PX], [0, 0]);
            }
        }
    });
    // Its own reference takes out what the grey reference has of colour.
    let green = grey.samples.iter().flatten().map(|s| s.rgb[1]);
    let same = green
        .zip(sound)
        .filter(|(g, s)| (g / s.rgb[1] - 1.0).abs() < 5e-3);
    expect(same.count() == sound.len(), "grey values are others");
    expect(grey.case.said().is_empty(), grey.case.said());
    let missing = process("EXR with `R`, `G` and `A`", |folder| {
        write_exrs(folder);
        rename_channels(folder, ["R", "G", "A"], &[]);
    });
    let several = process("EXR with colours in two layers", |folder| {
        write_exrs(folder);
        rename_channels(folder, ["a.R", "a.G", "a.B"], &["b.R", "b.G", "b.B"]);
    });
    let cropped = process(
        "EXR whose data window is cropped, and rightly placed",
        |folder| {
            write_exrs(folder);
            one(folder, [70, 0, PX - 70, PX], [70, 0]);
        },
    );
    // Three lines and most of the disc are there; the values are those of the whole frame.
    let kept: Vec<Sample> = cropped.samples.clone().unwrap_or_default();
    let of_frame: Vec<&Sample> = kept.iter().filter(|s| s.frame == 0).collect();
    let count = of_frame.len();
    expect(
        (600..1225).contains(&count),
        &format!("{count} samples are left"),
    );
    let at = |s: &Sample| [s.theta_i_deg, s.phi_i_deg];
    let near = |a: &Sample, b: &Sample| (0..2).all(|i| (at(a)[i] - at(b)[i]).abs() < 0.05);
    let there = of_frame.iter().filter(|s| {
        let whole = sound.iter().find(|b| b.frame == 0 && near(s, b));
        whole.is_some_and(|b| (s.rgb[1] / b.rgb[1] - 1.0).abs() < 0.01)
    });
    let there = there.count();
    expect(
        there > 500,
        &format!("{there} of them have the whole frame's value"),
    );
    let moved = process("EXR whose data window is moved by 20 pixels", |folder| {
        write_exrs(folder);
        one(folder, WHOLE, [20, 0]);
    });
    let outside = process(
        "EXR whose data window lies beside the display window",
        |folder| {
            write_exrs(folder);
            one(folder, WHOLE, [PX as i32, 0]);
        },
    );
    vec![
        grey.case,
        layered.read_as(sound),
        missing.refused(&["has no channel B, only A, G, R"]),
        several.refused(&["has colours in 2 layers: a, b"]),
        cropped.used(&[]),
        moved.used(&["refused, 1", "the target is seen +20.0 pixels to the right"]),
        outside.used(&[
            "material frame 0: is left out",
            "begins at (200, 0), outside",
        ]),
    ]
}

// long: one folder after another, each with what is to be said of it.
fn cameras_and_turns(sound: &[Sample]) -> Vec<Case> {
    let turned = |came_in: &str, of: fn([usize; 2]) -> [usize; 2], all: bool| {
        process(came_in, |folder| {
            write_exrs(folder);
            let count = if all { POSES.len() } else { 1 };
            for (number, frames) in FRAMES.iter().enumerate().take(count) {
                for (role, frame) in ROLES.iter().zip(frames) {
                    let rgb = (0..PX * PX).map(|i| of([i % PX, i / PX]));
                    let rgb = rgb.map(|[x, y]| frame.rgb[y * PX + x]).collect();
                    let frame = Frame { rgb, ..*frame };
                    let path = folder.join(format!("{}_{number}.exr", role.name()));
                    write_frame(&path, &frame).unwrap();
                }
            }
        })
    };
    let wrong_size = |all: bool| {
        let came_in = if all {
            "frames of another camera"
        } else {
            "one frame of another camera"
        };
        process(came_in, |folder| {
            write_exrs(folder);
            let other = Frame {
                width: PX,
                height: PX - 50,
                rgb: FRAMES[0][0].rgb[..PX * (PX - 50)].to_vec(),
            };
            let count = if all { POSES.len() } else { 1 };
            for number in 0..count {
                write_frame(&folder.join(format!("material_{number}.exr")), &other).unwrap();
            }
        })
    };
    let size = "is 200 × 150 pixels, but the rig's camera has 200 × 200";
    let displaced = process("`centre_px` 3 pixels off", |folder| {
        write_exrs(folder);
        let mut rig = rig();
        rig.camera.centre_px[0] -= 3.0;
        write_rig(&folder.join("rig.toml"), &rig).unwrap();
    });
    let broken = process("one file of many cut short", |folder| {
        write_exrs(folder);
        let path = folder.join("material_1.exr");
        let bytes = fs::read(&path).unwrap();
        fs::write(&path, &bytes[..bytes.len() / 2]).unwrap();
    });
    let others: Vec<Sample> = sound.iter().filter(|s| s.frame != 1).copied().collect();
    expect_same(broken.samples.as_deref().unwrap_or_default(), &others);
    let paths = process(
        "`frames.csv` with `.\\material_0.exr`, blanks and a folder of another computer",
        |folder| {
            write_exrs(folder);
            let list = folder.join("frames.csv");
            let csv = fs::read_to_string(&list).unwrap();
            let csv = csv
                .replace("material_0.exr", " .\\material_0.exr ")
                .replace("reference_1.exr", "C:\\rig\\capture\\reference_1.exr");
            fs::write(list, csv).unwrap();
        },
    );
    let spreadsheet = process("`frames.csv` of a German spreadsheet", |folder| {
        write_exrs(folder);
        let list = folder.join("frames.csv");
        let csv = fs::read_to_string(&list).unwrap();
        let csv = csv
            .replace(',', ";")
            .replace("theta_i_deg;phi_i_deg", "Theta_in [°];Phi_in [°]")
            .replace("frame;role", "Frame;Role")
            .replace(";30;60;30;185;", ";30,0;60,0;30,0;185,0;")
            .replace('\n', ";\r\n");
        // Latin-1, as older spreadsheets save it.
        fs::write(list, csv.chars().map(|c| c as u8).collect::<Vec<u8>>()).unwrap();
    });
    let nameless = process("`frames.csv` with a column of another name", |folder| {
        write_exrs(folder);
        let list = folder.join("frames.csv");
        let csv = fs::read_to_string(&list).unwrap();
        fs::write(list, csv.replace("theta_v_deg", "tilt")).unwrap();
    });
    vec![
        spreadsheet.read_as(sound),
        nameless.refused(&["there is no column \"theta_v_deg\"; found: frame, role, theta_i_deg"]),
        wrong_size(true).refused(&[size]),
        wrong_size(false).used(&["material frame 0: is left out", size]),
        turned(
            "frames turned by 180°, as dcraw turns them",
            |[x, y]| [PX - 1 - x, PX - 1 - y],
            true,
        )
        .used(&[
            "refused, 6 it does",
            "the frame is turned by 180 degrees",
            "2 frames seen from within 5 degrees of the normal are used, and would not show it",
        ]),
        turned("a frame turned by 90°", |[x, y]| [y, PX - 1 - x], false).used(&[
            "the frame is turned by 90 degrees clockwise",
            "would not show it",
        ]),
        turned("a mirrored frame", |[x, y]| [PX - 1 - x, y], false)
            .used(&["the frame is mirrored, left for right"]),
        displaced.refused(&["show it about +3.0 pixels to the right and"]),
        broken.used(&["material frame 1: is left out", "cut short"]),
        paths.read_as(sound),
    ]
}

// long: one folder after another, each with what is to be said of it.
fn raw_exposures(sound: &[Sample]) -> Vec<Case> {
    let raws = |folder: &Path, times: &[f64]| write_raws(folder, times, None, None);
    let tiffs = process("16-bit TIFFs as raw exposures", |folder| {
        raws(folder, &[0.5]);
        for path in fs::read_dir(folder)
            .unwrap()
            .map(|item| item.unwrap().path())
        {
            if path.extension().is_some_and(|e| e == "png") {
                let raw = gonia_formats::raw_frame::read_raw(&path, PX, PX)
                    .unwrap()
                    .raw;
                let mut file =
                    tiff::encoder::TiffEncoder::new(File::create(&path).unwrap()).unwrap();
                let side = PX as u32;
                file.write_image::<tiff::encoder::colortype::RGB16>(side, side, &raw.counts)
                    .unwrap();
            }
        }
    });
    expect(tiffs.case.said().is_empty(), tiffs.case.said());
    // Noise of one exposure in patches of three by three pixels.
    let ratios = tiffs.samples.iter().flatten().zip(sound);
    let ratios: Vec<f32> = ratios
        .map(|(a, b)| (a.rgb[1] / b.rgb[1]).natural_log())
        .collect();
    let bias = ratios.iter().sum::<f32>() / ratios.len() as f32;
    expect(bias.abs() < 0.01, &format!("TIFFs: bias {bias}"));
    let srgb = |info: &mut png::Info<'_>| info.srgb = Some(png::SrgbRenderingIntent::Perceptual);
    let gamma = |info: &mut png::Info<'_>| info.source_gamma = Some(png::ScaledFloat::new(0.45455));
    let sixteen = png::BitDepth::Sixteen;
    let screen = process(
        "PNGs that say of themselves that they are sRGB, one exposure",
        |folder| {
            raws(folder, &[0.5]);
            rewrite_pngs(folder, sixteen, wide, srgb);
        },
    );
    let tagged = process(
        "PNGs of linear counts with a gAMA chunk of 0.45455, two exposures",
        |folder| {
            raws(folder, &[0.15, 0.5]);
            rewrite_pngs(folder, sixteen, wide, gamma);
        },
    );
    let curved = process("the same of counts that are encoded", |folder| {
        raws(folder, &[0.15, 0.5]);
        let encode = |c: u16| wide((4095.0 * (f32::from(c) / 4095.0).power(0.45455)) as u16);
        rewrite_pngs(folder, sixteen, encode, gamma);
    });
    let narrow = process("8-bit PNGs of a 12-bit sensor", |folder| {
        raws(folder, &[0.5]);
        rewrite_pngs(
            folder,
            png::BitDepth::Eight,
            |c| vec![(c / 16) as u8],
            |_| {},
        );
    });
    let mosaic = |came_in: &str, told| {
        process(came_in, |folder| {
            write_raws(folder, &[0.5], Some(Bayer::Grbg), told)
        })
    };
    let mixed = process("an RGB and a grey file in one bracket", |folder| {
        raws(folder, &[0.15, 0.5]);
        let path = folder.join("material_2_1.png");
        write_raw(&path, &expose(&FRAMES[2][0], 0.5, Some(Bayer::Rggb))).unwrap();
    });
    let canon = process("a CR2 as a raw exposure", |folder| {
        raws(folder, &[0.5]);
        fs::write(
            folder.join("material_0_0.png"),
            b"II*\0\x10\0\0\0CR\x02\0........",
        )
        .unwrap();
    });
    let dng = process(
        "DNGs of a mosaic, without [sensor] and exposure_s",
        |folder| {
            write_dngs(folder, 64);
            let rig = Rig {
                sensor: None,
                ..rig()
            };
            write_rig(&folder.join("rig.toml"), &rig).unwrap();
        },
    );
    expect(dng.case.said().is_empty(), dng.case.said());
    let ratios = dng.samples.iter().flatten().zip(sound);
    let ratios: Vec<f32> = ratios
        .map(|(a, b)| (a.rgb[1] / b.rgb[1]).natural_log())
        .collect();
    let bias = ratios.iter().sum::<f32>() / ratios.len() as f32;
    expect(bias.abs() < 0.01, &format!("DNGs: bias {bias}"));
    let dark = process("DNGs whose black level is not that of rig.toml", |folder| {
        write_dngs(folder, 512)
    });
    let no_time = process("PNGs without exposure_s", |folder| {
        raws(folder, &[0.5]);
        let list = folder.join("frames.csv");
        let csv = fs::read_to_string(&list).unwrap().replace(",0.5\n", ",\n");
        fs::write(list, csv).unwrap();
    });
    let black = process("`black_counts` 64 too low, one exposure", |folder| {
        raws(folder, &[0.5]);
        let mut rig = rig();
        rig.sensor = Some(Sensor {
            black_counts: 0.0,
            ..sensor(None)
        });
        write_rig(&folder.join("rig.toml"), &rig).unwrap();
    });
    vec![
        tiffs.case,
        screen.refused(&["sRGB chunk says that counts are encoded"]),
        tagged.used(&["gAMA chunk", "taken as linear"]),
        curved.refused(&["the exposures of 0.15 s and 0.5 s disagree"]),
        narrow.refused(&["has 8 bits, at most 255 counts", "saturates at 3900"]),
        mosaic("a mosaic without `bayer`", None)
            .refused(&["as those of a colour mosaic", "here GRBG or GBRG"]),
        mosaic("a mosaic with another `bayer`", Some(Bayer::Rggb))
            .refused(&["calls green differ", "here GRBG or GBRG"]),
        mixed.used(&[
            "material frame 2: is left out",
            "material_2_1.png: is grey, but material_2_0.png",
        ]),
        black.used(&[
            "warning: reference: under the weakest light",
            "check black_counts",
        ]),
        dng.case,
        dark.refused(&["says that it is black at 512 counts, but rig.toml says 64"]),
        canon.used(&[
            "material frame 0: is left out",
            "Canon CR2",
            "convert it to DNG",
            "dcraw",
        ]),
        no_time.refused(&["give its exposure time in the column exposure_s"]),
    ]
}

#[test]
fn frames_are_read_refused_or_doubted_aloud() {
    let sound = sound();
    let mut cases = channels_and_windows(&sound);
    cases.extend(cameras_and_turns(&sound));
    cases.extend(raw_exposures(&sound));
    let wrong = WRONG.lock().unwrap();
    assert!(wrong.is_empty(), "{wrong:#?}");
    document("frames", &cases);
}
