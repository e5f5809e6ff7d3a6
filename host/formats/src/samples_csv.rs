//! Samples as `.csv`, and as other tables of text.

use crate::format::{ChannelsRead, Content, Format, SampleFormat, SampleNote, SampleWriter};
use crate::sample_columns::{NumberRow, SampleColumns};
use crate::sample_note::write_comments;
use crate::sample_rows::{
    BadRow, COLUMNS, LAST_FRAME, frame_in_file, frame_of_number, have_frames,
};
use crate::text_file::{read_first_lines, read_text};
use crate::text_table::{Rows, TextTable};
use crate::{FileError, write_whole};
use gonia_brdf::Sample;
use gonia_rig::{ChannelSamples, Channels, Remark};
use std::io::Write;
use std::path::Path;
use std::str::FromStr;

/// Four angles and a value: fewer numbers make no sample.
const LEAST_COLUMNS: usize = 5;

/// A table of text with the columns' names above it.
pub(super) static FORMAT: Format = Format {
    name: "CSV",
    endings: &["csv"],
    magic: &[],
    content: Content::Samples(SampleFormat {
        read,
        write: Some(SampleWriter {
            rgb: write,
            channels: write_channels,
        }),
        holds_notes: true,
    }),
};

/// Whether a file is a table of text whose header names the columns of samples.
pub(super) fn names_samples(path: &Path) -> bool {
    let table =
        read_first_lines(path).map(|text| TextTable::new(path, text, LEAST_COLUMNS, &is_header));
    let header = table.and_then(|table| table.header);
    header.is_some_and(|header| is_header(&header.names))
}

fn is_header(names: &[String]) -> bool {
    SampleColumns::by_names(names).is_ok()
}

/// A table of text that may hold samples.
pub(super) fn table(path: &Path) -> Result<TextTable, FileError> {
    let text = read_text(path)?;
    Ok(TextTable::new(path, text, LEAST_COLUMNS, &is_header))
}

/// Reads samples from a table of text.
pub(super) fn read(path: &Path) -> Result<ChannelsRead, FileError> {
    let table = table(path)?;
    let (columns, assumed) = columns_of(path, &table)?;
    let mut rows = table.rows();
    let mut samples = columns.room(0);
    while rows.advance()? {
        let mut row = Numbers {
            rows: &mut rows,
            table: &table,
        };
        let pushed = columns.push(&mut row, &mut samples);
        pushed.map_err(|bad| match &assumed {
            None => table.wrong(rows.line(), bad.problem, bad.remedy),
            Some(_) => table.wrong(
                rows.line(),
                format_args!(
                    "{} (the columns, which have no names, were taken for {})",
                    bad.problem,
                    columns.text()
                ),
                format_args!("{}, or name the columns in the first line", bad.remedy),
            ),
        })?;
    }
    if samples.is_empty() {
        return Err(FileError::new(
            path,
            "has no rows",
            "give a row for each sample",
        ));
    }
    if assumed.is_some() && table.is_separated_by_commas() && !rows.had_decimals() {
        return Err(FileError::new(
            path,
            "has no header and no decimal point: its commas may separate numbers or be decimal ones",
            "name the columns in the first line, separated by semicolons where decimals follow commas",
        ));
    }
    let remarks = columns.remarks(path).chain(assumed).collect();
    Ok(ChannelsRead {
        remarks,
        ..samples.into()
    })
}

/// The columns by their names; by their number where there are none, with what was assumed.
fn columns_of(
    path: &Path,
    table: &TextTable,
) -> Result<(SampleColumns, Option<Remark>), FileError> {
    if let Some(header) = &table.header {
        let columns = SampleColumns::by_names(&header.names)
            .map_err(|unclear| table.wrong(header.line, unclear.problem, unclear.remedy))?;
        return Ok((columns, None));
    }
    let remedy = format!("name them in the first line: {}", COLUMNS.join(","));
    if table.columns == 0 {
        return Err(FileError::new(path, "holds no table of samples", remedy));
    }
    let columns = SampleColumns::by_count(table.columns).ok_or_else(|| {
        let found = format_args!("has {} columns without names", table.columns);
        FileError::new(path, found, &remedy)
    })?;
    let remark = Remark::new(
        path.display(),
        format_args!(
            "has no header: its {} columns were taken for {}",
            table.columns,
            columns.text()
        ),
        "name them in the first line if they are others",
    );
    Ok((columns, Some(remark)))
}

