//! A small session on the simulated rig.

use gonia_acquire::session::{
    Beginning, Claim, ControllerIdentity, Entry, SessionProvenance, SessionWriter,
};
use gonia_brdf::{Direction, Pose};
use gonia_formats::plan_csv::write_plan_csv;
use gonia_formats::rig_toml::write_rig;
use gonia_rig::{Reference, Rig, SessionSettings, Source};
use std::path::Path;

/// A rig whose frames are small, and whose every take is the same.
pub fn small_rig() -> Rig {
    let mut rig = Rig::paper(100);
    rig.sampling.grid_mm = 40.0;
    rig.sampling.patch_mm = 28.0;
    rig.reference = Some(Reference::lambertian([0.9, 0.8, 0.7]));
    rig.source = Some(Source::Simulated {
        seed: 1,
        exact: true,
    });
    rig.session = Some(SessionSettings {
        control_every: 7,
        pause_s: 1.0,
        max_retries: 3,
        disk_reserve_mb: 1,
        ..SessionSettings::default()
    });
    rig
}

/// Poses near each other, so that the arms are quick.
pub fn small_plan(n: usize) -> Vec<Pose> {
    (0..n)
        .map(|i| Pose {
            light: Direction::from_deg(25.0 + (i % 5) as f64, 170.0 + (i / 5) as f64),
            view: Direction::from_deg(10.0 + (i % 3) as f64, 175.0),
        })
        .collect()
}

/// Writes rig.toml and plan.csv into a folder.
#[allow(dead_code)]
pub fn write_small(folder: &Path, rig: &Rig, n: usize) {
    write_rig(&folder.join("rig.toml"), rig).unwrap();
    write_plan_csv(&folder.join("plan.csv"), &small_plan(n)).unwrap();
}

/// Begins a session over the small plan, without controllers.
#[allow(dead_code)]
pub fn begin(folder: &Path, rig: &Rig, n: usize) -> SessionWriter {
    let arm = ControllerIdentity {
        board: "sim".into(),
        firmware: String::new(),
        config_crc: String::new(),
    };
    let provenance = SessionProvenance {
        program: "test".into(),
        began: String::new(),
        rig_crc: String::new(),
        plan_crc: String::new(),
        reference_crc: None,
        reference: rig.session.as_ref().unwrap().reference,
        camera: "of a test".into(),
        seed: Some(1),
        light_arm: arm.clone(),
        camera_arm: arm,
    };
    let text = tempfile::tempdir().unwrap();
    let path = text.path().join("rig.toml");
    write_rig(&path, rig).unwrap();
    let beginning = Beginning {
        rig: &std::fs::read(path).unwrap(),
        beside: None,
        plan: &small_plan(n),
        provenance: &provenance,
    };
    let mut writer = Claim::new(folder, None).unwrap().begin(beginning).unwrap();
    writer.note(&Entry::Start("test".into())).unwrap();
    writer
}
