//! What the uncertainty of a dense BRDF is made of, by part of the domain.

use crate::budget::cells::CellUncertainty;
use crate::budget::equation::Effect;
use gonia_brdf::interpolate::Origin;
use gonia_formats::dense::ChannelErrors;
use gonia_rig::stratum::{self, Stratum};
use gonia_rig::{Budget, DenseChannels, Input};

/// So many cells tell of all.
const TOLD_BY: usize = 40_000;

/// The uncertainty of a part of the domain: medians over its cells, as shares of the values (k = 1), of all but those
/// that are extrapolated.
#[derive(Clone, Debug, PartialEq)]
pub struct StratumBudget {
    /// The part.
    pub stratum: Stratum,
    /// Of everything.
    pub combined: f64,
    /// Of noise and interpolation.
    pub noise: f64,
    /// Of each input, in their order.
    pub inputs: [f64; Input::ALL.len()],
    /// Of the patch that a sample is the median of.
    pub patch: f64,
}

impl StratumBudget {
    /// The largest contributions first, with their names for people.
    pub fn sorted(&self) -> Vec<(&'static str, f64)> {
        let inputs = Input::ALL.into_iter().zip(self.inputs);
        let mut all: Vec<(&str, f64)> = inputs.map(|(input, u)| (name(input), u)).collect();
        all.push(("noise and interpolation", self.noise));
        all.push(("patch", self.patch));
        all.sort_by(|a, b| b.1.total_cmp(&a.1));
        all
    }
}

/// What an input is, in a few words.
fn name(input: Input) -> &'static str {
    match input {
        Input::Reference => "reference",
        Input::ReferenceAngle => "reference by angle",
        Input::ReferenceTilt => "reference's tilt",
        Input::ReferenceHeight => "reference's height",
        Input::Drift => "drift",
        Input::Linearity => "linearity",
        Input::Offset => "black level",
        Input::StrayLight => "stray light",
        Input::LightDirection => "direction of light",
        Input::ViewDirection => "direction of view",
        Input::LightDiameter => "lamp's size",
        Input::LensDiameter => "lens' size",
    }
}

/// The budget of a dense BRDF with its standard errors, by part of the domain: of the middle one of its channels.
/// Parts without cells are left out.
pub fn summary(
    dense: &DenseChannels,
    errors: &ChannelErrors,
    budget: &Budget,
) -> Vec<StratumBudget> {
    let channel = dense.planes.len() / 2;
    let (Some(plane), Some(noise)) = (
        dense.planes.get(channel),
        errors.standard_error.get(channel),
    ) else {
        return Vec::new();
    };
    let Some(cells) = CellUncertainty::new(dense.grid, plane, budget) else {
        return Vec::new();
    };
    let grid = dense.grid;
    // A step that shares no factor with the number of directions meets all of them.
    let step = (grid.n_cells() / TOLD_BY).max(1) | 1;
    let mut by_stratum: Vec<Vec<[f64; Effect::ALL.len() + 1]>> =
        Stratum::ALL.iter().map(|_| Vec::new()).collect();
    for cell in (0..grid.n_cells()).step_by(step) {
        let value = f64::from(plane[cell]);
        if errors.origin.get(cell) == Some(&(Origin::Extrapolated as u8)) || value <= 0.0 {
            continue;
        }
        let (light, view) = grid.light_and_view(cell);
        let effects = cells.effects(light, view);
        let mut shares = [0.0; Effect::ALL.len() + 1];
        for (share, effect) in shares.iter_mut().zip(Effect::ALL) {
            *share = effects.of(effect);
        }
        shares[Effect::ALL.len()] = noise.get(cell).map_or(0.0, |u| f64::from(*u) / value);
        let (light, view) = (grid.direction(light), grid.direction(view));
        let between = gonia_brdf::direction::dot(light.to_vec3(), view.to_vec3());
        let bits = stratum::of_geometry(light.theta_deg(), view.theta_deg(), between);
        for (part, of) in Stratum::ALL.into_iter().zip(&mut by_stratum) {
            if bits & (1 << part as u8) != 0 {
                of.push(shares);
            }
        }
    }
    let parts = Stratum::ALL.into_iter().zip(by_stratum);
    let filled = parts.filter(|(_, cells)| !cells.is_empty());
    filled
        .map(|(part, cells)| of_stratum(part, &cells))
        .collect()
}

fn of_stratum(stratum: Stratum, cells: &[[f64; Effect::ALL.len() + 1]]) -> StratumBudget {
    let noise_at = Effect::ALL.len();
    let median = |of: &dyn Fn(&[f64; Effect::ALL.len() + 1]) -> f64| {
        let mut all: Vec<f64> = cells.iter().map(of).collect();
        all.sort_by(f64::total_cmp);
        all[all.len() / 2]
    };
    let of_input = |input: Option<Input>| {
        median(&|shares| {
            let effects = Effect::ALL.into_iter().zip(shares);
            let own = effects.filter(|(effect, _)| effect.input() == input);
            own.map(|(_, share)| share * share).sum::<f64>().sqrt()
        })
    };
    StratumBudget {
        stratum,
        combined: median(&|shares| shares.iter().map(|s| s * s).sum::<f64>().sqrt()),
        noise: median(&|shares| shares[noise_at].abs()),
        inputs: Input::ALL.map(|input| of_input(Some(input))),
        patch: of_input(None),
    }
}