/// The current row, whose errors name the column.
struct Numbers<'a, 'b> {
    rows: &'a mut Rows<'b>,
    table: &'a TextTable,
}

impl Numbers<'_, '_> {
    fn number<T: FromStr>(&mut self, column: usize) -> Result<T, BadRow> {
        let name = self
            .table
            .header
            .as_ref()
            .map(|header| &header.names[column]);
        self.rows
            .number(column)
            .map_err(|(problem, remedy)| BadRow {
                problem: match name {
                    Some(name) => format!("{name} {problem}"),
                    None => format!("field {} {problem}", column + 1),
                },
                remedy,
            })
    }
}

impl NumberRow for Numbers<'_, '_> {
    fn single(&mut self, column: usize) -> Result<f32, BadRow> {
        self.number(column)
    }

    fn double(&mut self, column: usize) -> Result<f64, BadRow> {
        self.number(column)
    }

    fn frame(&mut self, column: usize) -> Result<u32, BadRow> {
        if self.rows.text(column).is_empty() {
            return Ok(Sample::NO_FRAME);
        }
        frame_of_number(self.number(column)?, LAST_FRAME)
    }
}

fn write(path: &Path, samples: &[Sample], note: Option<&SampleNote>) -> Result<(), FileError> {
    let values = samples.iter().map(|s| &s.rgb[..]);
    let names = Channels::Rgb.column_names();
    write_rows(path, &names, samples, values, note)
}

/// As [`write`], with a standard uncertainty beside each value.
pub(super) fn write_with_u(
    path: &Path,
    samples: &[Sample],
    u: &[[f32; 3]],
    note: Option<&SampleNote>,
) -> Result<(), FileError> {
    let values: Vec<[f32; 6]> = samples
        .iter()
        .zip(u)
        .map(|(s, u)| [s.rgb[0], s.rgb[1], s.rgb[2], u[0], u[1], u[2]])
        .collect();
    let colours = Channels::Rgb.column_names();
    let names = colours.iter().map(|name| format!("{U_SCALE}{name}"));
    let names: Vec<String> = colours.iter().cloned().chain(names).collect();
    write_rows(path, &names, samples, values.iter().map(|v| &v[..]), note)
}

/// What stands before a channel's name where a column holds the uncertainty of its values that all samples share.
const U_SCALE: &str = "u_scale_";

fn write_channels(
    path: &Path,
    samples: &ChannelSamples,
    note: Option<&SampleNote>,
) -> Result<(), FileError> {
    let values = samples.values.chunks_exact(samples.channels.count());
    let names = samples.channels.column_names();
    write_rows(path, &names, &samples.places, values, note)
}

