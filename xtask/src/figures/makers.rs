//! The figures of the book, and what makes each.

use super::cost::{Before, Step};
use super::output::Take;

/// A figure: a table between marks of its name, in one page of the book.
pub struct Figure {
    pub name: &'static str,
    /// About how long it takes on two idle cores, without building.
    pub minutes: f64,
    pub steps: &'static [Step],
    pub take: Take,
    /// Files among what is made, and their names beside the pages.
    pub pictures: &'static [(&'static str, &'static str)],
}

const fn figure(name: &'static str, minutes: f64, take: Take, steps: &'static [Step]) -> Figure {
    Figure {
        name,
        minutes,
        steps,
        take,
        pictures: &[],
    }
}

impl Figure {
    const fn with(mut self, pictures: &'static [(&'static str, &'static str)]) -> Self {
        self.pictures = pictures;
        self
    }
}

const fn run(command: &'static str) -> Step {
    let before = Before::Nothing;
    Step { command, before }
}

/// Makes a file that several figures need, where it is not there.
const fn prepare(file: &'static str, command: &'static str) -> Step {
    let before = Before::SkipIf(file);
    Step { command, before }
}

/// Runs in a folder that must be new.
const fn anew(folder: &'static str, command: &'static str) -> Step {
    let before = Before::Remove(folder);
    Step { command, before }
}

const GONIA: Step = run("cargo build --release -p gonia");
const DEMO: Step = prepare("demo/summary.toml", "gonia demo --out {work}/demo");
const QUICK: Step = prepare(
    "quick/frames.csv",
    "gonia demo --quick --keep-frames --out {work}/quick",
);

use Take::{Costs, Csv, Tables, Text, Written};

