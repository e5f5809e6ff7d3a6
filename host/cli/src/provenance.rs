//! Where a result came from: what every file that gonia makes says of itself.

use std::collections::BTreeMap;

/// Name and text of each fact.
pub type Provenance = BTreeMap<String, String>;

/// The facts that hold for any run of this program.
pub fn of_this_program() -> Provenance {
    Provenance::from([("version".to_owned(), program())])
}

/// This program with its version, and the state of the sources where `GONIA_GIT` told it at build
/// time, as the firmware's.
pub fn program() -> String {
    let version = env!("CARGO_PKG_VERSION");
    match option_env!("GONIA_GIT") {
        Some(sources) => format!("gonia {version} ({sources})"),
        None => format!("gonia {version}"),
    }
}
