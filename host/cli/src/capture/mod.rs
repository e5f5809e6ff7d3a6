//! `gonia capture`: a session on a rig, or on the simulated one.

mod calibration;
mod map;
mod terminal;

use crate::progress::Progress;
use crate::say::errln;
use crate::{account, remarks, sample_facts, table};
use anyhow::{Context, Result, bail};
use gonia_acquire::capture::{
    ArmPortNames, Ended, Equipment, Orders, UnattendedSession, Watch, Watchers, free_mb,
    keep_apart, travelling,
};
use gonia_acquire::session::{
    Beginning, Claim, ControllerIdentity, Entry, GivenUp, RIG, SessionEnd, SessionFolder,
    SessionProvenance, SessionWriter,
};
use gonia_brdf::Pose;
use gonia_formats::frames_csv::write_frames_csv;
use gonia_formats::plan_csv::read_plan_csv;
use gonia_formats::rig_toml::read_rig;
use gonia_formats::samples::write_noted_samples;
use gonia_formats::{FileError, check_writable};
use gonia_live::{Listening, LivePage};
use gonia_pipeline::process::MASKS;
use gonia_plan::Rings;
use gonia_rig::{Reflectance, Rig, rig_remarks};
use std::net::SocketAddr;
use std::path::{Path, PathBuf};
use terminal::Terminal;

/// Measures a material: every pose of the plan, its frame, its samples.
#[derive(clap::Args)]
#[command(
    after_long_help = "Example:\n  gonia capture silk --rig rig.toml --plan plan.csv\n  gonia capture silk --rig rig.toml --resume\n  gonia capture trial --rig rig.toml --simulated --serve 127.0.0.1:8080\n  gonia capture silk --rig rig.toml --calibrate   # finds where light and camera are, first\n\nrig.toml says where the controllers and the frames are ([arms], [source]) and how the session goes\n([session]): docs/src/guides/night.md. Ctrl-C ends it at the next pose, a second one stops the arms now. After\nany end, also a power cut, --resume goes on."
)]
pub struct Capture {
    /// Folder of the session
    folder: PathBuf,
    /// The rig
    #[arg(long, value_name = "RIG.toml")]
    rig: PathBuf,
    /// The poses [default: the paper's plan, in travelling order]
    #[arg(long, value_name = "PLAN.csv")]
    plan: Option<PathBuf>,
    /// Go on with the session in the folder; begin one if there is none
    #[arg(long)]
    resume: bool,
    /// Poses to go on without, by their place in the plan, counted from 0
    #[arg(
        long,
        value_name = "POSE,…",
        value_delimiter = ',',
        requires = "resume"
    )]
    leave_out: Vec<usize>,
    /// Port of the light arm's controller [default: that of rig.toml]
    #[arg(long, value_name = "PORT")]
    light: Option<String>,
    /// Port of the camera arm's controller [default: that of rig.toml]
    #[arg(long, value_name = "PORT")]
    camera_arm: Option<String>,
    /// Arms and camera of the simulated rig, whatever rig.toml says
    #[arg(long, conflicts_with_all = ["light", "camera_arm"])]
    simulated: bool,
    /// Calibrate the rig first, from 60 frames over all directions, and go on with what they show
    #[arg(long)]
    calibrate: bool,
    /// Keep the frames too, as a capture folder
    #[arg(long)]
    keep_frames: bool,
    /// Serve a live page at this address: 127.0.0.1:8080, or port 0 for any that is free
    #[arg(long, value_name = "ADDRESS:PORT")]
    serve: Option<SocketAddr>,
    /// Let other computers see the live page too: --serve may name any address
    #[arg(long, requires = "serve")]
    serve_anywhere: bool,
}

/// A rig, with the files that it is kept in.
struct RigFile {
    rig: Rig,
    text: Vec<u8>,
    /// The file that it names, by its name.
    beside: Option<(String, Vec<u8>)>,
}

impl RigFile {
    fn read(path: &Path) -> Result<Self> {
        let rig = read_rig(path)?;
        remarks::print(&rig_remarks(path.display(), &rig));
        Ok(Self {
            text: std::fs::read(path).map_err(|error| FileError::reading(path, &error))?,
            beside: beside(path, &rig)?,
            rig,
        })
    }

