//! What values are, on the command line.

use gonia_rig::Scale;

/// What values are said to be.
#[derive(clap::ValueEnum, Clone, Copy)]
pub enum ScaleArgument {
    /// Up to one factor
    Relative,
    /// 1/sr
    Absolute,
}

impl From<ScaleArgument> for Scale {
    fn from(argument: ScaleArgument) -> Self {
        match argument {
            ScaleArgument::Relative => Scale::Relative,
            ScaleArgument::Absolute => Scale::Absolute,
        }
    }
}

/// The row of a table that says what the values are, and who says so.
pub fn row(scale: Option<Scale>, is_argument: bool) -> (String, String) {
    let text = match (scale, is_argument) {
        (None, _) => {
            "relative: the files do not say theirs (--scale absolute, if they are 1/sr)".to_owned()
        }
        (Some(scale), true) => format!("{scale}, by --scale"),
        (Some(scale), false) => format!("{scale}, as the files say"),
    };
    ("scale".to_owned(), text)
}