/// All figures, page by page: accuracy, tables that tests write, benchmarks, operation.
pub const FIGURES: &[Figure] = &[
    figure("demo", 5.0, Text, &[GONIA, anew("demo", "gonia demo --out {work}/demo")]),
    figure("demo-quick", 0.5, Text, &[
        GONIA,
        anew("quick", "gonia demo --quick --keep-frames --out {work}/quick"),
    ]),
    figure("presets", 7.0, Tables, &[
        run("cargo bench -p gonia-brdf --bench fill -- matte fabric sharp sharper preview"),
        run("cargo bench -p gonia-brdf --bench fill -- matte fabric sharp sharper fast"),
        run("cargo bench -p gonia-brdf --bench fill -- matte fabric sharp sharper default"),
        run("cargo bench -p gonia-brdf --bench fill -- matte fabric sharp sharper best"),
    ]),
    figure("materials", 5.0, Tables, &[run(
        "cargo bench -p gonia-brdf --bench fill -- matte broad fabric sharp sharper round ggx ward brushed-metal satin-paint linen silk satin shot-silk retro plastic velvet twill",
    )]),
    figure("noise", 1.0, Tables, &[run(
        "cargo bench -p gonia-brdf --bench fill -- matte fabric sharp --noise 0.2",
    )]),
    figure("few-poses", 5.0, Tables, &[
        run("cargo bench -p gonia-brdf --bench fill -- quick --step 4 matte fabric ggx sharp round brushed-metal ward sharper satin fast"),
        run("cargo bench -p gonia-brdf --bench fill -- quick --step 4 matte fabric ggx sharp round brushed-metal ward sharper satin default"),
        run("cargo bench -p gonia-brdf --bench fill -- tenth --step 4 matte fabric ggx sharp round brushed-metal ward sharper satin fast"),
        run("cargo bench -p gonia-brdf --bench fill -- tenth --step 4 matte fabric ggx sharp round brushed-metal ward sharper satin default"),
    ]),
    figure("coordinates", 6.0, Tables, &[
        run("cargo bench -p gonia-brdf --bench fill -- fabric sharp sharper ggx --exponent 0.1 --kernel 0.3"),
        run("cargo bench -p gonia-brdf --bench fill -- fabric sharp sharper ggx --exponent 0.25 --kernel 0.3"),
        run("cargo bench -p gonia-brdf --bench fill -- fabric sharp sharper ggx --exponent 0.5 --kernel 0.3"),
        run("cargo bench -p gonia-brdf --bench fill -- fabric sharp sharper ggx --exponent 0.25 --kernel 1"),
    ]),
    figure("methods", 5.0, Text, &[
        GONIA,
        DEMO,
        run("gonia chart {work}/demo/samples.npy --truth {work}/demo/truth.exr --only methods --out {work}/chart"),
    ])
    .with(&[("chart/methods.svg", "methods.svg")]),
    figure("methods-sharp", 5.0, Text, &[
        prepare("data/sharp-truth.exr", "cargo run --release -p gonia-pipeline --example analytic -- sharp {work}/data"),
        GONIA,
        run("gonia chart {work}/data/sharp.npy --truth {work}/data/sharp-truth.exr --only methods --tests 1500 --out {work}/chart-sharp"),
    ]),
    figure("methods-satin", 5.0, Text, &[
        prepare("data/satin-truth.exr", "cargo run --release -p gonia-pipeline --example analytic -- satin {work}/data"),
        GONIA,
        run("gonia chart {work}/data/satin.npy --truth {work}/data/satin-truth.exr --only methods --tests 1500 --out {work}/chart-satin"),
    ]),
    figure("methods-matte", 5.0, Text, &[
        prepare("data/matte-truth.exr", "cargo run --release -p gonia-pipeline --example analytic -- matte {work}/data"),
        GONIA,
        run("gonia chart {work}/data/matte.npy --truth {work}/data/matte-truth.exr --only methods --tests 1500 --out {work}/chart-matte"),
    ]),
    figure("images", 4.0, Text, &[
        GONIA,
        DEMO,
        run("gonia chart {work}/demo/samples.npy --truth {work}/demo/truth.exr --only images --out {work}/chart"),
    ])
    .with(&[("chart/images.svg", "images.svg")]),
    figure("symmetry", 9.0, Tables, &[run("cargo bench -p gonia --bench symmetry -- --out {work}")]),
    figure("scipy", 6.0, Tables, &[
        prepare("python/pyvenv.cfg", "python3 -m venv {work}/python"),
        run("{work}/python/bin/pip install --quiet -r bench/baselines/requirements.txt"),
        prepare("data/sharp-truth.exr", "cargo run --release -p gonia-pipeline --example analytic -- sharp {work}/data"),
        prepare("data/fabric-truth.exr", "cargo run --release -p gonia-pipeline --example analytic -- fabric {work}/data"),
        prepare("data/matte-truth.exr", "cargo run --release -p gonia-pipeline --example analytic -- matte {work}/data"),
        prepare("data/satin-truth.exr", "cargo run --release -p gonia-pipeline --example analytic -- satin {work}/data"),
        GONIA,
        run("gonia fill {work}/data/sharp.npy -o {work}/data/sharp.exr --scale absolute"),
        run("gonia fill {work}/data/fabric.npy -o {work}/data/fabric.exr --scale absolute"),
        run("gonia fill {work}/data/matte.npy -o {work}/data/matte.exr --scale absolute"),
        run("gonia fill {work}/data/satin.npy -o {work}/data/satin.exr --scale absolute"),
        run("{work}/python/bin/python bench/baselines/baselines.py {work}/data/sharp.npy --truth {work}/data/sharp-truth.exr --gonia target/release/gonia --dense default={work}/data/sharp.exr"),
        run("{work}/python/bin/python bench/baselines/baselines.py {work}/data/fabric.npy --truth {work}/data/fabric-truth.exr --gonia target/release/gonia --dense default={work}/data/fabric.exr"),
        run("{work}/python/bin/python bench/baselines/baselines.py {work}/data/matte.npy --truth {work}/data/matte-truth.exr --gonia target/release/gonia --dense default={work}/data/matte.exr"),
        run("{work}/python/bin/python bench/baselines/baselines.py {work}/data/satin.npy --truth {work}/data/satin-truth.exr --gonia target/release/gonia --dense default={work}/data/satin.exr"),
    ]),
    figure("baselines", 8.0, Text, &[GONIA, DEMO, run("gonia rivals {work}/demo")])
        .with(&[("demo/rivals.svg", "rivals.svg")]),
    figure("error-bars", 4.0, Tables, &[run("cargo bench -p gonia-brdf --bench error_bars")]),
    figure("error-bars-few", 2.0, Tables, &[run(
        "cargo bench -p gonia-brdf --bench error_bars -- --sparse",
    )]),
    figure("fit", 4.0, Tables, &[run(
        "cargo test --release -p gonia-brdf --test fit -- --ignored --nocapture parameters_come_back",
    )]),
    figure("fit-demo", 0.3, Text, &[
        GONIA,
        DEMO,
        run("gonia fit {work}/demo/dense.exr --model kurt2"),
    ]),
    figure("fit-samples", 0.2, Text, &[
        GONIA,
        QUICK,
        run("gonia fit {work}/quick/dense.exr --samples {work}/quick/samples.npy --model kurt2"),
    ]),
    figure("samples", 1.0, Tables, &[run(
        "cargo bench -p gonia --bench accuracy -- map --out {work}",
    )])
    .with(&[("accuracy.svg", "accuracy.svg")]),
    figure("patch", 3.0, Tables, &[run(
        "cargo bench -p gonia --bench accuracy -- cost --out {work}",
    )])
    .with(&[("accuracy_cost.svg", "accuracy_cost.svg")]),
    figure("calibration", 10.0, Tables, &[run(
        "cargo bench -p gonia --bench calibration -- --out {work}",
    )])
    .with(&[("calibration.svg", "calibration.svg")]),
    figure("calibration-fails", 2.0, Tables, &[run(
        "cargo test --release -p gonia-pipeline --test calibration where -- --ignored --nocapture",
    )]),
    figure("hough", 1.0, Tables, &[run("cargo bench -p gonia --bench accuracy -- hough")]),
    figure("photograph", 0.1, Text, &[run(
        "cargo test --release -p gonia-imaging --lib -- --nocapture lines_in_a_photograph",
    )]),
    figure(
        "stability",
        0.5,
        Written,
        &[run("GONIA_UPDATE_DOCS=1 cargo test --release -p gonia-tests --test interpolation_stability")],
    ),
    figure(
        "defective-frames",
        0.5,
        Written,
        &[run("GONIA_UPDATE_DOCS=1 cargo test --release -p gonia-pipeline --test defective_frames")],
    ),
    figure(
        "faults",
        0.2,
        Written,
        &[run("GONIA_UPDATE_DOCS=1 cargo test --release -p gonia-tests --test controllers_fault_table")],
    ),
    figure("fill", 3.0, Costs, &[
        GONIA,
        DEMO,
        run("gonia fill {work}/demo/samples.npy -o {work}/dense.exr --preset preview"),
        run("gonia fill {work}/demo/samples.npy -o {work}/dense.exr --preset fast"),
        run("gonia fill {work}/demo/samples.npy -o {work}/dense.exr --preset default"),
        run("gonia fill {work}/demo/samples.npy -o {work}/dense.exr --preset best"),
        run("gonia fill {work}/demo/samples.npy -o {work}/dense.exr --error {work}/error.exr"),
        run("gonia fill {work}/demo/samples.npy -o {work}/dense.exr --step 4"),
    ]),
    figure("fill-fine", 4.0, Costs, &[
        GONIA,
        DEMO,
        run("gonia fill {work}/demo/samples.npy -o {work}/one.exr --step 1"),
    ]),
    figure("growth", 3.0, Tables, &[run("cargo bench -p gonia-brdf --bench growth")]),
    figure("growth-few", 3.0, Tables, &[run("cargo bench -p gonia-brdf --bench growth -- --few")]),
    figure("channels", 2.0, Tables, &[
        run("cargo bench -p gonia-brdf --bench channels -- fabric preview"),
        run("cargo bench -p gonia-brdf --bench channels -- fabric fast"),
        run("cargo bench -p gonia-brdf --bench channels -- fabric default"),
        run("cargo bench -p gonia-brdf --bench channels -- fabric best"),
    ]),
    figure("channels-few", 1.0, Tables, &[
        run("cargo bench -p gonia-brdf --bench channels -- fabric few 1000 10000 100000"),
    ]),
    figure("target-error", 1.0, Tables, &[
        run("cargo bench -p gonia-brdf --bench fill -- sharp --poses 2000 --step 4 --noise 0.002 --target-error 0"),
        run("cargo bench -p gonia-brdf --bench fill -- sharp --poses 2000 --step 4 --noise 0.002 --target-error 0.005"),
        run("cargo bench -p gonia-brdf --bench fill -- sharp --poses 2000 --step 4 --noise 0.002 --target-error 0.01"),
        run("cargo bench -p gonia-brdf --bench fill -- sharp --poses 2000 --step 4 --noise 0.002 --target-error 0.02"),
    ]),
    figure("binning", 0.4, Tables, &[run("cargo bench -p gonia-brdf --bench bins")]),
    figure("block", 0.1, Tables, &[run("cargo bench -p gonia-brdf --bench block")]),
    figure("frames", 1.0, Tables, &[run("cargo bench -p gonia --bench frames")]),
    figure("commands", 0.5, Costs, &[
        GONIA,
        QUICK,
        run("gonia process {work}/quick -o {work}/samples.npy"),
        run("gonia fill {work}/quick/samples.npy -o {work}/dense.exr --step 4 --preset preview"),
        run("gonia fill {work}/quick/samples.npy -o {work}/dense.exr --step 4 --preset fast"),
        run("gonia fill {work}/quick/samples.npy -o {work}/dense.exr --step 4 --preset default"),
        run("gonia fill {work}/quick/samples.npy -o {work}/dense.exr --step 4 --preset best"),
        run("gonia compare {work}/quick/dense.exr {work}/quick/truth.exr"),
        run("gonia render {work}/quick/dense.exr -o {work}/sky.png --light sky"),
        run("gonia report {work}/quick"),
    ]),
    figure("render", 0.5, Costs, &[
        GONIA,
        DEMO,
        run("gonia render {work}/demo/dense.exr -o {work}/sky.png --light sky"),
        run("gonia render {work}/demo/dense.exr -o {work}/cylinder.png --light sky --shape cylinder"),
        run("gonia render {work}/demo/dense.exr -o {work}/above.png --light above"),
        run("gonia compare {work}/demo/dense.exr {work}/demo/truth.exr"),
    ]),
    figure("adaptive", 15.0, Tables, &[run(
        "cargo bench -p gonia --bench adaptive -- --out {work}",
    )])
    .with(&[("adaptive.svg", "adaptive.svg")]),
    figure("exports", 0.5, Tables, &[
        QUICK,
        run("cargo bench -p gonia --bench exports -- {work}/quick/dense.exr"),
    ]),
    figure("plan", 0.1, Text, &[
        GONIA,
        QUICK,
        run("gonia plan {work}/quick/rig.toml -o {work}/plan.csv"),
    ]),
    figure("session", 1.0, Costs, &[
        GONIA,
        QUICK,
        anew("session", "gonia capture {work}/session --rig {work}/quick/rig.toml --plan {work}/quick/plan.csv --simulated"),
        anew("served", "gonia capture {work}/served --rig {work}/quick/rig.toml --plan {work}/quick/plan.csv --simulated --serve 127.0.0.1:0"),
    ]),
    figure("kills", 2.0, Text, &[run(
        "cargo test --release -p gonia --test capture -- --ignored --nocapture sessions_survive",
    )]),
    figure("outlive", 1.5, Text, &[run(
        "cargo test --release -p gonia --test capture -- --ignored --nocapture controllers_that",
    )]),
    figure("gige", 1.0, Text, &[run(
        "cargo test --release -p gonia --features genicam --test genicam -- --nocapture --test-threads 1",
    )]),
    figure("jerk", 5.0, Csv("motion/jerk.csv"), &[
        GONIA,
        prepare("motion/jerk.csv", "gonia chart --motion --out {work}/motion"),
    ]),
    figure("motion", 5.0, Csv("motion/motion.csv"), &[
        GONIA,
        prepare("motion/jerk.csv", "gonia chart --motion --out {work}/motion"),
    ]),
    figure("arms", 5.0, Csv("motion/arms.csv"), &[
        GONIA,
        prepare("motion/jerk.csv", "gonia chart --motion --out {work}/motion"),
    ]),
    figure("pointing", 0.7, Text, &[run(
        "cargo test --release -p gonia-tests --test controllers_session -- --ignored --nocapture",
    )]),
    figure("fault-days", 3.0, Tables, &[run(
        "cargo test --release -p gonia-tests --test controllers_fault_plans -- --ignored --nocapture",
    )]),
    figure("shifts", 1.0, Tables, &[run(
        "cargo test --release -p gonia-tests --test controllers_shifts -- --ignored --nocapture",
    )]),
    figure("soak", 3.0, Text, &[run(
        "cargo test --release -p gonia-tests --test controllers_soak -- --ignored --nocapture",
    )]),
    figure("qemu", 1.5, Text, &[
        run("cargo xtask boards"),
        run("GONIA_QEMU_ELF={root}/firmware/boards/qemu-mps2/target/thumbv7em-none-eabihf/release/gonia-qemu-mps2 cargo test --release -p gonia-tests --test controllers_qemu -- --ignored --nocapture"),
    ]),
    figure("size", 0.1, Text, &[run("cargo xtask size")]),
];