/// Writes places, and the values of each.
fn write_rows<'a, const N: usize>(
    path: &Path,
    names: &[String],
    places: &[Sample<N>],
    values: impl Iterator<Item = &'a [f32]>,
    note: Option<&SampleNote>,
) -> Result<(), FileError> {
    let with_frames = have_frames(places);
    write_whole(path, |out| {
        if let Some(note) = note {
            write_comments(out, note)?;
        }
        let names = names.join(",");
        let frame = if with_frames { ",frame" } else { "" };
        writeln!(out, "{},{names}{frame}", COLUMNS[..4].join(","))?;
        for (s, values) in places.iter().zip(values) {
            write!(
                out,
                "{},{},{},{}",
                s.theta_i_deg, s.phi_i_deg, s.theta_v_deg, s.phi_v_deg
            )?;
            for value in values {
                write!(out, ",{value}")?;
            }
            if with_frames {
                write!(out, ",{}", frame_in_file(s.frame))?;
            }
            out.write_all(b"\n")?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use crate::samples::read_samples;
    use gonia_brdf::Sample;

    /// Three samples as people's programs write them, `|` between the fields.
    const ROWS: &str = "54.75|41.5|60.125|168|0.097|0.065|0.033\n77.5|316.25|74|113.5|1.5e-2|0.064|0.032\n28|107.75|55|195.5|0.095|0.063|0.031\n";
    const NAMES: &str = "theta_i|phi_i|theta_v|phi_v|r|g|b\n";

    fn read_bytes(bytes: &[u8]) -> Result<(Vec<Sample>, Vec<String>), String> {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        std::fs::write(&path, bytes).unwrap();
        let folder = format!("{}/", dir.path().display());
        match read_samples(&path) {
            Ok(read) => {
                let remarks = read.remarks.iter();
                let remarks = remarks.map(|remark| remark.to_string().replace(&folder, ""));
                Ok((read.samples, remarks.collect()))
            }
            Err(error) => {
                let error = error.to_string().replace(&folder, "");
                assert_eq!(error.lines().count(), 1, "{error}");
                Err(error)
            }
        }
    }

    fn usual() -> Vec<Sample> {
        let text = format!("{NAMES}{ROWS}").replace('|', ",");
        let (samples, remarks) = read_bytes(text.as_bytes()).unwrap();
        assert!(samples.len() == 3 && remarks.is_empty());
        assert_eq!((samples[1].theta_i_deg, samples[1].rgb[0]), (77.5, 0.015));
        samples
    }

    #[test]
    fn tables_as_people_have_them_are_the_same_samples_without_a_word() {
        let comma = |text: &str| text.replace('|', ",");
        let header = |names: &str| comma(&format!("{names}\n{ROWS}"));
        let with_commas = |separator: &str| {
            let text = format!("{NAMES}{ROWS}").replace('.', ",");
            text.replace('|', separator)
        };
        let one_in_ten = |text: &str, line: &str| {
            let mut lines: Vec<&str> = text.lines().collect();
            lines.insert(2, line);
            lines.join("\n")
        };
        let usual_text = header(NAMES.trim());
        let cases = [
            format!("{NAMES}{ROWS}"),
            format!("{NAMES}{ROWS}").replace('|', ";"),
            format!("{NAMES}{ROWS}").replace('|', "\t"),
            format!("{NAMES}{ROWS}").replace('|', "   "),
            format!(
                "  {}",
                format!("{NAMES}{ROWS}")
                    .replace('|', " \t ")
                    .replace('\n', " \n ")
            ),
            format!("{NAMES}{ROWS}").replace('|', ", "),
            format!("{NAMES}{ROWS}").replace('|', " , "),
            with_commas(";"),
            with_commas("\t"),
            with_commas("  "),
            with_commas("|"),
            with_commas(";").replace('\n', ";\r\n"),
            format!("sep=;\n{}", with_commas(";")),
            format!("sep=,\r\n{usual_text}"),
            format!("\"sep=;\"\n{}", with_commas(";")),
            // Quoted decimal commas between commas are certain.
            format!(
                "\"{}\"\n",
                with_commas("\",\"").trim().replace('\n', "\"\n\"")
            ),
            format!(
                "\"{}\"\n",
                usual_text
                    .trim()
                    .replace(',', "\",\"")
                    .replace('\n', "\"\n\"")
            ),
            // numpy.savetxt: the header in a comment, with another separator too.
            format!("# {usual_text}"),
            format!("# {NAMES}{ROWS}").replace('|', " "),
            comma(&format!("# {NAMES}")) + &ROWS.replace('|', " "),
            format!("#made by hand\n\n% of two\n//{usual_text}# done\n"),
            format!("A title, of a sample\nmeasured 2017 05 23 14 30\n\n{usual_text}"),
            header("Theta_I|PHI_I|Theta_V|Phi_v|R|G|B"),
            header("theta_in|phi_in|theta_out|phi_out|R|G|B"),
            header("theta_i|phi_i|theta_o|phi_o|red|green|blue"),
            header("theta_i [deg]|phi_i (deg)|theta_r (°)|phi_r / °|R [1/sr]|G [1/sr]|B [1/sr]"),
            header("theta_i_deg|phi_i_deg|theta_v_deg|phi_v_deg|brdf_r|brdf_g|brdf_b"),
            header("θi|φi|θr|φr|R|G|B"),
            format!(
                "theta_i [deg] phi_i [deg] theta_v [deg] phi_v [deg] r g b\n{}",
                ROWS.replace('|', " ")
            ),
            comma(&format!("{NAMES}deg|deg|deg|deg|1/sr|1/sr|1/sr\n{ROWS}")),
            comma(&format!("{NAMES}[°]|[°]|[°]|[°]|||\n{ROWS}")),
            usual_text.replace('\n', "\r\n"),
            usual_text.replace('\n', "\r"),
            usual_text.replace('\n', "\n\n"),
            format!("\u{feff}{usual_text}"),
            usual_text.replace('\n', ",\n") + ",,,,,,,\n",
            one_in_ten(&usual_text, "# a word in between"),
            one_in_ten(&usual_text, "  "),
            usual_text.replace("1.5e-2", "1.5D-02"),
            usual_text.trim_end().to_owned(),
        ];
        let usual = usual();
        for text in cases {
            let (samples, remarks) =
                read_bytes(text.as_bytes()).unwrap_or_else(|e| panic!("{e}\n{text}"));
            assert_eq!(samples, usual, "{text}");
            assert_eq!(remarks, [""; 0], "{text}");
        }
    }

    #[test]
    fn other_encodings_and_other_columns_change_nothing() {
        let text = format!("{NAMES}{ROWS}").replace('|', ";");
        let more = text.lines().enumerate().map(|(k, line)| match k {
            0 => format!("#;{line};Temperatur [°C];note\n"),
            k => format!("{k};{line};21,5°;\"a; b\nc {k}\"\n"),
        });
        let more: String = more.collect();
        let units = || more.encode_utf16();
        let cases = [
            more.clone().into_bytes(),
            more.chars().map(|letter| letter as u8).collect(),
            [
                &b"\xff\xfe"[..],
                &units().flat_map(u16::to_le_bytes).collect::<Vec<_>>(),
            ]
            .concat(),
            [
                &b"\xfe\xff"[..],
                &units().flat_map(u16::to_be_bytes).collect::<Vec<_>>(),
            ]
            .concat(),
        ];
        for bytes in cases {
            assert_eq!(read_bytes(&bytes), Ok((usual(), Vec::new())), "{more}");
        }
    }

    #[test]
    fn one_channel_is_repeated_and_a_frame_may_be_unknown() {
        for name in ["brdf", "BRDF [1/sr]", "value", "f", "fr", "f_r"] {
            let text = format!(
                "frame,theta_i,phi_i,theta_v,phi_v,{name}\n7,1,2,3,4,.5\n,1,2,3,4,.5\n-1,1,2,3,4,.5\n"
            );
            let (samples, remarks) = read_bytes(text.as_bytes()).unwrap();
            assert_eq!(samples[0].rgb, [0.5; 3]);
            let frames: Vec<u32> = samples.iter().map(|s| s.frame).collect();
            assert_eq!(frames, [7, Sample::NO_FRAME, Sample::NO_FRAME], "{name}");
            assert!(remarks.is_empty());
        }
    }

    #[test]
    fn uncertainties_are_columns_that_readers_of_samples_pass_over_and_say_so() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("samples.csv");
        let at = |deg: f64| gonia_brdf::Direction::from_deg(deg, 2.0 * deg);
        let samples = [
            Sample::new(at(10.0), at(20.0), [0.1, 0.2, 0.3]).in_frame(4),
            Sample::new(at(30.0), at(40.0), [0.4, 0.5, 0.6]).in_frame(5),
        ];
        let u = [[0.01, 0.02, 0.03], [0.04, 0.05, 0.06]];
        super::write_with_u(&path, &samples, &u, None).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let mut lines = text.lines();
        assert_eq!(
            lines.next().unwrap(),
            "theta_i,phi_i,theta_v,phi_v,r,g,b,u_scale_r,u_scale_g,u_scale_b,frame"
        );
        assert_eq!(
            lines.next().unwrap(),
            "10,20,20,40,0.1,0.2,0.3,0.01,0.02,0.03,4"
        );
        let read = read_samples(&path).unwrap();
        assert_eq!(read.samples, samples);
        let said: Vec<String> = read.remarks.iter().map(ToString::to_string).collect();
        let expected = "u_scale_r, u_scale_g, u_scale_b are uncertainties, which are not read";
        assert!(said.len() == 1 && said[0].contains(expected), "{said:?}");
    }

    #[test]
    fn radians_by_name_are_converted_and_said() {
        for (names, units) in [
            ("theta_i_rad,phi_i_rad,theta_v_rad,phi_v_deg,f", ""),
            ("theta_i [rad],phi_i [rad],theta_v [rad],phi_v,f", ""),
            ("theta_i,phi_i,theta_v,phi_v,f", "rad,rad,rad,deg,1/sr\n"),
        ] {
            let text = format!("{names}\n{units}0.7853981634,-1.5707963268,1.5708,45,0.5\n");
            let (samples, remarks) = read_bytes(text.as_bytes()).unwrap();
            let s = samples[0];
            let angles = [s.theta_i_deg, s.phi_i_deg, s.theta_v_deg, s.phi_v_deg];
            assert_eq!(angles, [45.0, 270.0, 90.0, 45.0]);
            assert_eq!(remarks.len(), 1);
            assert!(
                remarks[0].contains("hold radians, and were converted to degrees; rename them"),
                "{remarks:?}"
            );
        }
        let error = read_bytes(b"theta_i_rad,phi_i_rad,theta_v_rad,phi_v_rad,f\n.5,1,54.7,2,1\n");
        let error = error.unwrap_err();
        assert!(
            error.contains("line 2: theta_v 54.7 is too much for the radians"),
            "{error}"
        );
    }

    #[test]
    fn a_table_without_names_is_read_by_its_number_of_columns_and_this_is_said() {
        let row = |n: usize| {
            let fields = ["10.5", "20", "30", "40", ".1", ".2", ".3", "7"];
            let six = ["10.5", "20", "30", "40", ".1", "7"];
            if n == 6 {
                six.join("|")
            } else {
                fields[..n].join("|")
            }
        };
        for separator in [",", ";", "\t", "  "] {
            for (n, rgb, frame, taken) in [
                (5, [0.1; 3], None, "theta_i, phi_i, theta_v, phi_v, brdf"),
                (
                    6,
                    [0.1; 3],
                    Some(7),
                    "theta_i, phi_i, theta_v, phi_v, brdf, frame",
                ),
                (
                    7,
                    [0.1, 0.2, 0.3],
                    None,
                    "theta_i, phi_i, theta_v, phi_v, r, g, b",
                ),
                (
                    8,
                    [0.1, 0.2, 0.3],
                    Some(7),
                    "theta_i, phi_i, theta_v, phi_v, r, g, b, frame",
                ),
            ] {
                let text = format!("# a word\n{}\n{}\n", row(n), row(n)).replace('|', separator);
                let (samples, remarks) = read_bytes(text.as_bytes()).unwrap();
                assert_eq!(samples.len(), 2);
                assert_eq!(
                    (samples[1].rgb, samples[1].frame),
                    (rgb, frame.unwrap_or(Sample::NO_FRAME))
                );
                assert_eq!(
                    remarks,
                    [format!(
                        "s.csv: has no header: its {n} columns were taken for {taken}; name them in the first line if they are others"
                    )]
                );
            }
        }
    }

    #[test]
    fn what_is_not_certain_is_refused_with_the_reason() {
        let names = "theta_i,phi_i,theta_v,phi_v,r,g,b\n";
        for (text, said) in [
            (
                "",
                "s.csv: holds no table of samples; name them in the first line",
            ),
            (
                "a,c\n1,2\n",
                "line 1: there is no column for theta_i, phi_i, theta_v, phi_v, r, g, b; found: a, c; name theta_i",
            ),
            (
                "theta_i;phi_i;theta_v;r;g;b\n1;2;3;4;5;6\n",
                "line 1: there is no column for phi_v; found: theta_i, phi_i, theta_v, r, g, b",
            ),
            (
                "# x\nelevation_i phi_i theta_v phi_v f\n1 2 3 4 5\n",
                "line 2: there is no column for theta_i; found: elevation_i, phi_i, theta_v, phi_v, f",
            ),
            (
                "theta_i,phi_i,theta_o,phi_o,theta_r,f\n1,2,3,4,5,6\n",
                "theta_o and theta_r are columns of the same quantity",
            ),
            // Decimal commas between commas.
            (
                "theta_i,phi_i,theta_v,phi_v,f\n54,7,41,4,60,1,167,9,0,09\n",
                "line 2: 10 fields where line 1 names 5: decimal commas cannot be told from commas between fields; separate the fields by semicolons",
            ),
            (
                "30,0,45,180,0,123\n10,0,45,180,0,145\n",
                "s.csv: has no header and no decimal point: its commas may separate numbers or be decimal ones",
            ),
            // Both marks.
            (
                "theta_i;phi_i;theta_v;phi_v;f\n1,5;2;3;4;0,5\n1,5;2;3;4;0.5\n",
                "line 3: f \"0.5\" has a decimal point, numbers from line 2 on have a comma",
            ),
            (
                "theta_i;phi_i;theta_v;phi_v;f\n1.5;2;3;4;1,000\n",
                "line 2: f \"1,000\" has a decimal comma, numbers from line 2 on have a point",
            ),
            (
                "theta_i;phi_i;theta_v;phi_v;f\n1;2;3;4;1.234,5\n",
                "line 2: f \"1.234,5\" is not a number",
            ),
            (
                "1.5,2,3,4,.5,.5,.5,.25\n",
                "line 1: frame 0.25 is no number of a frame (the columns, which have no names, were taken for theta_i, phi_i, theta_v, phi_v, r, g, b, frame)",
            ),
            (
                "1,2,3,4,5.5,6,7,8,9\n",
                "s.csv: has 9 columns without names; name them in the first line",
            ),
            (
                "1.5,2,3,4,5\n1,2,3,4\n",
                "line 2: 4 fields where the rows before have 5",
            ),
            ("1.5,x,3,4,5,6,7\n", "line 1: field 2 \"x\" is not a number"),
            (
                &format!("{names}1,2,3,4,5,6,7\n\n# x\n1,2,3,4,5,6,x\n"),
                "line 5: b \"x\" is not a number",
            ),
            (
                &format!("{names}1,2,3,4,5,6\n"),
                "line 2: 6 fields where line 1 names 7",
            ),
            (
                &format!("{names}1,2,3,4,,6,7\n"),
                "line 2: r \"\" is not a number",
            ),
            (names, "s.csv: has no rows"),
            (
                "PK\x03\x04 and so on",
                "s.csv: is no archive that can be read",
            ),
            ("theta_i,phi_i\0", "s.csv: is not text"),
        ] {
            let error = read_bytes(text.as_bytes()).unwrap_err();
            assert!(error.contains(said), "{error}\n{text}");
        }
    }

    #[test]
    fn frame_numbers_are_carried_whole() {
        let read = |frame: &str| {
            read_bytes(
                format!("theta_i,phi_i,theta_v,phi_v,f,frame\n1,2,3,4,5,{frame}\n").as_bytes(),
            )
        };
        for (text, frame) in [
            ("16777217", 16_777_217),
            ("4294967294", 4_294_967_294),
            ("3.0", 3),
        ] {
            assert_eq!(read(text).unwrap().0[0].frame, frame);
        }
        for frame in ["4294967295", "4294967296", "-2", "1.5", "nan"] {
            let error = read(frame).unwrap_err();
            assert!(
                error.contains("is no number of a frame; give whole numbers from 0 to 4294967294"),
                "{error}"
            );
        }
    }

    #[test]
    fn a_bad_field_names_its_line() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("s.csv");
        let read = |rows: &str| {
            let header = "r,g,b,theta_i,phi_i,theta_v,phi_v\n";
            std::fs::write(&path, format!("{header}{rows}")).unwrap();
            read_samples(&path)
        };
        let samples = read("1,2,3,10,20,30,40\n").unwrap().samples;
        assert_eq!(
            (samples[0].theta_i_deg, samples[0].rgb),
            (10.0, [1.0, 2.0, 3.0])
        );
        let error = read("1,2,3,10,20,30,40\n1,x,3,10,20,30,40\n")
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("s.csv, line 3: g \"x\" is not a number"),
            "{error}"
        );
        let error = read("1,2,3,100,20,30,40\n").unwrap_err().to_string();
        assert!(
            error.contains("s.csv, line 2: 1 of 1 samples lie below the horizon"),
            "{error}"
        );
    }
}
