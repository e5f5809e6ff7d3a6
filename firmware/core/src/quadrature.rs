//! A quadrature ring with index: two square waves, a quarter of a period apart, and a pulse once a turn.
//!
//! A timer's interrupt gives all three levels to [`Quadrature::sample`] at [`crate::single_wire::TICK_HZ`]. A level that
//! bounces counts up and down again. Where both waves have changed since the last sample an edge was lost, and with it
//! the position: that is a fault at once, as the index is where it does not come at its count.
//!
//! Why sampled and not counted at edges by interrupts: a wave that bounces or picks up interference costs the processor
//! no more than one at rest.

use crate::hardware::{EncoderLost, EncoderWord};

/// Counts a second that a ring may give. A state of the two waves must outlast a sample's period (17.4 µs) and what
/// delays the sample (8 µs: the interrupts of steps and trigger before it, and critical sections); the data sheets of
/// rings let a state be as short as half of what it should be.
pub const MOST_COUNTS_S: u32 = 20_000;

/// How far from its count the index may come.
const INDEX_TOLERANCE: i32 = 1;
/// Counts from the index at which it must have come, if it was passed.
const PASSED: i32 = 3;

/// Counts a ring's edges.
#[derive(Clone, Debug)]
pub struct Quadrature {
    /// Counts of a turn; 0 until they are known.
    turn: i32,
    /// The waves at the last sample: 0 to 3, in the order in which they come upwards.
    phase: Option<u8>,
    /// The direction of the last count.
    goes_up: Option<bool>,
    /// 0 to `turn` - 1, from wherever the ring stood at first.
    count: i32,
    /// The count at which the index came first: its lower edge, whichever way the ring turns.
    index: Option<i32>,
    /// Counts from there, within half a turn.
    from_index: i32,
    /// The index is being passed, upwards or downwards, and has not come.
    awaits_index: Option<bool>,
    /// The count at the last sample, where the index was high.
    high_at: Option<i32>,
    lost: Option<EncoderLost>,
}

impl Default for Quadrature {
    fn default() -> Self {
        Self::new()
    }
}

impl Quadrature {
    /// A ring of which nothing is known.
    pub const fn new() -> Self {
        Self {
            turn: 0,
            phase: None,
            goes_up: None,
            count: 0,
            index: None,
            from_index: 0,
            awaits_index: None,
            high_at: None,
            lost: None,
        }
    }

    /// Counts of a turn, at most 2²⁶. Where they have changed, all that was known is forgotten.
    pub fn set_turn(&mut self, turn: u32) {
        let turn = turn.min(1 << 26) as i32;
        if self.turn != turn {
            *self = Self {
                turn,
                ..Self::new()
            };
        }
    }

    /// The levels of both waves and of the index, as they are now. The first wave leads upwards.
    #[inline]
    pub fn sample(&mut self, first: bool, second: bool, index: bool) {
        let phase = u8::from(second) << 1 | u8::from(first != second);
        if let Some(was) = self.phase.replace(phase) {
            match phase.wrapping_sub(was) & 3 {
                0 => {}
                1 => self.count_by(1),
                3 => self.count_by(-1),
                _ => self.lose(EncoderLost::Edge),
            }
        }
        let high_at = core::mem::replace(&mut self.high_at, index.then_some(self.count));
        match (high_at, index, self.goes_up) {
            (None, true, Some(true)) => self.index_at(self.count),
            (Some(at), false, Some(false)) => self.index_at(at),
            _ => {}
        }
    }

    fn count_by(&mut self, way: i32) {
        self.goes_up = Some(way > 0);
        self.count = wrapped(self.count + way, 0, self.turn);
        if self.index.is_none() {
            return;
        }
        self.from_index = wrapped(self.from_index + way, -self.turn / 2, self.turn);
        // Upwards it is passed from two counts below to three above, downwards the other way round.
        match self.from_index * way {
            at if at == 1 - PASSED => self.awaits_index = Some(way > 0),
            PASSED if self.awaits_index == Some(way > 0) => self.lose(EncoderLost::Index),
            PASSED => self.awaits_index = None,
            _ => {}
        }
    }

    /// The lower edge of the index has come at this count.
    fn index_at(&mut self, place: i32) {
        let half = -self.turn / 2;
        match self.index {
            Some(index) => {
                self.awaits_index = None;
                if wrapped(place - index, half, self.turn).abs() > INDEX_TOLERANCE {
                    self.lose(EncoderLost::Index);
                }
            }
            None => {
                self.index = Some(place);
                self.from_index = wrapped(self.count - place, half, self.turn);
            }
        }
    }

