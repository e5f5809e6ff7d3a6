use super::xml_read::read;
use super::{KLEMS, TENSOR_TREE_3, TENSOR_TREE_4};
use crate::export::lopsided::{Lopsided, Skew, file, median_ln, settings};
use crate::export::{ExportFormat, How};
use gonia_brdf::Brdf;
use gonia_brdf::direction::Vec3;
use std::path::Path;

fn write(format: &ExportFormat, path: &Path, model: &dyn Brdf, levels: usize, one: bool) -> String {
    let How::Brdf { write, .. } = &format.how else {
        panic!()
    };
    let said = write(path, &file(model, 6.0), &settings(levels, one)).unwrap();
    said.first().map(ToString::to_string).unwrap_or_default()
}

/// Seen from elsewhere, light and view alike.
struct Moved<'a>(&'a dyn Brdf, fn(Vec3) -> Vec3);

impl Brdf for Moved<'_> {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        self.0.eval((self.1)(light), (self.1)(view))
    }
}

#[test]
fn a_tree_and_a_matrix_come_back_the_right_way_round() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.xml");
    for (format, limit) in [(&TENSOR_TREE_4, 0.04), (&KLEMS, 0.06)] {
        write(format, &path, &Lopsided, 4, false);
        let back = read(&path).unwrap();
        let right = median_ln(back.as_ref(), &Lopsided, 80.0);
        assert!(right < limit, "{}: {right}", format.name);
        let wrong: [fn(Vec3) -> Vec3; 4] = [
            |v| [-v[0], v[1], v[2]],
            |v| [v[0], -v[1], v[2]],
            |v| [-v[0], -v[1], v[2]],
            |v| [v[1], v[0], v[2]],
        ];
        for moved in wrong {
            let wrong = median_ln(back.as_ref(), &Moved(&Lopsided, moved), 80.0);
            assert!(wrong > 2.0 * right, "{}: {wrong}", format.name);
        }
    }
}

#[test]
fn a_tree_of_rank_3_holds_what_is_isotropic_and_says_how_far_the_rest_is() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.xml");
    let said = write(&TENSOR_TREE_3, &path, &Skew, 4, true);
    assert!(said.contains("0.0000 away"), "{said}");
    let right = median_ln(read(&path).unwrap().as_ref(), &Skew, 80.0);
    assert!(right < 0.04, "{right}");
    let mirrored = Moved(&Skew, |v| [v[0], -v[1], v[2]]);
    assert!(median_ln(read(&path).unwrap().as_ref(), &mirrored, 80.0) > 0.1);
    let said = write(&TENSOR_TREE_3, &path, &Lopsided, 4, true);
    let away: f64 = said
        .split(" away")
        .next()
        .unwrap()
        .rsplit(' ')
        .next()
        .unwrap()
        .parse()
        .unwrap();
    assert!((0.05..1.0).contains(&away), "{said}");
}

#[test]
fn one_value_is_one_block_and_same_input_is_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let [a, b] = ["a.xml", "b.xml"].map(|name| dir.path().join(name));
    for path in [&a, &b] {
        write(&TENSOR_TREE_4, path, &Skew, 3, true);
    }
    let text = std::fs::read_to_string(&a).unwrap();
    assert_eq!(text, std::fs::read_to_string(&b).unwrap());
    assert_eq!(text.matches("<WavelengthData>").count(), 1);
    assert!(text.contains("<Name>lopsided &amp; &lt;odd> -- one</Name>"));
    assert_eq!(text.matches("<!--").count(), 1);
    write(&TENSOR_TREE_4, &a, &Skew, 3, false);
    let text = std::fs::read_to_string(&a).unwrap();
    assert_eq!(text.matches("<WavelengthData>").count(), 3);
}

#[test]
fn what_is_no_such_file_is_refused_with_what_to_do() {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.xml");
    write(&KLEMS, &path, &Skew, 3, true);
    let whole = std::fs::read_to_string(&path).unwrap();
    for (from, to, said) in [
        (
            "Reflection Back",
            "Reflection Front",
            "it has Reflection Front",
        ),
        ("Klems Full", "Klems Half", "'LBNL/Klems Half'"),
        ("Columns", "Rows", "structure 'Rows'"),
        ("e-1, ", "e-1, x, ", "what is no number"),
        ("e-1, ", "e-1, 1 ", "numbers where there are 145 x 145"),
        (
            "IncidentDataStructure",
            "Structure",
            "no element IncidentDataStructure",
        ),
    ] {
        std::fs::write(&path, whole.replacen(from, to, 99)).unwrap();
        let error = read(&path).err().unwrap().to_string();
        assert!(error.contains(said), "{error}");
        assert_eq!(error.lines().count(), 1);
    }
    // Cut anywhere, it is refused or the same.
    for k in 0..40 {
        std::fs::write(&path, &whole[..whole.len() * k / 40]).unwrap();
        assert!(read(&path).is_err(), "{k}");
    }
}
