//! `--method`: by which method a grid is filled.

use gonia_brdf::baselines::{BaselineSettings, UnknownBaseline};
use std::str::FromStr;

/// A method by name.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// Blocks, with the settings that suit the material.
    Default,
    /// One cell at a time: `paper` and the others.
    Cellwise(BaselineSettings),
}

impl FromStr for Method {
    type Err = UnknownBaseline;

    fn from_str(text: &str) -> Result<Self, UnknownBaseline> {
        if text == "default" {
            return Ok(Method::Default);
        }
        text.parse().map(Method::Cellwise)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn methods_have_names() {
        assert_eq!("default".parse(), Ok(Method::Default));
        assert_eq!(
            "paper".parse(),
            Ok(Method::Cellwise(BaselineSettings::PAPER))
        );
        assert!("papers".parse::<Method>().is_err());
    }
}
