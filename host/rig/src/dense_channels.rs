//! A dense BRDF of any number of channels.

use crate::{Channels, DenseFile, Scale};
use gonia_brdf::{DenseBrdf, Direction, Grid};
use std::collections::BTreeMap;

/// A dense BRDF whose channels are known at run time only, with what its file says about it.
#[derive(Clone, Debug, PartialEq)]
pub struct DenseChannels {
    /// What the planes are of.
    pub channels: Channels,
    /// The grid of each plane.
    pub grid: Grid,
    /// A plane a channel, each [`Grid::n_cells`] long in the order of [`Grid::cell`].
    pub planes: Vec<Vec<f32>>,
    /// Whether the values are 1/sr.
    pub scale: Scale,
    /// Where the data came from, by name.
    pub provenance: BTreeMap<String, String>,
}

impl DenseChannels {
    /// The same as colours, one value as a grey; `None` of bands, and of planes that are not of the grid's size.
    pub fn into_rgb(mut self) -> Option<DenseFile> {
        match self.channels {
            Channels::Rgb => {}
            Channels::Single => {
                let plane = self.planes.pop()?;
                self.planes = vec![plane.clone(), plane.clone(), plane];
            }
            Channels::Bands(_) => return None,
        }
        let planes = <[Vec<f32>; 3]>::try_from(self.planes).ok()?;
        Some(DenseFile {
            brdf: DenseBrdf::new(self.grid, planes)?,
            scale: self.scale,
            provenance: self.provenance,
        })
    }

    /// The value of every channel between the nodes: see [`Grid::lookup`].
    pub fn lookup(&self, light: Direction, view: Direction) -> Vec<f32> {
        let value = |plane: &Vec<f32>| {
            let at = |i, v| Ok::<_, std::convert::Infallible>([plane[self.grid.cell(i, v)]]);
            match self.grid.lookup(light, view, at) {
                Ok([value]) => value,
            }
        };
        self.planes.iter().map(value).collect()
    }
}

impl From<DenseFile> for DenseChannels {
    fn from(file: DenseFile) -> Self {
        Self {
            channels: Channels::Rgb,
            grid: file.brdf.grid(),
            planes: file.brdf.into_planes().into(),
            scale: file.scale,
            provenance: file.provenance,
        }
    }
}
