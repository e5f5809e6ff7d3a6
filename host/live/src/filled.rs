//! Which bins a session has filled.

use crate::slice::Slice;
use gonia_brdf::{Direction, Grid, Pose};
use gonia_imaging::{IdealLight, SamplingGrid};
use gonia_pipeline::process::SampledFrame;
use gonia_rig::{CameraModel, Rig};

/// The bins of the paper's grid with a sample in them, and one slice of their values. The values are
/// those under an ideal point light, relative: enough to see that something is wrong, and known
/// before the session is over. A pose that is taken again counts twice in the slice's means.
pub struct SeenBins {
    grid: Grid,
    points_mm: Vec<[f64; 2]>,
    rig: Rig,
    camera: CameraModel,
    /// A bit a cell.
    seen: Vec<u64>,
    bins: usize,
    samples: usize,
    slice: Slice,
}

impl SeenBins {
    /// None yet.
    pub fn new(rig: &Rig, plan: &[Pose]) -> Self {
        let grid = Grid::PAPER;
        Self {
            grid,
            points_mm: SamplingGrid::new(rig).points_mm().to_vec(),
            rig: rig.clone(),
            camera: CameraModel::new(rig),
            seen: vec![0; grid.n_cells().div_ceil(64)],
            bins: 0,
            samples: 0,
            slice: Slice::of_plan(grid, plan),
        }
    }

    /// Takes in a frame of the material. Whether the slice has changed.
    pub fn add(&mut self, frame: &SampledFrame) -> bool {
        let ideal = IdealLight::new(&self.rig, frame.reading.light);
        let camera = frame.camera_at(&self.camera);
        let mut changed = false;
        for (point_mm, value) in self.points_mm.iter().zip(&frame.points) {
            let Ok(value) = value else { continue };
            let at_mm = [0, 1].map(|i| point_mm[i] + f64::from(value.offset_mm[i]));
            let irradiance = ideal.irradiance(at_mm);
            if irradiance <= 0.0 {
                continue;
            }
            let node = |to| {
                let local = Direction::from_vec3(to);
                self.grid.nearest(local.theta_deg(), local.phi_deg())
            };
            let (Some(light), Some(view)) = (
                node(ideal.direction_from(at_mm)),
                node(camera.direction_from(at_mm)),
            ) else {
                continue;
            };
            self.samples += 1;
            let cell = self.grid.cell(light, view);
            let bit = 1 << (cell % 64);
            self.bins += usize::from(self.seen[cell / 64] & bit == 0);
            self.seen[cell / 64] |= bit;
            let relative = value.rgb.map(|v| v / irradiance as f32);
            changed |= self.slice.add(light, view, relative);
        }
        changed
    }

    /// Bins with a sample.
    pub fn bins(&self) -> usize {
        self.bins
    }

    /// Their share of all cells of the grid.
    pub fn share(&self) -> f64 {
        self.bins as f64 / self.grid.n_cells() as f64
    }

    /// Samples in them.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// The slice.
    pub fn slice(&self) -> &Slice {
        &self.slice
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::direction::local_direction;
    use gonia_brdf::{Bins, Sample};
    use gonia_imaging::LeftOut;
    use gonia_pipeline::process::{FrameSampler, Hidden};
    use gonia_rig::{Frame, FrameRow, Role};

    #[test]
    fn the_bins_are_those_that_binning_the_samples_fills() {
        let rig = Rig::paper(100);
        let pose = Pose {
            light: Direction::from_deg(30.0, 40.0),
            view: Direction::from_deg(30.0, 200.0),
        };
        let row = FrameRow {
            frame: 0,
            role: Role::Material,
            pose,
            file: String::new(),
        };
        let frame = Frame {
            width: 100,
            height: 100,
            rgb: vec![[0.5; 3]; 10_000],
        };
        let sampler = FrameSampler::new(&rig);
        let (mut sampled, registration) =
            sampler.sample_registered(&frame, &row, Hidden::Known(None));
        // A grey frame has no marks, and is refused; its points are sampled all the same here.
        let grid = SamplingGrid::new(&rig);
        sampled.points = grid
            .sample(&frame, &registration, None)
            .into_iter()
            .map(|point| {
                point.map(|value| gonia_pipeline::process::SampledPoint {
                    rgb: value.rgb,
                    offset_mm: value.offset_mm,
                })
            })
            .collect();
        sampled.points[7] = Err(LeftOut::Occlusion);
        let mut filled = SeenBins::new(&rig, &[pose]);
        assert!(filled.add(&sampled));

        let samples: Vec<Sample> = grid
            .points_mm()
            .iter()
            .zip(&sampled.points)
            .filter_map(|(at, point)| {
                let offset = point.as_ref().ok()?.offset_mm;
                let at = [0, 1].map(|i| 1e-3 * (at[i] + f64::from(offset[i])));
                let [i, v] = [(pose.light, 1.1), (pose.view, 1.8)]
                    .map(|(arm, m)| Direction::from_vec3(local_direction(arm, m, at)));
                Some(Sample::new(i, v, [1.0; 3]).in_frame(0))
            })
            .collect();
        let bins = Bins::new(Grid::PAPER, &samples);
        assert_eq!(filled.samples(), samples.len());
        assert_eq!(filled.bins(), bins.bins().len());
        assert!(filled.bins() > 100 && filled.slice().filled() > 0.0);
        // The same again fills nothing new.
        let before = filled.bins();
        filled.add(&sampled);
        assert_eq!(filled.bins(), before);
    }
}
