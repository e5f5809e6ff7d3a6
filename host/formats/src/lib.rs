//! Files: rigs, capture folders, samples, plans, dense BRDFs, summaries.
//!
//! Every reader refuses what it cannot trust with a [`FileError`]: one line that says which file,
//! where in it, and what to do. Every writer goes through [`write_whole`], so that no half-written
//! file ever stands under its final name.
//!
//! | module | what it reads and writes |
//! |---|---|
//! | [`dense`] | dense BRDFs, whole, by rows or cell by cell, in any format of the table |
//! | [`samples`] | samples, in any format of the table |
//! | [`foreign`] | other groups' measurements, to be imported |
//! | [`export`] | dense BRDFs in other programs' formats |
//! | [`CaptureFolder`], [`frames_csv`], [`frame_exr`], [`raw_frame`] | a session's frames, raw or as radiance |
//! | [`rig_toml`], [`plan_csv`], [`masks_csv`], [`cell_mask`], [`directions_csv`] | what a session is made by and leaves behind |
//! | [`fill_parts`], [`Scratch`] | what a fill keeps on the disk: one that several processes share, or one of rows |
//! | [`checksum`] | what ties a note to the file that it was written of |
//! | [`material`] | fitted models as materials of other programs |
//! | [`Summary`], [`fit_toml`], [`baselines_toml`] | what a run found, for the report |
//! | [`photo`], [`toml_text`] | pictures from outside; TOML with errors that name the line |
//!
//! A new format of dense BRDFs, of samples or of another group is one file that defines a `Format`
//! (`dense_exr.rs` and `utia.rs` are examples), and one row in `table.rs`.

mod alta;
mod astm;
pub mod baselines_toml;
mod capture_folder;
pub mod cell_mask;
pub mod checksum;
mod column_name;
mod decimal;
pub mod dense;
mod dense_exr;
pub mod directions_csv;
mod dng;
mod encoding;
mod error;
mod error_exr;
pub mod export;
mod exr_blocks;
mod exr_channels;
mod exr_colours;
mod exr_header;
mod exr_planes;
mod exr_rows;
pub mod fill_parts;
pub mod fit_source;
pub mod fit_toml;
mod floats;
pub mod foreign;
mod format;
pub mod frame_exr;
pub mod frames_csv;
mod lossless_jpeg;
pub mod masks_csv;
pub mod material;
mod merl;
mod named_table;
mod ngan;
mod npy;
mod npy_literal;
mod npy_samples;
mod npy_type;
mod odd_samples;
pub mod photo;
pub mod plan_csv;
mod raw_file;
pub mod raw_frame;
mod raw_png;
mod raw_tiff;
mod read_at;
mod reflectance_csv;
mod rgl;
pub mod rig_toml;
mod sample_columns;
mod sample_note;
mod sample_rows;
pub mod samples;
mod samples_csv;
mod samples_npy;
mod samples_npz;
mod scratch;
mod summary;
mod table;
mod text_fields;
mod text_file;
mod text_lines;
mod text_table;
mod text_top;
mod tiff_tags;
pub mod toml_text;
mod utia;
mod whole_file;

pub use capture_folder::CaptureFolder;
pub use error::{FileError, one_line};
pub use scratch::Scratch;
pub use summary::{
    BinCounts, CellCounts, FileNote, FrameCounts, Pointing, PoseCounts, Refused, Stage, Summary,
};
pub use whole_file::{
    check_output, check_writable, check_writable_beside, is_same_file, write_whole,
    write_whole_bytes,
};
