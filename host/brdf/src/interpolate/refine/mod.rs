//! The cells of a pair of patches: one coarse block, refined where it is not enough.
//!
//! The coarse block goes through merged data. Where its values change most, its own variance is
//! looked at; if that is more than noise explains, one fine block is fitted there through the bins' own
//! data. By how much the two differ there says what the coarse block may be off by in the other parts: in
//! proportion to the root of their share in that change. Parts in which this exceeds the tolerance get a
//! block of their own, the others keep the coarse one, and all are blended.

mod deviation;
mod parts;
mod places;
mod predict;

pub use predict::{Predicted, part_of};

use super::FillSettings;
use super::blend::Shifts;
use super::block::Block;
use super::block::kernel::{AnyKernel, NewBlock};
use super::coordinates::Point;
use super::datum::Datum;
use super::from_corners::{FromCorners, weights_of};
use super::hierarchy::{Detail, Found, Neighbours, keep_nearest};
use super::patches::Patch;
use crate::direction::Vec3;
use places::{write_corners, write_places};

/// What a thread keeps from pair to pair: blocks, and room to work in.
pub struct Refiner<const N: usize = 3> {
    /// The block of the pair, and the one of a part.
    coarse: Box<dyn Block<N>>,
    fine: Box<dyn Block<N>>,
    /// Where the fine block was fitted since the coarse one was.
    fine_at: Option<(Vec3, Vec3)>,
    /// The fine block that the coarse one was compared with, and where it was fitted: should the pair be
    /// refined, it serves again.
    compared: Box<dyn Block<N>>,
    compared_at: Option<(Vec3, Vec3)>,
    /// By how many standard deviations of a sample the coarse block may be off in each pair of parts; none
    /// where its variance is below the limit.
    deviations: Vec<f32>,
    /// Whether any part of the pair that predictions are made in has a block of its own.
    refines: bool,
    /// Merged data whose bins are looked at.
    near: Vec<Found>,
    found: Vec<Found>,
    neighbourhood: Vec<Datum<N>>,
    places: Vec<Point>,
    /// Logarithms of the pair's cells, light by light, and their variances.
    logs: Vec<[f32; N]>,
    variances: Vec<[f32; N]>,
    /// Logarithms at the pair's corners, corner by corner of the first patch.
    corners: Vec<[f32; N]>,
    /// What the coarse block gives there, where parts may give something else.
    coarse_corners: Vec<[f32; N]>,
    part: PartBuffers<N>,
    from_corners: FromCorners<N>,
}

/// Room for the parts of a pair.
#[derive(Default)]
struct PartBuffers<const N: usize> {
    /// Logarithms of the cells of one part, and their variances.
    logs: Vec<[f32; N]>,
    variances: Vec<[f32; N]>,
    /// Logarithms at the corners of all parts, one part after the other.
    corners: Vec<[f32; N]>,
    /// How many parts a corner of the pair is in.
    count_at: Vec<u32>,
    /// What the parts differ from each other by, at their corners.
    differences: Vec<f32>,
    shifts: Shifts<N>,
}

/// The logarithms of a pair of patches.
#[derive(Clone, Copy, Debug)]
pub struct Solved<'a, const N: usize = 3> {
    /// At the pair's corners, corner by corner of the first patch.
    pub corners: &'a [[f32; N]],
    /// Whether the cells follow from the corners.
    pub is_smooth: bool,
    /// Of the cells, light by light; none where they follow from the corners, unless variances are wanted.
    pub cells: &'a [[f32; N]],
    /// Variances of the cells' logarithms, not calibrated; none unless they are wanted.
    pub variances: &'a [[f32; N]],
    /// Pairs of parts that got a block of their own; `None` where the coarse block does for all.
    pub refined: Option<usize>,
}

