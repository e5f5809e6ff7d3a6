//! Text as other programs save it: UTF-8, UTF-16 or, where it is neither, Latin-1.

use crate::FileError;
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// What a table's header is looked for in; even, for letters of two bytes.
const FIRST_BYTES: u64 = 1 << 16;

/// Reads a text whole, without its byte-order mark.
///
/// # Errors
/// When the file cannot be read, or holds something else than text.
pub(super) fn read_text(path: &Path) -> Result<String, FileError> {
    let bytes = std::fs::read(path).map_err(|error| FileError::reading(path, &error))?;
    decoded(bytes).ok_or_else(|| not_text(path))
}

/// What is said of bytes that [`decoded`] does not take for text.
pub(super) fn not_text(path: &Path) -> FileError {
    FileError::new(
        path,
        "is not text",
        "give a table as CSV, in UTF-8, UTF-16 or Latin-1",
    )
}

/// The first lines of an ordinary file; `None` where it is none, or no text.
pub(super) fn read_first_lines(path: &Path) -> Option<String> {
    let mut bytes = Vec::new();
    // A pipe can be read only once.
    if std::fs::metadata(path).ok()?.is_file() {
        let file = File::open(path).ok()?;
        file.take(FIRST_BYTES).read_to_end(&mut bytes).ok()?;
    }
    decoded(bytes)
}

/// The text of these bytes; `None` where they are no text.
pub(super) fn decoded(bytes: Vec<u8>) -> Option<String> {
    let text = match bytes[..] {
        [0xef, 0xbb, 0xbf, ..] => of_one_byte_a_letter(bytes[3..].to_vec()),
        [0xff, 0xfe, ref rest @ ..] => of_two_bytes(rest, u16::from_le_bytes)?,
        [0xfe, 0xff, ref rest @ ..] => of_two_bytes(rest, u16::from_be_bytes)?,
        // Without a mark: every table begins with a character that takes one byte in ASCII.
        [1..=u8::MAX, 0, ..] => of_two_bytes(&bytes, u16::from_le_bytes)?,
        [0, 1..=u8::MAX, ..] => of_two_bytes(&bytes, u16::from_be_bytes)?,
        _ => of_one_byte_a_letter(bytes),
    };
    (!text.contains('\0')).then_some(text)
}

/// UTF-8; where it is none, Latin-1, in which any byte is the letter of its number.
fn of_one_byte_a_letter(bytes: Vec<u8>) -> String {
    String::from_utf8(bytes)
        .unwrap_or_else(|error| error.as_bytes().iter().copied().map(char::from).collect())
}

fn of_two_bytes(bytes: &[u8], unit: fn([u8; 2]) -> u16) -> Option<String> {
    let (units, rest) = bytes.as_chunks::<2>();
    if !rest.is_empty() {
        return None;
    }
    char::decode_utf16(units.iter().map(|two| unit(*two)))
        .collect::<Result<_, _>>()
        .ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_text_is_the_same_in_every_encoding() {
        let text = "theta_i,φ,°\n1,2,3\n";
        let units = || text.encode_utf16();
        let le: Vec<u8> = units().flat_map(u16::to_le_bytes).collect();
        let be: Vec<u8> = units().flat_map(u16::to_be_bytes).collect();
        let cases = [
            text.as_bytes().to_vec(),
            [b"\xef\xbb\xbf", text.as_bytes()].concat(),
            [b"\xff\xfe", &le[..]].concat(),
            [b"\xfe\xff", &be[..]].concat(),
            le,
            be,
        ];
        for bytes in cases {
            assert_eq!(decoded(bytes.clone()).as_deref(), Some(text), "{bytes:?}");
        }
        assert_eq!(decoded(b"T [\xb0C]".to_vec()).as_deref(), Some("T [°C]"));
    }

    #[test]
    fn what_is_no_text_is_not_read_as_one() {
        for bytes in [
            &b"1,2\0,3"[..],
            b"\xff\xfea\0b",
            b"\xff\xfe\0\xd8a\0",
            b"\0\0\0\0",
        ] {
            assert_eq!(decoded(bytes.to_vec()), None, "{bytes:?}");
        }
        assert_eq!(decoded(Vec::new()).as_deref(), Some(""));
    }
}
