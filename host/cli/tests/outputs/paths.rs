//! Where an output may be written.

use crate::bench::Bench;
use crate::exports::exports;
use std::fs;
use std::path::Path;

// long: a list of cases, one after the other
pub fn outputs(bench: &mut Bench) {
    fs::create_dir(bench.at("there")).unwrap();
    fs::write(bench.at("file"), "x").unwrap();
    let fill = |output: &'static str| ["fill", "@silent.npy", "-o", output, "--step", "15"];
    for (output, word) in [
        (
            "@there",
            "there: is a folder; give the name of a file in it",
        ),
        ("@new/", "is a folder"),
        ("@filled.png", "name it .exr"),
        ("@filled.npy", "name it .exr"),
        ("@file/filled.exr", "choose a place inside a folder"),
    ] {
        let came_in = format!("`fill -o {}`", output.trim_start_matches('@'));
        bench.case(&came_in, &fill(output), "", 1, &[word]);
    }
    let twice = [
        "fill",
        "@silent.npy",
        "-o",
        "@x.exr",
        "--error",
        "@there/../x.exr",
        "--step",
        "15",
    ];
    bench.case(
        "`fill -o x.exr --error there/../x.exr`",
        &twice,
        "",
        1,
        &["x.exr: is the output too"],
    );
    let step = ["fill", "@silent.npy", "-o", "@x.exr", "--step", "45"];
    bench.case(
        "`fill --step 45`",
        &step,
        "",
        1,
        &["--step 45: a grid step of 45000"],
    );
    let fit = ["fit", "@a.exr", "--model", "lambert", "-o", "@a.exr"];
    bench.case(
        "`fit a.exr -o a.exr`",
        &fit,
        "",
        1,
        &["a.exr: is an input too"],
    );
    let render = ["render", "@a.exr", "-o", "@a.jpg"];
    bench.case(
        "`render -o a.jpg`",
        &render,
        "",
        1,
        &["a.jpg: ", "end the name in .png"],
    );
    let photo = ["photo", "@a.exr", "@p.png", "-o", "@p.png"];
    fs::write(bench.at("p.png"), "x").unwrap();
    bench.case(
        "`photo a.exr p.png -o p.png`",
        &photo,
        "",
        1,
        &["is an input too"],
    );
    let compare = ["compare", "@a.exr", "@b.exr", "--csv", "@there"];
    bench.case(
        "`compare --csv FOLDER`",
        &compare,
        "",
        1,
        &["there: is a folder"],
    );
    let came_in = "`compare --csv figures.exr`";
    let compare = ["compare", "@a.exr", "@b.exr", "--csv", "@figures.exr"];
    bench.case(came_in, &compare, "", 1, &["end the name in .csv"]);
    if cfg!(unix) {
        let came_in = "`compare --csv /dev/null`";
        let compare = ["compare", "@a.exr", "@b.exr", "--csv", "/dev/null"];
        bench.case(came_in, &compare, "", 1, &["is no ordinary file"]);
    }
    let process = ["process", "@nowhere", "-o", "@samples.txt"];
    bench.case(
        "`process -o samples.txt`",
        &process,
        "",
        1,
        &["name it .npy or .csv"],
    );
    exports(bench);
    promise_gigabytes(&bench.at("a.exr"), &bench.at("huge.exr"));
    let came_in = "a small EXR whose header promises 11.8 GB";
    let said = ["promises 31320 × 31320 pixels"];
    bench.case(came_in, &["compare", "@huge.exr", "@b.exr"], "", 1, &said);
}

/// The file of `dense` with a header that promises the grid of 1°.
fn promise_gigabytes(dense: &Path, path: &Path) {
    let mut bytes = fs::read(dense).unwrap();
    for name in ["dataWindow\0box2i\0", "displayWindow\0box2i\0"] {
        let at = bytes.windows(name.len()).position(|w| w == name.as_bytes());
        let at = at.unwrap() + name.len() + 4;
        let window = [0i32, 0, 31_319, 31_319].map(i32::to_le_bytes);
        bytes[at..at + 16].copy_from_slice(window.as_flattened());
    }
    fs::write(path, bytes).unwrap();
}
