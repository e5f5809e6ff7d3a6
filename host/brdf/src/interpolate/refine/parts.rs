//! A pair of patches in parts: fine blocks where they are needed, the coarse one elsewhere, and no seams
//! between them.

use super::Refiner;
use super::places::{cells_in, corners_in, pairs_of_parts, write_corners, write_places};
use crate::interpolate::FillSettings;
use crate::interpolate::blend::{difference, limit_of};
use crate::interpolate::hierarchy::Neighbours;
use crate::interpolate::patches::{Part, Patch};

impl<const N: usize> Refiner<N> {
    /// Writes the cells of all parts of a pair, and what they agree on at its corners; returns how many
    /// pairs of parts got a block of their own.
    pub(super) fn solve_parts(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        (p, q): (&Patch, &Patch),
        with_variances: bool,
    ) -> usize {
        let cells = p.directions.len() * q.directions.len();
        self.logs.resize(cells, [0.0; N]);
        if with_variances {
            self.variances.resize(cells, [0.0; N]);
        }
        self.part.corners.clear();
        self.part.count_at.clear();
        self.part.count_at.resize(self.corners.len(), 0);
        self.coarse_corners.clone_from(&self.corners);
        self.corners.fill([0.0; N]);
        let mut refined = 0;
        for (number, (a, b)) in pairs_of_parts(p, q).enumerate() {
            let first = self.part.corners.len();
            if self.exceeds_tolerance(settings, number) {
                refined += 1;
                self.solve_part(data, settings, (a, b), with_variances);
            } else {
                self.keep_part(settings, (a, b), q, with_variances);
            }
            for (k, place) in cells_in(a, b, q).enumerate() {
                self.logs[place] = self.part.logs[k];
                if with_variances {
                    self.variances[place] = self.part.variances[k];
                }
            }
            for (k, corner) in corners_in(a, b, q).enumerate() {
                self.part.count_at[corner] += 1;
                for c in 0..N {
                    self.corners[corner][c] += self.part.corners[first + k][c];
                }
            }
        }
        for (sum, count) in self.corners.iter_mut().zip(&self.part.count_at) {
            *sum = sum.map(|s| s / (*count).max(1) as f32);
        }
        self.blend_parts(settings, (p, q));
        refined
    }

    /// Shifts the parts to what they agree on at their corners.
    fn blend_parts(&mut self, settings: &FillSettings, (p, q): (&Patch, &Patch)) {
        let part = &mut self.part;
        part.differences.clear();
        let places = pairs_of_parts(p, q).flat_map(|(a, b)| corners_in(a, b, q));
        for (corner, own) in places.zip(&part.corners) {
            part.differences
                .push(difference(*own, self.corners[corner]));
        }
        let limit = limit_of(&mut part.differences, settings.blend_limit());
        let mut first = 0;
        for (a, b) in pairs_of_parts(p, q) {
            part.shifts.clear();
            for corner in corners_in(a, b, q) {
                let (own, mean) = (part.corners[first], self.corners[corner]);
                part.shifts.push(own, mean, limit);
                first += 1;
            }
            part.logs.clear();
            let cells = cells_in(a, b, q).map(|place| self.logs[place]);
            part.logs.extend(cells);
            part.shifts.apply(&a.patch, &b.patch, &mut part.logs);
            for (k, place) in cells_in(a, b, q).enumerate() {
                self.logs[place] = part.logs[k];
            }
        }
    }

    /// A pair of parts in a fine block: its cells and, appended, its corners.
    fn solve_part(
        &mut self,
        data: &impl Neighbours<N>,
        settings: &FillSettings,
        (a, b): (&Part, &Part),
        with_variances: bool,
    ) {
        let at = (a.patch.centre, b.patch.centre);
        self.make_fine(data, settings, at);
        let (pair, part) = ((&a.patch, &b.patch), &mut self.part);
        write_corners(settings, pair, &mut self.places);
        self.fine.evaluate(&self.places, &mut part.corners);
        write_places(settings, pair, &mut self.places);
        part.logs.clear();
        self.fine.evaluate(&self.places, &mut part.logs);
        if with_variances {
            part.variances.clear();
            self.fine.variances_at(&self.places, &mut part.variances);
        }
    }

    /// The same in the coarse block.
    fn keep_part(
        &mut self,
        settings: &FillSettings,
        (a, b): (&Part, &Part),
        q: &Patch,
        with_variances: bool,
    ) {
        let part = &mut self.part;
        let corners = corners_in(a, b, q).map(|corner| self.coarse_corners[corner]);
        part.corners.extend(corners);
        write_places(settings, (&a.patch, &b.patch), &mut self.places);
        part.logs.clear();
        self.coarse.evaluate(&self.places, &mut part.logs);
        if with_variances {
            part.variances.clear();
            self.coarse.variances_at(&self.places, &mut part.variances);
        }
    }
}
