//! Frames, looked at one by one.

use crate::calibrate::error::CalibrateError;
use crate::calibrate::lines::LineFrame;
use crate::process::{FrameRow, FrameSource, load};
use crate::progress::Cancelled;
use gonia_imaging::{Registrar, Search};
use gonia_rig::Rig;
use rayon::prelude::*;
use std::ops::ControlFlow;
use std::sync::atomic::{AtomicUsize, Ordering};

/// Looks at frames one by one, in parallel, and says how many are done.
pub struct Look<'a> {
    rig: &'a Rig,
    source: &'a dyn FrameSource,
    total: usize,
    done: AtomicUsize,
    tell: &'a gonia_brdf::progress::Progress<'a>,
}

/// What became of each frame, in order; an error where it cannot be read.
pub type Looked<T> = Vec<Result<T, crate::process::ProcessError>>;

impl<'a> Look<'a> {
    /// For `total` looks.
    pub fn new(
        rig: &'a Rig,
        source: &'a dyn FrameSource,
        total: usize,
        tell: &'a gonia_brdf::progress::Progress<'a>,
    ) -> Self {
        Self {
            rig,
            source,
            total,
            done: AtomicUsize::new(0),
            tell,
        }
    }

    /// Looks at frames.
    pub fn each<T: Send>(
        &self,
        rows: &[FrameRow],
        work: impl Fn(&FrameRow, &gonia_rig::Frame) -> T + Sync,
    ) -> Result<Looked<T>, CalibrateError> {
        let one = |row: &FrameRow| {
            let done = 1 + self.done.fetch_add(1, Ordering::Relaxed);
            if (self.tell)((done as f64 / self.total as f64).min(1.0)) == ControlFlow::Break(()) {
                return Err(Cancelled);
            }
            Ok(load(self.rig, self.source, row).map(|(frame, _)| work(row, &frame)))
        };
        let all: Vec<Result<_, Cancelled>> = rows.par_iter().map(one).collect();
        let mut looked = Vec::with_capacity(rows.len());
        for frame in all {
            match frame? {
                Err(error) if error.is_of_the_system() => {
                    return Err(CalibrateError::Frames(error));
                }
                frame => looked.push(frame),
            }
        }
        Ok(looked)
    }

    /// Lines of frames, those without any left out.
    pub fn lines(
        &self,
        rig: &Rig,
        rows: &[FrameRow],
        searches: &[Search],
    ) -> Result<Vec<LineFrame>, CalibrateError> {
        let registrar = Registrar::new(rig);
        let looked = self.each(rows, |row, frame| {
            let found = searches
                .iter()
                .map(|search| registrar.line_points(frame, row.pose, *search))
                .find(|points| !points.is_empty());
            found.map(|points| LineFrame {
                row: row.clone(),
                points,
            })
        })?;
        Ok(looked.into_iter().flatten().flatten().collect())
    }
}
