//! The report in a real browser: it opens without an error, and its sliders change its pictures.
//!
//! `cargo xtask test` runs this where Chromium is or can be had; `GONIA_BROWSER` names the program.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use gonia_brdf::model::Kurt;
use gonia_brdf::{DenseBrdf, Grid};
use gonia_formats::Summary;
use gonia_report::{ReportInput, write_report};
use gonia_rig::Scale;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// What a person would try, and whether it did anything, written into the page itself.
const PROBE: &str = r#"<script>
addEventListener("load", () => {
  const picture = id => document.getElementById(id).toDataURL();
  const move = (id, value, kind = "input") => {
    const control = document.getElementById(id);
    control.value = value;
    control.dispatchEvent(new Event(kind));
  };
  const ready = document.getElementById("explorer").classList.contains("ready");
  const steps = [
    ["slice", "rest-a", 0.2], ["slice", "rest-b", 0.1], ["slice", "slice-exposure", 2],
    ["slice", "axis-x", 0, "change"], ["ball", "light-azimuth", 60], ["ball", "light-height", -20],
    ["ball", "material-turn", 90], ["ball", "ball-exposure", 1]];
  const said = [ready];
  const next = () => {
    const step = steps.shift();
    if (!step) { document.documentElement.dataset.probe = said.join(); return; }
    const before = picture(step[0]);
    move(step[1], step[2], step[3]);
    requestAnimationFrame(() => requestAnimationFrame(() => {
      said.push(picture(step[0]) !== before);
      next();
    }));
  };
  next();
});
</script>"#;

/// Notes the first error; must come before everything else.
const WATCH: &str = r#"<script>
addEventListener("error", event => { document.documentElement.dataset.failed = event.message; });
</script>"#;

/// How long the page has, by the machine's clock.
const PATIENCE: Duration = Duration::from_secs(120);

/// The page after its scripts ran, for so long by the browser's clock.
fn opened(page: &Path, budget_ms: u32) -> String {
    let profile = tempfile::tempdir().unwrap();
    let browser = std::env::var("GONIA_BROWSER").unwrap_or_else(|_| "chromium".into());
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
            "--disable-component-update",
            "--disable-sync",
            "--dump-dom",
        ])
        .arg(format!("--virtual-time-budget={budget_ms}"))
        .arg(format!("--user-data-dir={}", profile.path().display()))
        .arg(format!("file://{}", page.display()))
        .stderr(Stdio::null())
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", output.status);
    String::from_utf8(output.stdout).unwrap()
}

#[test]
#[ignore = "needs a browser; cargo xtask test runs it"]
fn the_report_opens_without_an_error_and_every_slider_changes_its_picture() {
    let grid = Grid::with_step_deg(10.0).unwrap();
    let dense = DenseBrdf::tabulate(grid, &Kurt::two_thread_fabric());
    let summary = Summary::new("A fabric", Scale::Absolute);
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("report.html");
    write_report(&path, &ReportInput::new(&summary, &dense)).unwrap();
    let page = std::fs::read_to_string(&path).unwrap();
    let page = page.replacen("<head>", &format!("<head>{WATCH}"), 1);
    let page = page.replacen("</body>", &format!("{PROBE}</body>"), 1);
    std::fs::write(&path, page).unwrap();

    // On a busy machine the browser's clock, which is a virtual one, can run out before it has drawn
    // a frame: then the page says nothing yet, and has more of that time.
    let began = Instant::now();
    let root = (1..)
        .take_while(|_| began.elapsed() < PATIENCE)
        .map(|k| {
            let shown = opened(&path, 20_000 * k);
            shown[shown.find("<html").unwrap()..][..200].to_owned()
        })
        .find(|root| root.contains("data-failed") || root.contains("data-probe"))
        .expect("the page says in two minutes what its controls did");
    assert!(!root.contains("data-failed"), "{root}");
    assert!(
        root.contains("data-probe=\"true,true,true,true,true,true,true,true,true\""),
        "{root}"
    );
}
