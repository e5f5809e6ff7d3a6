//! Files: rigs, capture folders, samples, plans, dense BRDFs, summaries.
//!
//! Every reader refuses what it cannot trust with a [`FileError`]: one line that says which file,
//! where in it, and what to do. Every writer goes through [`write_whole`], so that no half-written
//! file ever stands under its final name.

pub mod capture_folder;
pub mod cell_mask;
mod csv_table;
pub mod dense_exr;
pub mod error;
pub mod error_exr;
mod exr_planes;
mod exr_rows;
pub mod fit_toml;
pub mod frame_exr;
pub mod frames_csv;
pub mod masks_csv;
pub mod merl;
pub mod ngan;
mod npy;
pub mod photo;
pub mod plan_csv;
pub mod raw_frame;
pub mod reflectance_csv;
pub mod rig_toml;
pub mod rivals_toml;
pub mod samples;
mod samples_csv;
mod samples_npy;
pub mod summary;
pub mod toml_text;
pub mod utia;
pub mod whole_file;

pub use capture_folder::CaptureFolder;
pub use error::FileError;
pub use summary::Summary;
pub use whole_file::{check_writable, check_writable_beside, write_whole, write_whole_bytes};
