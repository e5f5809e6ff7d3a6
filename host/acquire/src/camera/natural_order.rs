//! The order in which a camera's program named its files.

use std::cmp::Ordering;
use std::path::{Path, PathBuf};

/// Between the files of one shot, a counter does not leap so far; one that comes round does.
const LEAP: u64 = 100;

/// Files in the order of their counters: 9 before 10, 9999 before 10000, and 9999 before 0001 where the
/// counter came round between them.
pub fn in_order(mut files: Vec<PathBuf>) -> Vec<PathBuf> {
    files.sort_by(|a, b| compare(a, b));
    let counters: Option<Vec<u64>> = files.iter().map(|file| counter(file)).collect();
    let leap = counters.and_then(|counters| {
        let leap = |pair: &[u64]| pair[1].saturating_sub(pair[0]) > LEAP;
        counters.windows(2).position(leap)
    });
    if let Some(leap) = leap {
        files.rotate_left(leap + 1);
    }
    files
}

/// Names with their numbers as numbers.
fn compare(a: &Path, b: &Path) -> Ordering {
    let (a, b) = (a.to_string_lossy(), b.to_string_lossy());
    let (mut x, mut y) = (a.as_ref(), b.as_ref());
    while let (Some(p), Some(q)) = (x.chars().next(), y.chars().next()) {
        let order = if p.is_ascii_digit() && q.is_ascii_digit() {
            let (m, n) = (digits(x), digits(y));
            (x, y) = (&x[m.len()..], &y[n.len()..]);
            let (m, n) = (m.trim_start_matches('0'), n.trim_start_matches('0'));
            m.len().cmp(&n.len()).then_with(|| m.cmp(n))
        } else {
            (x, y) = (&x[p.len_utf8()..], &y[q.len_utf8()..]);
            p.cmp(&q)
        };
        if order.is_ne() {
            return order;
        }
    }
    x.len().cmp(&y.len()).then_with(|| a.cmp(&b))
}

fn digits(text: &str) -> &str {
    let end = text.find(|c: char| !c.is_ascii_digit());
    &text[..end.unwrap_or(text.len())]
}

/// The last number in a file's name.
fn counter(file: &Path) -> Option<u64> {
    let stem = file.file_stem()?.to_string_lossy().into_owned();
    let end = stem.rfind(|c: char| c.is_ascii_digit())? + 1;
    let begin = stem[..end]
        .rfind(|c: char| !c.is_ascii_digit())
        .map_or(0, |at| {
            at + stem[at..].chars().next().map_or(1, char::len_utf8)
        });
    stem[begin..end].parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counters_are_read_as_numbers_also_where_they_come_round() {
        for expected in [
            &["9.png", "10.png", "11.png"][..],
            &["IMG_9999.tif", "IMG_10000.tif"],
            &["IMG_9998.tif", "IMG_9999.tif", "IMG_0001.tif"],
            &["d/a.exr", "d/b.exr"],
            &["1.exr"],
            &["shot é 9.exr", "shot é 10.exr"],
            &["1122-9.png", "1122-10.png", "1123-1.png"],
        ] {
            let expected: Vec<PathBuf> = expected.iter().map(PathBuf::from).collect();
            let mut mixed = expected.clone();
            mixed.reverse();
            assert_eq!(in_order(mixed), expected);
        }
    }
}
