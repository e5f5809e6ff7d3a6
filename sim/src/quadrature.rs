//! A quadrature ring on a simulated shaft: its waves, its index, and what goes wrong between it and its reader.

use gonia_firmware::hardware::{EncoderLost, EncoderWord};
use gonia_firmware::quadrature::Quadrature;

use crate::plant::{AxisPlant, PlantConfig};

/// Levels of both waves and of the index.
pub type Levels = [bool; 3];

/// The levels of a ring at this count of its turn, which has a whole number of periods.
pub fn levels(config: &PlantConfig, counts: u32) -> Levels {
    let phase = counts % 4;
    [
        matches!(phase, 1 | 2),
        matches!(phase, 2 | 3),
        counts == config.encoder_index,
    ]
}

/// A reader that takes a sample at every count, as one that is fast enough does.
#[derive(Debug, Default)]
pub struct QuadratureRing {
    reader: Quadrature,
    /// The count at the last sample.
    at: Option<u32>,
    /// Counts to come that no sample sees.
    unseen: u32,
    index_is_cut: bool,
}

impl QuadratureRing {
    /// What the reader says, after the ring has turned to where it is now.
    pub(crate) fn word(
        &mut self,
        turn: u32,
        plant: &mut AxisPlant,
        now_us: u64,
    ) -> Result<EncoderWord, EncoderLost> {
        self.reader.set_turn(turn);
        match plant.encoder_counts(now_us) {
            Some(counts) => self.follow(counts, plant.config()),
            // A cut cable: pull-ups.
            None => self.reader.sample(true, true, true),
        }
        self.reader.word()
    }

    fn follow(&mut self, counts: u32, config: &PlantConfig) {
        let turn = config.encoder_counts;
        let mut at = self.at.replace(counts).unwrap_or(counts);
        let is_up = (counts + turn - at) % turn <= turn / 2;
        while at != counts {
            at = (at + if is_up { 1 } else { turn - 1 }) % turn;
            if self.unseen > 0 && at != counts {
                self.unseen -= 1;
            } else {
                self.sample(config, at);
            }
        }
        self.sample(config, counts);
    }

    fn sample(&mut self, config: &PlantConfig, at: u32) {
        let [first, second, index] = levels(config, at);
        self.reader
            .sample(first, second, index && !self.index_is_cut);
    }

    /// The reader starts anew.
    pub(crate) fn restart(&mut self) {
        self.reader = Quadrature::new();
    }

    /// The next samples of so many counts do not come. While the ring turns: where it rests, none is missed.
    pub fn lose_edges(&mut self, counts: u32) {
        self.unseen = counts;
    }

    /// The index's wire is cut: it stays low.
    pub fn cut_index(&mut self) {
        self.index_is_cut = true;
    }
}
