//! What to do with a cell's neighbours, and its name.
//!
//! A name is the rule, then what differs from the rule's usual settings, between commas:
//! `rbf-linear,k=100,half=0.5,log,means,mirrored`.

use super::basis::BasisFunction;
use super::moving_least_squares::MovingLeastSquares;
use super::nearest::Nearest;
use super::rbf::Rbf;
use super::shepard::Shepard;
use super::{Interpolant, Space};
use crate::interpolate::Coordinates;
use std::fmt;
use std::str::FromStr;

/// How a value is made of the neighbours.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Rule {
    /// The nearest one's value.
    Nearest,
    /// Mean by inverse distance.
    Shepard {
        /// How fast the weight falls.
        power: f64,
    },
    /// Moving least squares.
    MovingLeastSquares {
        /// Degree of the polynomial: 1 or 2.
        degree: usize,
    },
    /// Radial basis functions.
    Rbf {
        /// The function.
        kernel: BasisFunction,
        /// Its length in radii of the neighbourhood; 1 for kernels that have none.
        length: f64,
    },
}

/// Where a bin's value belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Places {
    /// At the bin's node, as in the paper.
    Centres,
    /// At the mean of the directions measured.
    Means,
}

/// What is interpolated: the values, or a function of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transform {
    /// The values themselves, as in the paper.
    Linear,
    /// Their logarithms.
    Logarithm,
}

/// How to interpolate one cell at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BaselineSettings {
    /// How a value is made of the neighbours.
    pub rule: Rule,
    /// How many neighbours.
    pub neighbours: usize,
    /// Where distances are taken.
    pub space: Space,
    /// What is interpolated.
    pub values: Transform,
    /// Where a bin's value belongs.
    pub places: Places,
    /// Whether every bin stands at its reciprocal place too. Without it values are made
    /// reciprocal at the end, as the mean of both.
    pub mirrored: bool,
    /// What makes the system of equations solvable, and smooths; see [`Rule`]'s methods.
    pub nugget: f64,
}

/// A name that is none.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "'{0}' names no method; give paper, nearest, shepard, mls1, mls2 or rbf-KERNEL (linear, \
     thin-plate, cubic, gaussian, multiquadric, wendland, matern), then what differs, as in \
     rbf-cubic,k=50,half=0.5,log,means,mirrored,nugget=1e-4"
)]
pub struct UnknownBaseline(String);

/// Most neighbours: the time grows with their cube.
const MOST_NEIGHBOURS: usize = 2000;

impl BaselineSettings {
    /// The paper's method: the 200 nearest bins in chords between nodes, linear radial basis
    /// functions of the values, the mean of reciprocal values at the end; and the least that makes
    /// its systems solvable, a nugget.
    pub const PAPER: BaselineSettings = BaselineSettings {
        rule: Rule::Rbf {
            kernel: BasisFunction::Linear,
            length: 1.0,
        },
        neighbours: 200,
        space: Space::Chords,
        values: Transform::Linear,
        places: Places::Centres,
        mirrored: false,
        nugget: 1e-3,
    };

    /// A rule by name, with the settings that are usual with it.
    fn usual(name: &str) -> Option<Self> {
        let (rule, neighbours) = match name {
            "paper" => return Some(Self::PAPER),
            "nearest" => (Rule::Nearest, 1),
            "shepard" => (Rule::Shepard { power: 2.0 }, 16),
            "mls1" => (Rule::MovingLeastSquares { degree: 1 }, 50),
            "mls2" => (Rule::MovingLeastSquares { degree: 2 }, 100),
            _ => {
                let name = name.strip_prefix("rbf-")?;
                let kernel = BasisFunction::ALL.into_iter().find(|k| k.name() == name)?;
                let length = kernel.usual_length().unwrap_or(1.0);
                (Rule::Rbf { kernel, length }, 200)
            }
        };
        Some(Self {
            rule,
            neighbours,
            ..Self::PAPER
        })
    }

