//! Where a result came from: what every file that gonia makes says of itself.

use std::collections::BTreeMap;

/// Name and text of each fact.
pub type Provenance = BTreeMap<String, String>;

/// The facts that hold for any run of this program.
pub fn of_this_program() -> Provenance {
    Provenance::from([("version".to_owned(), program())])
}

/// This program with its version.
pub fn program() -> String {
    format!("gonia {}", env!("CARGO_PKG_VERSION"))
}
