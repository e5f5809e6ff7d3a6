//! Where samples came from, as the note of their file says it.

use gonia_acquire::session::{RIG, SessionFolder, now};
use gonia_formats::{FileError, checksum};
use gonia_pipeline::provenance::Provenance;
use std::path::Path;

/// Endings of samples; what else there is, is a dense BRDF.
const SAMPLES: [&str; 5] = ["npy", "npz", "csv", "txt", "tsv"];

/// Whether a name is one of samples.
pub fn is_samples(path: &Path) -> bool {
    let ending = path.extension().and_then(|ending| ending.to_str());
    ending.is_some_and(|ending| SAMPLES.iter().any(|of| ending.eq_ignore_ascii_case(of)))
}

/// Of a session: its beginning, its rig and plan by their checksums, its camera and controllers.
pub fn of_session(made_by: &str, session: &SessionFolder) -> Provenance {
    let kept = session.provenance();
    let arm = |arm: &gonia_acquire::session::ControllerIdentity| {
        format!(
            "{} {}, settings {}",
            arm.board, arm.firmware, arm.config_crc
        )
    };
    let mut facts = made_by_facts(made_by, session.folder());
    facts.extend([
        ("measured_by".to_owned(), kept.program.clone()),
        ("began".into(), kept.began.clone()),
        ("rig".into(), format!("{RIG}, checksum {}", kept.rig_crc)),
        (
            "plan".into(),
            format!("{} poses, checksum {}", session.plan().len(), kept.plan_crc),
        ),
        ("camera".into(), kept.camera.clone()),
        ("light_arm".into(), arm(&kept.light_arm)),
        ("camera_arm".into(), arm(&kept.camera_arm)),
    ]);
    facts
}

/// Of a capture folder: its rig by its checksum.
pub fn of_capture_folder(made_by: &str, folder: &Path) -> Result<Provenance, FileError> {
    let rig = checksum::of_file(&folder.join(RIG))?;
    let mut facts = made_by_facts(made_by, folder);
    facts.insert("rig".to_owned(), format!("{RIG}, checksum {rig}"));
    Ok(facts)
}

/// This day, as `2027-03-31`.
pub fn today() -> String {
    now().chars().take_while(|c| *c != 'T').collect()
}

fn made_by_facts(made_by: &str, folder: &Path) -> Provenance {
    Provenance::from([
        ("made_by".to_owned(), made_by.to_owned()),
        ("folder".to_owned(), folder.display().to_string()),
    ])
}