    fn beside(&self) -> Option<(&str, &[u8])> {
        let (name, bytes) = self.beside.as_ref()?;
        Some((name, bytes))
    }
}

/// The session's folder, before the controllers are connected.
enum Folder {
    Fresh(Claim),
    Begun(Box<SessionWriter>),
}

impl Capture {
    /// Runs the command.
    pub fn run(self) -> Result<()> {
        let drawn = RigFile::read(&self.rig)?;
        let settings = drawn.rig.session.clone().unwrap_or_default();
        let is_calibrated = self.is_calibrated()?;
        // A port that is taken is found out before anything is begun.
        let listening = match self.serve {
            Some(address) => Some(Listening::at(address, self.serve_anywhere)?),
            None => None,
        };
        let (folder, plan) = self.folder_and_plan(&drawn)?;
        let orders = Orders::default();
        let on_interrupt = orders.clone();
        ctrlc::set_handler(move || on_interrupt.interrupt())
            .context("Ctrl-C cannot be caught on this system")?;
        let (there, used) = match is_calibrated {
            true => {
                self.keep_plan(&plan)?;
                (self.there(&drawn.rig), self.calibrated(&drawn, &orders)?)
            }
            false => (drawn.rig.clone(), drawn),
        };
        if let Folder::Begun(_) = folder {
            check_same(&self.folder.join(RIG), &used.text, &self.rig)?;
        }

        let (path, ports) = (&self.rig, self.ports());
        let mut equipment = Equipment::open(&there, path, ports, plan.len(), &settings, &orders)?;
        if let Some(warning) = equipment.arms.calibration_warning()? {
            errln!("warning: {warning}");
        }
        remarks::print(equipment.arms.exchange_remark().as_slice());
        equipment.check_reach(&plan)?;
        let provenance = provenance_of(&mut equipment, settings.reference);
        let mut writer = match folder {
            Folder::Begun(writer) => *writer,
            Folder::Fresh(claim) => claim.begin(Beginning {
                rig: &used.text,
                beside: used.beside(),
                plan: &plan,
                provenance: &provenance,
            })?,
        };
        let session = SessionFolder::open(&self.folder)?;
        check_equipment(session.provenance(), &provenance)?;
        writer.note(&Entry::Start(format!(
            "{}, light arm {}, camera arm {}",
            provenance.program, provenance.light_arm.config_crc, provenance.camera_arm.config_crc
        )))?;
        self.leave_out(&mut writer, &session)?;
        if self.keep_frames {
            check_writable(&self.folder.join("frames"))?;
        }
        let terminal = Terminal::new(&session);
        let live = match listening {
            Some(listening) => Some(LivePage::serve(listening, &session, &orders)?),
            None => None,
        };
        live.iter().for_each(say_where);
        let watchers: Vec<&dyn Watch> = match &live {
            Some(live) => vec![&terminal, live],
            None => vec![&terminal],
        };
        let run = UnattendedSession {
            rig: session.rig(),
            settings: &settings,
            keep_frames: self.keep_frames.then(|| self.folder.clone()),
            is_calibration: false,
            exact: equipment.exact,
            orders: &orders,
            watch: &Watchers(watchers),
            free_mb: &free_mb,
        };
        let ended = run.run(&mut equipment.arms, equipment.camera, writer, &session)?;
        terminal.finish();
        if let Some(live) = &live {
            live.end(ended.end, &ended.reason);
        }
        self.conclude(&ended)
    }

