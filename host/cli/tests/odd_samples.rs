//! Files of samples as people have them: `gonia fill` reads them as it reads its own, says what it
//! assumed, or refuses what can be read in two ways.
#![allow(clippy::unwrap_used)]

mod common;

#[path = "common/cases.rs"]
mod cases;

use cases::{Case, document};
use common::{gonia, gonia_ok, text};
use gonia_brdf::Elementary;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;

const DIRECTIONS: &str = "theta_i,phi_i,theta_v,phi_v\n0,0,0,0\n30,45,60,225\n50,300,20,10\n";
const NAMES: &str = "theta_i,phi_i,theta_v,phi_v,r,g,b";

/// What must be said of a file.
enum Expected {
    /// Nothing: the dense BRDF is that of the usual file.
    Read,
    /// The same BRDF, with a warning that has these words.
    Warned(&'static str),
    /// An error of one line that has these words.
    Refused(&'static str),
}

/// What came in, the name and the bytes of its file, and what is said of it.
type File = (&'static str, &'static str, Vec<u8>, Expected);

/// Samples of a broad lobe on a matte ground, spread evenly, each number as a CSV has it.
fn rows() -> Vec<[f64; 7]> {
    // Steps of the additive sequence that fills four dimensions evenly (Roberts 2018).
    let root = 1.167_303_978_261_418_7_f64;
    let place = |k: usize, d: i32| (0.5 + k as f64 * root.powi(-d)).fract();
    let rounded = |v: f64| (v * 1e4).round() / 1e4;
    let row = |k: usize| {
        let [u, v] =
            [place(k, 1), place(k, 2)].map(|p| rounded((p * 0.96).sqrt().arc_sine().to_degrees()));
        let [i, o] = [place(k, 3), place(k, 4)].map(|p| rounded(360.0 * p));
        let direction = |theta: f64, phi: f64| {
            let (theta, phi) = (theta.to_radians(), phi.to_radians());
            [
                theta.sine() * phi.cosine(),
                theta.sine() * phi.sine(),
                theta.cosine(),
            ]
        };
        let (light, view) = (direction(u, i), direction(v, o));
        let half = [0, 1, 2].map(|a| light[a] + view[a]);
        let length = half.iter().map(|a| a * a).sum::<f64>().sqrt();
        let lobe = 0.3 * (4.0 * (half[2] / length - 1.0)).exponential();
        let value = rounded(0.05 + lobe);
        [u, i, v, o, value, value, value]
    };
    (1..=400).map(row).collect()
}

/// A table with these names, separator and mark of decimals.
fn table(names: &str, separator: &str, mark: &str, columns: usize) -> String {
    let mut table = names.replace(',', separator);
    table.push('\n');
    for row in rows() {
        let fields: Vec<String> = row[..columns]
            .iter()
            .map(|v| v.to_string().replace('.', mark))
            .collect();
        let _ = writeln!(table, "{}", fields.join(separator));
    }
    table
}

fn npy(descr: &str, fortran: &str, shape: &str, numbers: &[u8]) -> Vec<u8> {
    let header = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(numbers);
    bytes
}

/// A zip archive whose members are not compressed.
fn stored(members: &[(&str, &[u8])]) -> Vec<u8> {
    let (mut bytes, mut directory) = (Vec::new(), Vec::new());
    for (name, content) in members {
        let crc = !content.iter().fold(!0u32, |crc, byte| {
            (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
                (crc >> 1) ^ (0xedb8_8320 * (crc & 1))
            })
        });
        let size = (content.len() as u32).to_le_bytes();
        let mut about = vec![20, 0, 0, 0, 0, 0, 0, 0, 33, 0];
        about.extend([crc.to_le_bytes(), size, size].concat());
        about.extend([(name.len() as u16).to_le_bytes(), [0; 2]].concat());
        directory.extend([&b"PK\x01\x02\x14\0"[..], &about, &[0; 10]].concat());
        directory.extend((bytes.len() as u32).to_le_bytes());
        directory.extend(name.as_bytes());
        bytes.extend([b"PK\x03\x04", &about[..], name.as_bytes(), content].concat());
    }
    let count = (members.len() as u16).to_le_bytes();
    let [size, at] = [directory.len(), bytes.len()].map(|n| (n as u32).to_le_bytes());
    let end = [
        b"PK\x05\x06\0\0\0\0",
        &count[..],
        &count,
        &size,
        &at,
        &[0; 2],
    ]
    .concat();
    [bytes, directory, end].concat()
}

fn doubles(numbers: impl IntoIterator<Item = f64>) -> Vec<u8> {
    numbers.into_iter().flat_map(f64::to_le_bytes).collect()
}

fn by_columns() -> impl Iterator<Item = f64> {
    (0..7).flat_map(|c| rows().into_iter().map(move |row| row[c]))
}

/// The samples of a fill, as values at a few directions.
fn filled(dir: &Path, name: &str) -> (std::process::Output, Option<String>) {
    let (samples, dense) = (dir.join(name), dir.join("d.exr"));
    let _ = fs::remove_file(&dense);
    let arguments = [
        "fill",
        text(&samples),
        "-o",
        text(&dense),
        "--step",
        "10",
        "--preset",
        "preview",
    ];
    let output = gonia(&arguments, "");
    let values = dense
        .exists()
        .then(|| gonia_ok(&["query", text(&dense)], DIRECTIONS));
    (output, values.map(|printed| as_colours(&printed)))
}

/// Rows that end in one value as those of the grey that it is.
fn as_colours(printed: &str) -> String {
    let Some((header, rows)) = printed.split_once(",Y\n") else {
        return printed.to_owned();
    };
    let mut colours = format!("{header},r,g,b\n");
    for row in rows.lines() {
        let value = row.rsplit(',').next().unwrap_or_default();
        let _ = writeln!(colours, "{row},{value},{value}");
    }
    colours
}

fn check(files: Vec<File>) -> Vec<Case> {
    let dir = tempfile::tempdir().unwrap();
    fs::write(dir.path().join("usual.csv"), table(NAMES, ",", ".", 7)).unwrap();
    let (output, usual) = filled(dir.path(), "usual.csv");
    assert!(
        usual.is_some(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let mut cases = Vec::new();
    for (came_in, name, bytes, expected) in files {
        fs::write(dir.path().join(name), bytes).unwrap();
        let (output, values) = filled(dir.path(), name);
        let case = Case::new(came_in, &output, dir.path(), &[]);
        let said = case.said();
        let (code, words, result) = match expected {
            Expected::Read => (0, "", &usual),
            Expected::Warned(words) => (0, words, &usual),
            Expected::Refused(words) => (1, words, &None),
        };
        assert_eq!(case.code(), code, "{came_in}: {said}");
        assert!(said.contains(words), "{came_in}: {said}");
        assert_eq!(said.is_empty(), words.is_empty(), "{came_in}: {said}");
        assert_eq!(values, *result, "{came_in}: {said}");
        cases.push(case);
    }
    cases
}

// long: a table, one entry a case.
fn tables_that_are_read() -> Vec<File> {
    let usual = || table(NAMES, ",", ".", 7);
    let named = |names: &str| table(names, ",", ".", 7).into_bytes();
    let utf16 = || {
        usual()
            .encode_utf16()
            .flat_map(u16::to_le_bytes)
            .collect::<Vec<u8>>()
    };
    let temperature = usual()
        .replace('\n', ",21\n")
        .replacen(",21", ",Temperatur [°C]", 1);
    use Expected::{Read, Warned};
    vec![
        (
            "semicolons and decimal commas, a byte-order mark, CRLF (a German spreadsheet)",
            "s.csv",
            format!("\u{feff}{}", table(NAMES, ";", ",", 7))
                .replace('\n', "\r\n")
                .into(),
            Read,
        ),
        ("tabs", "s.tsv", table(NAMES, "\t", ".", 7).into(), Read),
        ("blanks", "s.txt", table(NAMES, "  ", ".", 7).into(), Read),
        (
            "a first line `sep=,`",
            "s.csv",
            format!("sep=,\n{}", usual()).into(),
            Read,
        ),
        (
            "the header in a comment (`numpy.savetxt`)",
            "s.csv",
            format!("# {}", usual()).into(),
            Read,
        ),
        (
            "UTF-16",
            "s.csv",
            [b"\xff\xfe".to_vec(), utf16()].concat(),
            Read,
        ),
        (
            "another column with a Latin-1 letter in its name",
            "s.csv",
            temperature.chars().map(|letter| letter as u8).collect(),
            Read,
        ),
        (
            "`Theta_i`, `R`",
            "s.csv",
            named("Theta_i,Phi_i,Theta_v,Phi_v,R,G,B"),
            Read,
        ),
        (
            "`theta_i [deg]`",
            "s.csv",
            named("theta_i [deg],phi_i [deg],theta_v [deg],phi_v [deg],R,G,B"),
            Read,
        ),
        (
            "`theta_in`, `theta_out`",
            "s.csv",
            named("theta_in,phi_in,theta_out,phi_out,R,G,B"),
            Read,
        ),
        (
            "one channel, `brdf`",
            "s.csv",
            table("theta_i,phi_i,theta_v,phi_v,brdf", ",", ".", 5).into(),
            Read,
        ),
        (
            "one channel, `Y`",
            "s.csv",
            table("theta_i,phi_i,theta_v,phi_v,Y", ",", ".", 5).into(),
            Read,
        ),
        (
            "a line of units below the header",
            "s.csv",
            usual()
                .replacen('\n', "\ndeg,deg,deg,deg,1/sr,1/sr,1/sr\n", 1)
                .into(),
            Read,
        ),
        (
            "no header, seven columns",
            "s.csv",
            usual().split_once('\n').unwrap().1.into(),
            Warned(
                "has no header: its 7 columns were taken for theta_i, phi_i, theta_v, phi_v, r, g, b",
            ),
        ),
        (
            "degrees in columns named as radians",
            "s.csv",
            named("theta_i_rad,phi_i_rad,theta_v_rad,phi_v_rad,r,g,b"),
            Expected::Refused("is too much for the radians of its column's name"),
        ),
    ]
}

fn tables_that_are_refused() -> Vec<File> {
    use Expected::Refused;
    vec![
        (
            "a column missing",
            "s.csv",
            table("theta_i,phi_i,theta_v,r,g,b", ",", ".", 6).into(),
            Refused("there is no column for phi_v; found: theta_i, phi_i, theta_v, r, g, b"),
        ),
        (
            "decimal commas between commas",
            "s.csv",
            table(NAMES, ",", ",", 7).into(),
            Refused("decimal commas cannot be told from commas between fields"),
        ),
        (
            "decimal commas and points",
            "s.csv",
            table(NAMES, ";", ".", 7).replacen('.', ",", 1).into(),
            Refused("has a decimal point, numbers from line 2 on have a comma"),
        ),
        (
            "no header, one channel, decimal commas between commas",
            "s.csv",
            "30,0,45,180,0,123\n40,0,45,180,0,145\n".into(),
            Refused("its commas may separate numbers or be decimal ones"),
        ),
        (
            "two columns for the view's polar angle",
            "s.csv",
            table("theta_i,phi_i,theta_o,phi_o,theta_r,g,b", ",", ".", 7).into(),
            Refused("theta_o and theta_r are columns of the same quantity"),
        ),
        (
            "a spreadsheet's own file under the name `.csv`",
            "s.csv",
            stored(&[("xl/workbook.xml", b"<workbook/>")]),
            Refused("is a zip archive that holds no array"),
        ),
        (
            "frame 4294967295, which stands for none",
            "s.csv",
            "theta_i,phi_i,theta_v,phi_v,brdf,frame\n1,2,3,4,.5,4294967295\n".into(),
            Refused("frame 4294967295 is no number of a frame"),
        ),
    ]
}

// long: a table, one entry a case.
fn arrays() -> Vec<File> {
    use Expected::{Read, Refused};
    let by_rows = || rows().into_iter().flatten();
    let records = "[('theta_in', '<f8'), ('phi_in', '<f8'), ('theta_out', '<f8'), ('phi_out', '<f8'), ('rgb', '<f8', (3,))]";
    let big: Vec<u8> = by_rows().flat_map(f64::to_be_bytes).collect();
    let one = rows().into_iter().flat_map(|row| row.into_iter().take(5));
    let seven = npy("'<f8'", "False", "(400, 7)", &doubles(by_rows()));
    let single: Vec<u8> = [30.0f32, 0.0, 45.0, 90.0, 0.1, 0.1, 0.1, 16_777_216.0]
        .into_iter()
        .flat_map(f32::to_le_bytes)
        .collect();
    vec![
        (
            "`.npy` of float64",
            "s.npy",
            npy("'<f8'", "False", "(400, 7)", &doubles(by_rows())),
            Read,
        ),
        (
            "`.npy`, big-endian",
            "s.npy",
            npy("'>f8'", "False", "(400, 7)", &big),
            Read,
        ),
        (
            "`.npy` in Fortran order",
            "s.npy",
            npy("'<f8'", "True", "(400, 7)", &doubles(by_columns())),
            Read,
        ),
        (
            "`.npy`, columns first",
            "s.npy",
            npy("'<f8'", "False", "(7, 400)", &doubles(by_columns())),
            Read,
        ),
        (
            "`.npy` of records",
            "s.npy",
            npy(records, "False", "(400,)", &doubles(by_rows())),
            Read,
        ),
        (
            "`.npy`, N × 5 (one channel)",
            "s.npy",
            npy("'<f8'", "False", "(400, 5)", &doubles(one)),
            Read,
        ),
        (
            "`.npz` of one array",
            "s.npz",
            stored(&[("arr_0.npy", &seven)]),
            Read,
        ),
        (
            "`.npz` of several arrays, one named `samples`",
            "s.npz",
            stored(&[("reference.npy", &seven), ("samples.npy", &seven)]),
            Read,
        ),
        (
            "`.npz` of two arrays that may be the samples",
            "s.npz",
            stored(&[("run1.npy", &seven), ("run2.npy", &seven)]),
            Refused("several of its arrays may be the samples: run1 (400 × 7), run2 (400 × 7)"),
        ),
        (
            "`.npy` of float32 with frame 16777216",
            "s.npy",
            npy("'<f4'", "False", "(1, 8)", &single),
            Refused("frame 16777216 cannot be told from its neighbours"),
        ),
        (
            "`.npy` of complex numbers",
            "s.npy",
            npy("'<c16'", "False", "(1, 7)", &[0; 112]),
            Refused("holds '<c16'"),
        ),
        (
            "`.npy` of 20 × 4",
            "s.npy",
            npy("'<f8'", "False", "(20, 4)", &[0; 640]),
            Refused("has the shape 20 × 4"),
        ),
        (
            "`.npy` that claims more than it has",
            "s.npy",
            npy("'<f8'", "False", "(99999999999, 7)", &[0; 640]),
            Refused("is cut short: its header promises 99999999999 × 7"),
        ),
    ]
}

#[test]
fn files_of_samples_are_read_or_refused_aloud() {
    let mut files = tables_that_are_read();
    files.extend(tables_that_are_refused());
    files.extend(arrays());
    document("samples", &check(files));
}
