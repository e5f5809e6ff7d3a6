//! From the file to the samples, for every kind of EXR.

use crate::clock::{mean, median_ms};
use crate::{POSES, dearest, pose, render};
use exr::prelude::{
    AnyChannel, AnyChannels, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes,
    WritableImage, f16,
};
use gonia_formats::frame_exr::{SpareFrame, read_frame_of_size, read_frame_rows};
use gonia_imaging::{Registrar, SamplingGrid};
use gonia_rig::{Frame, Rig};
use gonia_sim::scene::Surface;
use std::path::Path;

/// Every compression that is written here; of what is lost by the last four only their speed counts.
const KINDS: [(&str, Compression); 9] = [
    ("none", Compression::Uncompressed),
    ("RLE", Compression::RLE),
    ("ZIP, 1 row", Compression::ZIP1),
    ("ZIP, 16 rows", Compression::ZIP16),
    ("PIZ", Compression::PIZ),
    ("PXR24", Compression::PXR24),
    ("B44", Compression::B44),
    ("DWAA", Compression::DWAA(None)),
    ("DWAB", Compression::DWAB(None)),
];

/// Poses by their number, seen from above, from 45 and from 75 degrees: writing takes longest.
const SEEN: [usize; 3] = [0, 3, 6];

/// Prints the table for frames of `px` × `px`.
pub fn print(px: usize) {
    // One thread, so that its CPU time is all there is.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("a thread can be had").install(|| table(px));
}

fn table(px: usize) {
    println!();
    println!("| kind | MB | all rows: read | needed rows: share | read | file to samples |");
    println!("|---|---|---|---|---|---|");
    let rig = Rig::paper(px);
    let (registrar, grid) = (Registrar::new(&rig), SamplingGrid::new(&rig));
    let shots = SEEN.map(|shot| {
        let pose = pose(POSES[shot]);
        (pose, render(px, Surface::Material, pose, shot as u64))
    });
    let file = std::env::temp_dir().join(format!("gonia-bench-kind-{}.exr", std::process::id()));
    for half in [true, false] {
        for (name, compression) in KINDS {
            let (mut whole, mut read, mut all) = (Vec::new(), Vec::new(), Vec::new());
            let (mut share, mut megabytes) = (Vec::new(), Vec::new());
            for (pose, frame) in &shots {
                let pose = *pose;
                write(&file, frame, half, compression);
                megabytes.push(std::fs::metadata(&file).expect("it is there").len() as f64 * 1e-6);
                let rows = registrar.rows(pose.view);
                share.push(rows.len() as f64 / px as f64);
                whole.push(median_ms(|| {
                    read_frame_of_size(&file, px, px).expect("the frame is read")
                }));
                let mut spare = SpareFrame::default();
                let mut some = |use_it: &dyn Fn(&Frame)| {
                    let read = read_frame_rows(&file, [px, px], rows.clone(), &mut spare);
                    let frame = read.expect("it is read");
                    use_it(&frame);
                    spare.keep(frame, &rows);
                };
                read.push(median_ms(|| some(&|_| ())));
                all.push(median_ms(|| {
                    some(&|frame| {
                        let found = registrar.register_rows(frame, pose, &rows);
                        found.map(|registration| grid.sample(frame, &registration, None).len());
                    });
                }));
            }
            println!(
                "| {}, {name} | {:.0} | {:.0} ({:.0}) | {:.2} ({:.2}) | {:.0} ({:.0}) | {:.0} ({:.0}) |",
                if half { "half" } else { "float" },
                mean(&megabytes),
                mean(&whole),
                dearest(&whole),
                mean(&share),
                dearest(&share),
                mean(&read),
                dearest(&read),
                mean(&all),
                dearest(&all),
            );
        }
    }
    std::fs::remove_file(&file).expect("the frame is removed");
}

fn write(file: &Path, frame: &Frame, half: bool, compression: Compression) {
    let channels = ["R", "G", "B"].into_iter().enumerate().map(|(c, name)| {
        let values = frame.rgb.iter().map(|pixel| pixel[c]);
        let samples = if half {
            FlatSamples::F16(values.map(f16::from_f32).collect())
        } else {
            FlatSamples::F32(values.collect())
        };
        AnyChannel::new(name, samples)
    });
    let layer = Layer::new(
        (frame.width, frame.height),
        LayerAttributes::default(),
        Encoding {
            compression,
            ..Encoding::UNCOMPRESSED
        },
        AnyChannels::sort(channels.collect()),
    );
    Image::from_layer(layer)
        .write()
        .to_file(file)
        .expect("the frame is written");
}