    fn ports(&self) -> ArmPortNames<'_> {
        ArmPortNames {
            light: self.light.as_deref(),
            camera: self.camera_arm.as_deref(),
            simulated: self.simulated,
        }
    }

    /// The session's folder, locked, and its poses: of the session in it, or of a new one.
    fn folder_and_plan(&self, drawn: &RigFile) -> Result<(Folder, Vec<Pose>)> {
        if !(self.resume && SessionFolder::is_session(&self.folder)) {
            let claim = Claim::new(&self.folder, drawn.beside().map(|b| b.0))?;
            let plan = match self.plan_of_calibration()? {
                Some(plan) => plan,
                None => self.fresh_plan(&drawn.rig)?,
            };
            return Ok((Folder::Fresh(claim), plan));
        }
        let (writer, session) = SessionWriter::resume(&self.folder)?;
        let plan = session.plan().to_vec();
        if let Some(path) = &self.plan
            && read_plan_csv(path)? != plan
        {
            bail!(
                "{}: is not the plan that the session began with; leave --plan out, or begin a session in another folder",
                path.display()
            );
        }
        Ok((Folder::Begun(Box::new(writer)), plan))
    }

    /// Notes the poses that a person leaves out. A pose that is done stays.
    fn leave_out(&self, writer: &mut SessionWriter, session: &SessionFolder) -> Result<()> {
        let planned = session.plan().len();
        if let Some(index) = self.leave_out.iter().find(|index| **index >= planned) {
            bail!(
                "--leave-out {index}: the plan has {planned} poses, counted from 0; see given-up in {}",
                self.folder.join("journal.log").display()
            );
        }
        for role in session.roles() {
            for index in writer.state().missing(*role) {
                if self.leave_out.contains(&index) && !writer.state().role(*role).is_left_out(index)
                {
                    writer.note(&Entry::GivenUp(GivenUp {
                        role: *role,
                        index,
                        why: "left out by hand".into(),
                        is_left_out: true,
                    }))?;
                }
            }
        }
        Ok(())
    }

    fn fresh_plan(&self, rig: &Rig) -> Result<Vec<Pose>> {
        let plan = match &self.plan {
            Some(path) => read_plan_csv(path)?,
            None => {
                let mut plan = travelling(&Rings::paper());
                if let Some(arms) = rig.arms.as_ref().filter(|arms| arms.keep_out_deg > 0.0) {
                    keep_apart(&mut plan, arms.keep_out_deg);
                }
                plan.poses
            }
        };
        if plan.is_empty() {
            bail!("the plan has no pose: make one with gonia plan");
        }
        Ok(plan)
    }

    /// Samples of what is finished, the table, and the exit code.
    fn conclude(&self, ended: &Ended) -> Result<()> {
        let session = SessionFolder::open(&self.folder)?;
        list_frames(&session)?;
        table::print(&describe(&session, ended));
        if ended.end != SessionEnd::Finished {
            let (done, planned) = (
                session.done().count(),
                session.roles().len() * session.plan().len(),
            );
            bail!(
                "the session has ended after {done} of {planned} poses: {}",
                ended.reason
            );
        }
        let progress = Progress::new();
        let processed = session
            .samples(&progress.watch())
            .context("the session is complete, but gives no samples yet")?;
        let facts = sample_facts::of_session("gonia capture", &session);
        let note = processed.note(session.rig(), facts);
        write_noted_samples(&self.folder.join("samples.npy"), &processed.samples, &note)?;
        if !processed.masks.is_empty() {
            let path = self.folder.join(MASKS);
            processed.masks.write(&path, session.rig())?;
        }
        table::print(&account::describe(&processed));
        Ok(())
    }
}

/// What the session is measured with. Checksums of its files and its time are put in when it begins.
fn provenance_of(equipment: &mut Equipment, reference: bool) -> SessionProvenance {
    SessionProvenance {
        program: gonia_pipeline::provenance::program(),
        began: String::new(),
        rig_crc: String::new(),
        plan_crc: String::new(),
        reference_crc: None,
        reference,
        camera: equipment.camera.identity(),
        seed: equipment.seed,
        light_arm: ControllerIdentity::from(equipment.arms.light().identity()),
        camera_arm: ControllerIdentity::from(equipment.arms.camera().identity()),
    }
}

/// Where the live page is. What is behind the # no browser sends on.
fn say_where(live: &LivePage) {
    let (address, token) = (live.address(), live.token());
    errln!("live page: http://{address}/#token={token}");
    errln!("without the token the page only shows: http://{address}/");
}

