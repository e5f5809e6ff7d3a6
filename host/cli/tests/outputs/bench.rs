//! A folder, what `gonia` says in it, and what its files are made of.

use crate::cases::Case;
use crate::common::{gonia, text};
use gonia_brdf::model::{Brdf, Kurt};
use gonia_brdf::{DenseBrdf, Direction, Grid, Sample};
use gonia_formats::samples::SampleNote;
use gonia_rig::{DenseFile, Scale};
use std::path::{Path, PathBuf};

/// A folder, and the rows of the page that its cases make.
pub struct Bench {
    pub dir: tempfile::TempDir,
    pub cases: Vec<Case>,
}

impl Bench {
    pub fn new() -> Self {
        Self {
            dir: tempfile::tempdir().unwrap(),
            cases: Vec::new(),
        }
    }

    pub fn at(&self, name: &str) -> PathBuf {
        self.dir.path().join(name)
    }

    /// Runs `gonia` in the folder's place and keeps what it says: an exit code, and words of it.
    pub fn case(
        &mut self,
        came_in: &str,
        arguments: &[&str],
        input: &str,
        code: i32,
        words: &[&str],
    ) {
        let arguments: Vec<String> = arguments
            .iter()
            .map(|argument| match argument.strip_prefix('@') {
                Some(name) => text(&self.at(name)).to_owned(),
                None => (*argument).to_owned(),
            })
            .collect();
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        let rows = ["scale ", "factor ", "not measured ", "beyond "];
        let output = gonia(&arguments, input);
        let case = Case::new(came_in, &output, self.dir.path(), &rows);
        assert_eq!(case.code(), code, "{came_in}: {}", case.said());
        for word in words {
            assert!(
                case.said().contains(word),
                "{came_in}: {word}: {}",
                case.said()
            );
        }
        if words.is_empty() {
            assert_eq!(case.said(), "", "{came_in}");
        }
        self.cases.push(case);
    }
}

pub fn dense_of(model: &dyn Brdf, step_deg: f64, scale: Scale) -> DenseFile {
    DenseFile {
        brdf: DenseBrdf::tabulate(Grid::with_step_deg(step_deg).unwrap(), model),
        scale,
        provenance: [].into(),
    }
}

/// Samples of the demo's fabric, every 15°.
pub fn samples() -> Vec<Sample> {
    let fabric = Kurt::two_thread_fabric();
    let around = || {
        let rings = (0..5).flat_map(|ring| (0..12).map(move |k| (15.0 * f64::from(ring), k)));
        rings.map(|(theta, k)| Direction::from_deg(theta, 30.0 * f64::from(k)))
    };
    around()
        .flat_map(|light| around().map(move |view| (light, view)))
        .map(|(light, view)| {
            let f = fabric.eval(light.to_vec3(), view.to_vec3());
            Sample::new(light, view, f.map(|v| v as f32))
        })
        .collect()
}

/// The words of a fill with error bars.
pub fn fill_with_errors<'a>(samples: &'a Path, dense: &'a Path, errors: &'a Path) -> [&'a str; 6] {
    let [samples, dense, errors] = [samples, dense, errors].map(text);
    ["fill", samples, "-o", dense, "--error", errors]
}

pub fn note(scale: Scale) -> SampleNote {
    SampleNote {
        scale: Some(scale),
        provenance: [("made_by".to_owned(), "a test".to_owned())].into(),
    }
}