    /// What was counted so far is worth nothing: the index is to be found anew.
    fn lose(&mut self, why: EncoderLost) {
        self.lost.get_or_insert(why);
        self.index = None;
        self.awaits_index = None;
        self.goes_up = None;
    }

    /// The position in counts of a turn, and the count of the index where that has come. That the position was lost is
    /// said once; after it another one begins, without an index.
    pub fn word(&mut self) -> Result<EncoderWord, EncoderLost> {
        match self.lost.take() {
            Some(lost) => Err(lost),
            None if self.phase.is_none() => Err(EncoderLost::Silent),
            None => Ok(EncoderWord {
                counts: self.count as u32,
                warns: false,
                index: self.index.map(|at| at as u32),
            }),
        }
    }
}

/// A count that has left a turn which begins at `from` by less than a turn.
#[inline]
fn wrapped(count: i32, from: i32, turn: i32) -> i32 {
    if count < from {
        count + turn
    } else if count >= from + turn {
        count - turn
    } else {
        count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURN: i32 = 4_000;
    /// Where the ring's index is, counted from where the ring stands at first.
    const INDEX: i32 = 1_000;

    /// A ring, its index as wide as some counts, and its reader.
    struct Ring {
        reader: Quadrature,
        place: i32,
        width: i32,
        has_index: bool,
        is_swapped: bool,
    }

    impl Ring {
        fn new(width: i32) -> Self {
            let mut ring = Self {
                reader: Quadrature::new(),
                place: 0,
                width,
                has_index: true,
                is_swapped: false,
            };
            ring.reader.set_turn(TURN as u32);
            ring.sample();
            ring
        }

        fn sample(&mut self) {
            let phase = self.place.rem_euclid(4);
            let (a, b) = (matches!(phase, 1 | 2), matches!(phase, 2 | 3));
            let (a, b) = if self.is_swapped { (b, a) } else { (a, b) };
            let above = (self.place - INDEX).rem_euclid(TURN);
            self.reader
                .sample(a, b, self.has_index && above < self.width);
        }

        fn go_to(&mut self, place: i32) {
            while self.place != place {
                self.place += (place - self.place).signum();
                self.sample();
            }
        }

        fn word(&mut self) -> Result<(u32, Option<u32>), EncoderLost> {
            self.reader.word().map(|word| (word.counts, word.index))
        }
    }

    #[test]
    fn edges_are_counted_both_ways_and_the_index_is_the_same_from_both() {
        // Gated with one state, ungated over a period; found from below, and from above.
        for width in [1, 2, 4] {
            let mut ring = Ring::new(width);
            ring.go_to(900);
            assert_eq!(ring.word(), Ok((900, None)), "{width}");
            ring.go_to(1_500);
            assert_eq!(ring.word(), Ok((1_500, Some(1_000))), "{width}");
            let mut ring = Ring::new(width);
            ring.go_to(-2_900);
            assert_eq!(ring.word(), Ok((1_100, None)), "{width}");
            ring.go_to(-3_100);
            assert_eq!(ring.word(), Ok((900, Some(1_000))), "{width}");
            // And again, many turns, both ways, and to and fro on it.
            for place in [
                9_000, -9_000, 1_000, 999, 1_001, 998, 1_004, 995, 1_003, 1_000, 2_000, 0,
            ] {
                ring.go_to(place);
                let counts = place.rem_euclid(TURN) as u32;
                assert_eq!(ring.word(), Ok((counts, Some(1_000))), "{width}, {place}");
            }
        }
    }

    #[test]
    fn an_index_that_changes_within_a_count_is_the_same_from_both_ways() {
        let mut ring = Ring::new(0);
        ring.go_to(1_000);
        // The waves stand, and the index rises and falls.
        ring.reader.sample(false, false, true);
        assert_eq!(ring.word(), Ok((1_000, Some(1_000))));
        let level = |ring: &mut Ring, place: i32, index: bool| {
            ring.place = place;
            let phase = place.rem_euclid(4);
            let (a, b) = (matches!(phase, 1 | 2), matches!(phase, 2 | 3));
            ring.reader.sample(a, b, index);
        };
        for place in [1_001, 1_002, 1_003, 1_004] {
            level(&mut ring, place, place < 1_002);
        }
        for place in [1_003, 1_002, 1_001, 1_000] {
            level(&mut ring, place, place < 1_002);
        }
        level(&mut ring, 1_000, false);
        ring.go_to(990);
        assert_eq!(ring.word(), Ok((990, Some(1_000))));
    }

    #[test]
    fn a_wave_that_bounces_counts_nothing() {
        let mut ring = Ring::new(1);
        ring.go_to(41);
        for _ in 0..1_000 {
            ring.reader.sample(true, true, false);
            ring.reader.sample(true, false, false);
        }
        assert_eq!(ring.word(), Ok((41, None)));
    }

    #[test]
    fn a_lost_edge_is_said_once_and_the_index_is_to_be_found_anew() {
        let mut ring = Ring::new(1);
        ring.go_to(1_500);
        ring.place += 2;
        ring.sample();
        // What the index says after it says nothing of what was lost.
        ring.go_to(1_400);
        assert_eq!(ring.word(), Err(EncoderLost::Edge));
        assert!(matches!(ring.word(), Ok((_, None))));
        ring.go_to(900);
        assert!(matches!(ring.word(), Ok((_, Some(_)))));
    }

    #[test]
    fn four_counts_that_no_sample_saw_are_found_by_the_index() {
        for place in [1_600, 900] {
            let mut ring = Ring::new(1);
            ring.go_to(1_500);
            ring.place += 4;
            ring.sample();
            assert!(ring.word().is_ok());
            // A turn up, or back over it.
            ring.go_to(if place > 1_500 { place + TURN } else { place });
            assert_eq!(ring.word(), Err(EncoderLost::Index));
            assert!(ring.word().is_ok());
        }
    }

    #[test]
    fn one_count_too_many_is_within_the_tolerance_and_two_are_not() {
        for (extra, is_lost) in [(1, false), (2, true)] {
            let mut ring = Ring::new(1);
            ring.go_to(1_500);
            // Interference looks like counts upwards.
            let index = ring.reader.index;
            ring.reader.index = index.map(|at| at - extra);
            ring.reader.from_index += extra;
            ring.go_to(900);
            assert_eq!(ring.word().is_err(), is_lost, "{extra}");
        }
    }

    #[test]
    fn an_index_that_is_passed_and_does_not_come_is_missed_at_once() {
        for (from, to) in [(1_500, 997), (500, 1_003)] {
            let mut ring = Ring::new(1);
            ring.go_to(1_500);
            ring.go_to(from);
            ring.has_index = false;
            let before = from + (to - from).signum() * ((to - from).abs() - 1);
            ring.go_to(before);
            assert!(ring.word().is_ok(), "from {from}");
            ring.go_to(to);
            assert_eq!(ring.word(), Err(EncoderLost::Index), "from {from}");
        }
    }

    #[test]
    fn an_index_that_stays_high_is_missed_too() {
        let mut ring = Ring::new(1);
        ring.go_to(1_500);
        ring.width = TURN;
        ring.go_to(900);
        assert_eq!(ring.word(), Err(EncoderLost::Index));
    }

    #[test]
    fn a_turn_that_the_settings_have_wrong_is_found_at_the_next_index() {
        for turn in [TURN - 400, TURN + 400] {
            let mut ring = Ring::new(1);
            ring.reader.set_turn(turn as u32);
            ring.sample();
            ring.go_to(INDEX + 10);
            assert!(ring.word().is_ok());
            ring.go_to(INDEX + TURN + 1_000);
            assert_eq!(ring.word(), Err(EncoderLost::Index), "{turn}");
        }
    }

    #[test]
    fn waves_that_are_exchanged_count_down_where_the_ring_turns_up() {
        let mut ring = Ring::new(1);
        ring.is_swapped = true;
        ring.go_to(100);
        assert_eq!(ring.word(), Ok((TURN as u32 - 100, None)));
    }

    #[test]
    fn after_a_reset_in_mid_turn_the_position_counts_from_there_without_an_index() {
        let mut ring = Ring::new(1);
        ring.go_to(1_234);
        ring.reader = Quadrature::new();
        assert_eq!(ring.word(), Err(EncoderLost::Silent));
        ring.reader.set_turn(TURN as u32);
        ring.sample();
        ring.go_to(1_240);
        assert_eq!(ring.word(), Ok((6, None)));
        // Another number of counts a turn is another ring.
        ring.reader.set_turn(2 * TURN as u32);
        ring.sample();
        assert_eq!(ring.word(), Ok((0, None)));
    }
}