/// The file that a rig names, beside it.
fn beside(path: &Path, rig: &Rig) -> Result<Option<(String, Vec<u8>)>, FileError> {
    let reflectance = rig.reference.as_ref().map(|of| &of.reflectance);
    let Some(Reflectance::Table { file, .. }) = reflectance else {
        return Ok(None);
    };
    let table = path.with_file_name(file);
    let bytes = std::fs::read(&table).map_err(|error| FileError::reading(&table, &error))?;
    Ok(Some((file.clone(), bytes)))
}

fn check_same(kept: &Path, text: &[u8], given: &Path) -> Result<()> {
    let begun = std::fs::read(kept).map_err(|error| FileError::reading(kept, &error))?;
    if begun != text {
        bail!(
            "{}: is not the rig that the session began with ({}); restore it, or begin a session in another folder",
            given.display(),
            kept.display()
        );
    }
    Ok(())
}

/// A session goes on with what it began with.
fn check_equipment(began: &SessionProvenance, now: &SessionProvenance) -> Result<()> {
    for (name, began, now) in [
        ("light arm", &began.light_arm, &now.light_arm),
        ("camera arm", &began.camera_arm, &now.camera_arm),
    ] {
        if began.config_crc != now.config_crc {
            bail!(
                "{name}: its settings ({}) are not those that the session began with ({}); restore them with gonia device, or begin a new session",
                now.config_crc,
                began.config_crc
            );
        }
        if (&began.board, &began.firmware) != (&now.board, &now.firmware) {
            errln!(
                "warning: {name}: the session began with {} {}, and goes on with {} {}",
                began.board,
                began.firmware,
                now.board,
                now.firmware
            );
        }
    }
    if !is_same_camera(&began.camera, &now.camera) {
        bail!(
            "the frames come from \"{}\", and those of the session came from \"{}\"; restore [source], or begin a new session",
            now.camera,
            began.camera
        );
    }
    Ok(())
}

/// An older program kept the path of a folder as it was given.
fn is_same_camera(began: &str, now: &str) -> bool {
    let folder = |camera: &str| std::fs::canonicalize(camera.strip_prefix("folder ")?).ok();
    began == now || folder(began).is_some_and(|began| folder(now) == Some(began))
}

/// `frames.csv` of the raw frames that are kept, if any are.
fn list_frames(session: &SessionFolder) -> Result<()> {
    let mut rows = session.rows()?;
    for row in &mut rows {
        row.file = format!("frames/{}_{:06}.exr", row.role.name(), row.frame);
    }
    rows.retain(|row| session.folder().join(&row.file).is_file());
    if !rows.is_empty() {
        write_frames_csv(&session.folder().join("frames.csv"), &rows)?;
    }
    Ok(())
}

fn describe(session: &SessionFolder, ended: &Ended) -> Vec<(String, String)> {
    let planned = session.roles().len() * session.plan().len();
    let took_s = ended.took.as_secs_f64();
    let active_s = ended
        .took
        .saturating_sub(ended.paused)
        .as_secs_f64()
        .max(1e-9);
    let mut rows = vec![
        (
            "poses".to_owned(),
            format!("{} of {planned}", session.done().count()),
        ),
        (
            "this run".into(),
            format!(
                "{} ({} on the arms' clock), {} shots, {} taken again by the arms and {} for their frames, {} faults recovered automatically",
                table::duration(took_s),
                table::duration(ended.arms.duration_us as f64 * 1e-6),
                ended.arms.kept,
                ended.arms.retakes,
                ended.retaken,
                ended.arms.recoveries
            ),
        ),
        (
            "pointing error".into(),
            format!(
                "at most {:.4} degrees by encoder",
                ended.arms.max_pointing_error_deg
            ),
        ),
    ];
    // Time on a simulated rig stands still while the host works.
    if session.provenance().seed.is_none() {
        rows.push((
            "arms waited for the host".into(),
            format!(
                "{} ({:.2} %)",
                table::duration(ended.waited.as_secs_f64()),
                100.0 * ended.waited.as_secs_f64() / active_s
            ),
        ));
    }
    rows
}
