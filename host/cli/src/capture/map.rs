//! Where the poses of a plan are, and which of them are done, in letters.

use gonia_brdf::Elementary;
use gonia_brdf::{Direction, Pose};

/// A letter is about twice as high as wide.
const ROWS: usize = 11;
const COLUMNS: usize = 23;
/// Between the two hemispheres.
const GAP: &str = "     ";

/// What became of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    ToDo,
    Done,
    /// Given up, or its frame does not show the target.
    Bad,
}

/// The hemispheres of light and view from above, the zenith in the middle and azimuth 0° to the right.
#[derive(Debug)]
pub struct PoseMap {
    /// Row and column of each pose, of its light and of its view.
    cells: Vec<[usize; 2]>,
    marks: Vec<Mark>,
}

impl PoseMap {
    /// Of a plan of which nothing is done.
    pub fn new(plan: &[Pose]) -> Self {
        Self {
            cells: plan.iter().map(|p| [cell(p.light), cell(p.view)]).collect(),
            marks: vec![Mark::ToDo; plan.len()],
        }
    }

    /// All poses but some are done.
    pub fn begin(&mut self, missing: &[usize]) {
        self.marks.fill(Mark::Done);
        for index in missing {
            self.set(*index, Mark::ToDo);
        }
    }

    /// A pose has become something.
    pub fn set(&mut self, index: usize, mark: Mark) {
        if let Some(place) = self.marks.get_mut(index) {
            *place = mark;
        }
    }

    /// The map with the place where the arms are or go, a line a row.
    pub fn lines(&self, current: Option<usize>) -> Vec<String> {
        let mut out = vec![format!("{:^COLUMNS$}{GAP}{:^COLUMNS$}", "light", "view")];
        let sides = [0, 1].map(|side| self.letters(side, current));
        for row in 0..ROWS {
            let [light, view] = [0, 1].map(|side| {
                let letters = &sides[side][row * COLUMNS..(row + 1) * COLUMNS];
                letters.iter().collect::<String>()
            });
            out.push(format!("{light}{GAP}{view}"));
        }
        out
    }

    fn letters(&self, side: usize, current: Option<usize>) -> Vec<char> {
        let mut planned = [0_u32; ROWS * COLUMNS];
        let (mut done, mut bad) = (planned, planned);
        for (cells, mark) in self.cells.iter().zip(&self.marks) {
            let at = cells[side];
            planned[at] += 1;
            done[at] += u32::from(*mark != Mark::ToDo);
            bad[at] += u32::from(*mark == Mark::Bad);
        }
        let here = current.and_then(|index| Some(self.cells.get(index)?[side]));
        let letter = |at: usize| match (planned[at], done[at]) {
            _ if here == Some(at) => 'O',
            (0, _) => ' ',
            _ if bad[at] > 0 => 'x',
            (_, 0) => '·',
            (all, some) if 3 * some < all => '░',
            (all, some) if 3 * some < 2 * all => '▒',
            (all, some) if some < all => '▓',
            _ => '█',
        };
        (0..ROWS * COLUMNS).map(letter).collect()
    }
}

/// The letter at which a direction is.
fn cell(d: Direction) -> usize {
    let r = d.theta_deg() / 90.0;
    let along = |share: f64, n: usize| {
        let place = 0.5 * (1.0 + share) * (n - 1) as f64;
        (place.round() as usize).min(n - 1)
    };
    along(-r * d.phi.sine(), ROWS) * COLUMNS + along(r * d.phi.cosine(), COLUMNS)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_map_fills_as_poses_are_done_and_shows_where_the_arms_are() {
        let pose = |theta_i, phi_i, theta_v| Pose {
            light: Direction::from_deg(theta_i, phi_i),
            view: Direction::from_deg(theta_v, 90.0),
        };
        let plan = [
            pose(0.0, 0.0, 0.0),
            pose(85.0, 0.0, 0.0),
            pose(85.0, 90.0, 0.0),
            pose(0.0, 0.0, 75.0),
        ];
        let mut map = PoseMap::new(&plan);
        let at = |map: &PoseMap, current, row: usize, column: usize| {
            map.lines(current)[1 + row].chars().nth(column).unwrap()
        };
        let (middle, right, top) = ((5, 11), (5, 21), (0, 11));
        let view_middle = (5, COLUMNS + GAP.len() + 11);
        for (place, letter) in [(middle, '·'), (right, '·'), (top, '·'), ((0, 0), ' ')] {
            assert_eq!(at(&map, None, place.0, place.1), letter);
        }
        map.set(0, Mark::Done);
        map.set(1, Mark::Done);
        map.set(2, Mark::Bad);
        assert_eq!(at(&map, None, middle.0, middle.1), '▒');
        assert_eq!(at(&map, None, right.0, right.1), '█');
        assert_eq!(at(&map, None, top.0, top.1), 'x');
        assert_eq!(at(&map, Some(1), right.0, right.1), 'O');
        assert_eq!(at(&map, None, view_middle.0, view_middle.1), 'x');
        map.begin(&[0, 3]);
        assert_eq!(at(&map, None, middle.0, middle.1), '·');
        assert_eq!(at(&map, None, top.0, top.1), '█');
        assert_eq!(map.lines(None).len(), 1 + ROWS);
    }
}