    /// Changes what one word of a name says.
    fn change(&mut self, word: &str) -> Option<()> {
        let (key, value) = word.split_once('=').unwrap_or((word, ""));
        let positive = || value.parse().ok().filter(|x: &f64| *x > 0.0 && *x < 1e6);
        match (key, value) {
            ("k", _) => {
                self.neighbours = value.parse().ok().filter(|k| *k <= MOST_NEIGHBOURS)?;
                (self.neighbours > 0).then_some(())?;
            }
            ("angles", "") => self.space = Space::Angles,
            ("chords", "") => self.space = Space::Chords,
            ("half", _) => {
                let weight = positive()?;
                self.space = Space::Symmetric(Coordinates::half_difference(weight));
            }
            ("sum", _) => {
                let weight = positive()?;
                self.space = Space::Symmetric(Coordinates::sum_difference(weight));
            }
            ("linear", "") => self.values = Transform::Linear,
            ("log", "") => self.values = Transform::Logarithm,
            ("centres", "") => self.places = Places::Centres,
            ("means", "") => self.places = Places::Means,
            ("mirrored", "") => self.mirrored = true,
            ("nugget", _) => {
                self.nugget = value.parse().ok().filter(|x| (0.0..1e6).contains(x))?;
            }
            ("power", _) => {
                let Rule::Shepard { power } = &mut self.rule else {
                    return None;
                };
                *power = positive()?;
            }
            ("length", _) => {
                let Rule::Rbf { kernel, length } = &mut self.rule else {
                    return None;
                };
                kernel.usual_length()?;
                *length = positive()?;
            }
            _ => return None,
        }
        Some(())
    }

    /// What does the work.
    pub(super) fn interpolant(&self) -> Box<dyn Interpolant> {
        let nugget = self.nugget;
        match self.rule {
            Rule::Nearest => Box::new(Nearest),
            Rule::Shepard { power } => Box::new(Shepard { power }),
            Rule::MovingLeastSquares { degree } => Box::new(MovingLeastSquares { degree, nugget }),
            Rule::Rbf { kernel, length } => Box::new(Rbf {
                kernel,
                length,
                nugget,
            }),
        }
    }

    fn name_of_rule(&self) -> String {
        match self.rule {
            Rule::Nearest => "nearest".into(),
            Rule::Shepard { .. } => "shepard".into(),
            Rule::MovingLeastSquares { degree } => format!("mls{degree}"),
            Rule::Rbf { kernel, .. } => format!("rbf-{}", kernel.name()),
        }
    }
}

impl FromStr for BaselineSettings {
    type Err = UnknownBaseline;

    fn from_str(text: &str) -> Result<Self, UnknownBaseline> {
        let error = || UnknownBaseline(text.to_owned());
        let mut words = text.split(',').map(str::trim);
        let mut settings = words.next().and_then(Self::usual).ok_or_else(error)?;
        for word in words {
            settings.change(word).ok_or_else(error)?;
        }
        Ok(settings)
    }
}

impl fmt::Display for BaselineSettings {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if *self == Self::PAPER {
            return f.write_str("paper");
        }
        let name = self.name_of_rule();
        let usual = Self::usual(&name).unwrap_or(Self::PAPER);
        f.write_str(&name)?;
        match (self.rule, usual.rule) {
            (Rule::Shepard { power }, Rule::Shepard { power: usual }) if power != usual => {
                write!(f, ",power={power}")?;
            }
            (Rule::Rbf { length, .. }, Rule::Rbf { length: usual, .. }) if length != usual => {
                write!(f, ",length={length}")?;
            }
            _ => {}
        }
        if self.neighbours != usual.neighbours {
            write!(f, ",k={}", self.neighbours)?;
        }
        if self.space != usual.space {
            write!(f, ",{}", self.space)?;
        }
        if self.values == Transform::Logarithm {
            f.write_str(",log")?;
        }
        if self.places == Places::Means {
            f.write_str(",means")?;
        }
        if self.mirrored {
            f.write_str(",mirrored")?;
        }
        if self.nugget != usual.nugget {
            write!(f, ",nugget={}", self.nugget)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_say_what_differs_and_are_read_again() {
        for name in [
            "paper",
            "nearest",
            "shepard,power=4,k=32",
            "mls1",
            "mls2,k=200,angles",
            "rbf-linear,k=100",
            "rbf-thin-plate,nugget=0",
            "rbf-cubic,sum=1",
            "rbf-gaussian,length=0.25",
            "rbf-multiquadric,log",
            "rbf-wendland,half=0.5,log,means,mirrored",
            "rbf-matern,k=400",
        ] {
            let settings: BaselineSettings = name.parse().unwrap();
            assert_eq!(settings.to_string(), name);
        }
        let paper: BaselineSettings = "rbf-linear, k=200, chords".parse().unwrap();
        assert_eq!(paper, BaselineSettings::PAPER);
    }

    #[test]
    fn what_names_nothing_is_refused_with_the_names_there_are() {
        for bad in [
            "",
            "rbf",
            "rbf-quartic",
            "paper,k=0",
            "paper,k=9999",
            "paper,half",
            "paper,half=-1",
            "paper,nugget=-1",
            "paper,length=2",
            "nearest,power=2",
            "paper,",
        ] {
            let error = bad.parse::<BaselineSettings>().unwrap_err().to_string();
            assert!(
                error.contains(&format!("'{bad}'")) && error.contains("thin-plate"),
                "{error}"
            );
        }
    }
}
