//! Searches among the data that many trials share: of a hundred thousand places, the order that they are found by takes
//! longer than all that is predicted with it.

use super::Settings;
use super::data::Data;
use super::merge::Merged;
use super::places::Places;
use crate::interpolate::Coordinates;
use std::sync::{Arc, Mutex, PoisonError};

/// Data, merged as some settings have it, and the search among them.
pub(super) struct Search {
    pub merged: Merged,
    /// Without images.
    pub places: Places,
}

/// What a search depends on.
#[derive(PartialEq)]
struct Key {
    coordinates: Coordinates,
    merged: usize,
    is_isotropic: bool,
}

/// The searches of all settings that were tried.
pub(super) struct Searches<'a> {
    pub data: &'a Data,
    known: Mutex<Vec<(Key, Arc<Search>)>>,
}

impl<'a> Searches<'a> {
    pub fn new(data: &'a Data) -> Self {
        Self {
            data,
            known: Mutex::default(),
        }
    }

    /// The one for some settings.
    pub fn of(&self, settings: &Settings) -> Arc<Search> {
        let key = Key {
            coordinates: settings.coordinates,
            merged: settings.merged,
            is_isotropic: settings.symmetry.is_isotropic(),
        };
        // A thread that panicked left whole searches.
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some((_, search)) = known.iter().find(|(of, _)| *of == key) {
            return search.clone();
        }
        let merged = Merged::new(self.data, settings);
        let places = Places::without_images(&merged.data, settings);
        let search = Arc::new(Search { merged, places });
        known.push((key, search.clone()));
        search
    }
}
