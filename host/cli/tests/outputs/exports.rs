//! Other programs' files, in and out.

use crate::bench::Bench;
use gonia_formats::dense::read_dense;
use gonia_rig::Scale;
use std::fs;

pub fn imports(bench: &mut Bench) {
    // UTIA: 3 × 288² floats.
    let value = |k: usize| if k % 1000 == 7 { -0.01f32 } else { 0.2 };
    let bytes: Vec<u8> = (0..3 * 288 * 288)
        .flat_map(|k| value(k).to_le_bytes())
        .collect();
    fs::write(bench.at("m.bin"), bytes).unwrap();
    let import = |name: &'static str, more: &[&'static str]| {
        let fixed = ["-o", "@m.exr", "--step", "30"];
        [&["import", name], &fixed[..], more].concat()
    };
    let said = [
        "scale relative: a UTIA .bin does not say it",
        "249 of the file's 248,832",
    ];
    bench.case("a UTIA .bin", &import("@m.bin", &[]), "", 0, &said);
    assert_eq!(
        read_dense(&bench.at("m.exr")).unwrap().scale,
        Scale::Relative
    );
    let absolute = import("@m.bin", &["--scale", "absolute"]);
    bench.case(
        "the same, with --scale absolute",
        &absolute,
        "",
        0,
        &["absolute, by --scale"],
    );
    assert_eq!(
        read_dense(&bench.at("m.exr")).unwrap().scale,
        Scale::Absolute
    );
    // MERL: a third of it was not measured, where θd is large.
    let mut bytes = [90i32, 90, 180]
        .map(i32::to_le_bytes)
        .as_flattened()
        .to_vec();
    for k in 0..3 * 90 * 90 * 180 {
        let value: f64 = if k / 180 % 90 >= 60 { -1.0 } else { 300.0 };
        bytes.extend(value.to_le_bytes());
    }
    fs::write(bench.at("m.binary"), &bytes).unwrap();
    let said = [
        "scale absolute, as the format is",
        "486,000 of the file's 1,458,000 values",
    ];
    bench.case(
        "a MERL .binary with holes (−1)",
        &import("@m.binary", &[]),
        "",
        0,
        &said,
    );
    let file = read_dense(&bench.at("m.exr")).unwrap();
    let [red, ..] = file.brdf.planes();
    assert!(red.iter().all(|v| (v - 0.2).abs() < 1e-6), "no hole is 0");
    assert!(file.provenance["not_measured"].contains("cells of the grid"));
    let relative = import("@m.binary", &["--scale", "relative"]);
    bench.case(
        "the same, with --scale relative",
        &relative,
        "",
        1,
        &["MERL .binary are absolute"],
    );
    fs::write(bench.at("cut.binary"), &bytes[..5000]).unwrap();
    bench.case(
        "a MERL .binary cut short",
        &import("@cut.binary", &[]),
        "",
        1,
        &["5000 bytes"],
    );
}

// long: a list of cases, one after the other
pub fn exports(bench: &mut Bench) {
    for (came_in, output, more, code, word) in [
        (
            "`export -o a.bsdf` of a relative BRDF",
            "@a.bsdf",
            &[][..],
            1,
            "give the factor that makes it so",
        ),
        (
            "the same with `--assume-scale 0`",
            "@a.bsdf",
            &["--assume-scale", "0"],
            1,
            "give a factor above 0",
        ),
        (
            "the same with `--assume-scale 2`, of a grid of 30 degrees",
            "@a.bsdf",
            &["--assume-scale", "2"],
            1,
            "or say that it is meant (--allow-coarse)",
        ),
        (
            "the same with `--allow-coarse`",
            "@a.bsdf",
            &["--assume-scale", "2", "--allow-coarse"],
            0,
            "is the table's last",
        ),
        (
            "`export -o a.zmx`",
            "@a.zmx",
            &[],
            1,
            "give --format rgl (RGL .bsdf, .bsdf)",
        ),
        (
            "`export -o a.xml --format klem`",
            "@a.xml",
            &["--format", "klem"],
            1,
            "there is no such format; give --format rgl",
        ),
        (
            "`export -o a.xml --error ERR.exr`",
            "@a.xml",
            &["--assume-scale", "2", "--error", "@a.exr"],
            1,
            "has no place for uncertainties",
        ),
        (
            "`export -o a.nc` of a relative BRDF",
            "@a.nc",
            &[],
            0,
            "nothing (60 degrees is the table's last)",
        ),
        (
            "`export -o a.nc --format zarr` over a file",
            "@a.nc",
            &["--format", "zarr"],
            1,
            "remove it or choose another name",
        ),
        (
            "`export --resolution 4`",
            "@a.bsdf",
            &["--resolution", "4"],
            1,
            "give 8 to 128",
        ),
    ] {
        let arguments = [&["export", "@a.exr", "-o", output], more].concat();
        bench.case(came_in, &arguments, "", code, &[word]);
    }
    for (came_in, arguments, code, word) in [
        (
            "`export SAMPLES -o a.bsdf`",
            &["export", "@silent.npy", "-o", "@b.bsdf"][..],
            1,
            "does not hold samples; name it .json (BiRD)",
        ),
        (
            "`export SAMPLES -o a.json --error ERR.exr`",
            &[
                "export",
                "@silent.npy",
                "-o",
                "@b.json",
                "--error",
                "@a.exr",
            ],
            1,
            "--error: goes with a dense BRDF",
        ),
        (
            "`export DENSE.exr --dense DENSE.exr`",
            &["export", "@a.exr", "-o", "@b.json", "--dense", "@a.exr"],
            1,
            "goes with samples, and",
        ),
        (
            "`export SAMPLES -o a.json` of relative samples",
            &["export", "@silent.npy", "-o", "@b.json"],
            1,
            "give the factor that makes it so",
        ),
        (
            "the same with `--assume-scale 2`",
            &[
                "export",
                "@silent.npy",
                "-o",
                "@b.json",
                "--assume-scale",
                "2",
            ],
            0,
            "says nothing of their rig",
        ),
    ] {
        bench.case(came_in, arguments, "", code, &[word]);
    }
}