impl<const N: usize> Refiner<N> {
    /// One for settings like these.
    pub fn new(settings: &FillSettings) -> Self
    where
        dyn AnyKernel: NewBlock<N>,
    {
        Self {
            coarse: NewBlock::<N>::new_block(settings.kernel),
            fine: NewBlock::<N>::new_block(settings.kernel),
            fine_at: None,
            compared: NewBlock::<N>::new_block(settings.kernel),
            compared_at: None,
            deviations: Vec::new(),
            refines: false,
            near: Vec::new(),
            found: Vec::new(),
            neighbourhood: Vec::new(),
            places: Vec::new(),
            logs: Vec::new(),
            variances: Vec::new(),
            corners: Vec::new(),
            coarse_corners: Vec::new(),
            part: PartBuffers::default(),
            from_corners: FromCorners::default(),
        }
    }

    /// Interpolates the cells of a pair.
    pub fn solve(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        pair: (&Patch, &Patch),
        with_variances: bool,
    ) -> Solved<'_, N> {
        self.fit_coarse(data, settings, pair);
        let needs_refinement = self.needs_refinement(data, settings, pair);
        self.logs.clear();
        self.variances.clear();
        if needs_refinement {
            let refined = self.solve_parts(data, settings, pair, with_variances);
            return self.solved(false, Some(refined));
        }
        let is_smooth = self.follows_from_corners(settings, pair);
        match weights_of(pair.0, pair.1) {
            Some(weights) if is_smooth && with_variances => {
                let cells = (pair.0.directions.len(), pair.1.directions.len());
                self.from_corners.write(weights, cells, &mut self.logs);
            }
            _ if is_smooth => {}
            _ => {
                write_places(settings, pair, &mut self.places);
                self.coarse.evaluate(&self.places, &mut self.logs);
            }
        }
        if with_variances {
            write_places(settings, pair, &mut self.places);
            self.coarse.variances_at(&self.places, &mut self.variances);
        }
        self.solved(is_smooth, None)
    }

    fn solved(&self, is_smooth: bool, refined: Option<usize>) -> Solved<'_, N> {
        Solved {
            corners: &self.corners,
            is_smooth,
            cells: &self.logs,
            variances: &self.variances,
            refined,
        }
    }

    /// A coarse block, through merged data, and what it gives at the corners.
    fn fit_coarse(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        (p, q): (&Patch, &Patch),
    ) {
        let centre = settings.coordinates.point(p.centre, q.centre);
        let neighbours = settings.coarse_neighbours();
        data.around(&centre, neighbours, &mut self.found);
        (self.fine_at, self.compared_at) = (None, None);
        let radius = keep_nearest(&mut self.found, neighbours);
        self.gather(data, Detail::Merged);
        self.coarse
            .fit(&self.neighbourhood, centre, radius, &settings.block());
        write_corners(settings, (p, q), &mut self.places);
        self.corners.clear();
        self.coarse.evaluate(&self.places, &mut self.corners);
    }

    /// Makes the fine block that around a pair of directions, unless it is or the coarse one was compared with it.
    fn make_fine(&mut self, data: &impl Neighbours<N>, settings: &FillSettings, at: (Vec3, Vec3)) {
        if self.fine_at == Some(at) {
            return;
        }
        if self.compared_at == Some(at) {
            std::mem::swap(&mut self.fine, &mut self.compared);
            std::mem::swap(&mut self.fine_at, &mut self.compared_at);
        } else {
            self.fit_fine(data, settings, at);
            self.fine_at = Some(at);
        }
    }

    /// A fine block around a pair of directions, through the bins' own data.
    fn fit_fine(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        (light, view): (Vec3, Vec3),
    ) {
        let centre = settings.coordinates.point(light, view);
        data.around(&centre, settings.neighbours / 2, &mut self.near);
        keep_nearest(&mut self.near, settings.neighbours / 2);
        data.expand(&centre, &self.near, &mut self.found);
        let radius = keep_nearest(&mut self.found, settings.neighbours);
        self.gather(data, Detail::Bins);
        self.fine
            .fit(&self.neighbourhood, centre, radius, &settings.block());
    }

    /// The data that were found.
    fn gather(&mut self, data: &impl Neighbours<N>, detail: Detail) {
        self.neighbourhood.clear();
        let found = self.found.iter().map(|(_, k)| data.datum(detail, *k));
        self.neighbourhood.extend(found);
    }
}
