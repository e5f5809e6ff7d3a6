//! Where a result came from: what every file that gonia makes says of itself.

use std::collections::BTreeMap;

/// Name and text of each fact.
pub type Provenance = BTreeMap<String, String>;

/// The facts that hold for any run of this version.
pub fn of_this_program() -> Provenance {
    Provenance::from([("version".to_owned(), program())])
}

/// gonia with its version, and the state of the sources where `GONIA_GIT` gave it at build time.
pub fn program() -> String {
    let version = env!("CARGO_PKG_VERSION");
    match option_env!("GONIA_GIT") {
        Some(sources) => format!("gonia {version} ({sources})"),
        None => format!("gonia {version}"),
    }
}

/// Name of the fact that values became 1/sr by a factor that somebody said.
pub const SCALE_ASSUMED: &str = "scale_assumed";

/// The fact for [`SCALE_ASSUMED`].
pub(crate) fn scale_assumed(factor: f64) -> String {
    format!("1/sr after multiplying by {factor}")
}
