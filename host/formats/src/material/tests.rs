use super::*;
use crate::fit_toml::FittedNumber;
use gonia_brdf::fit::{ModelFamily, StandardFamily};
use gonia_rig::Figures;

/// A fit of a model whose numbers are 0.25, 0.26 ….
fn note(model: &str, scaled: bool) -> FitNote {
    let family: StandardFamily = model.parse().unwrap();
    let parameters = family.for_values(scaled).parameters();
    FitNote {
        model: model.into(),
        converged: true,
        residual_rms: 0.1,
        cells: 12_000,
        seconds: 2.5,
        dense: Some("e3069283".into()),
        parameters: parameters
            .into_iter()
            .enumerate()
            .map(|(k, p)| FittedNumber {
                name: p.name,
                value: 0.25 + 0.01 * k as f64,
                uncertainty: (k > 0).then_some(0.001),
                unit: p.unit.into(),
                at_bound: k == 3,
            })
            .collect(),
        figures: Figures {
            a: model.into(),
            b: "dense--1.exr".into(),
            cells_total: 1,
            cells_compared: 1,
            cells_colour: 0,
            floored_a: 0,
            floored_b: 0,
            factor: None,
            sphere_delta_e: 1.5,
            cylinder_delta_e: 2.0,
            strata: Vec::new(),
        },
    }
}

fn written(name: &str, note: &FitNote) -> Result<String, FileError> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    let written = write_material(&path, note, "gonia 1.2.3");
    match written {
        Ok(()) => Ok(std::fs::read_to_string(path).unwrap()),
        Err(error) => {
            assert!(!path.exists());
            assert_eq!(error.to_string().lines().count(), 1);
            Err(error)
        }
    }
}

#[test]
fn every_parameter_of_a_model_is_in_its_files_with_its_value() {
    for (file, model) in [
        ("a.xml", "principled"),
        ("a.MTLX", "principled"),
        ("a.mtlx", "gltf"),
    ] {
        let note = note(model, false);
        let text = written(file, &note).unwrap();
        for p in &note.parameters {
            // Colours are in triples, azimuths in a remark or in radians.
            let value = match file {
                "a.mtlx" if p.unit == "deg" => digits(p.value.to_radians()),
                _ => digits(p.value),
            };
            assert!(
                text.contains(&value),
                "{file} {model} {} {value}\n{text}",
                p.name
            );
        }
        assert!(text.contains("gonia 1.2.3") && text.contains("e3069283"));
        // A comment of XML holds no two hyphens.
        assert!(text.contains("dense- -1.exr"), "{text}");
    }
    for (file, model) in [("a.json", "kurt2"), ("a.json", "gltf"), ("a.gltf", "gltf")] {
        let note = note(model, false);
        let read: serde_json::Value = serde_json::from_str(&written(file, &note).unwrap()).unwrap();
        let fit = match file {
            "a.gltf" => &read["materials"][0]["extras"]["gonia"],
            _ => &read,
        };
        assert_eq!(fit["error"]["delta_e00_sphere"], 1.5);
        for p in &note.parameters {
            let channel = ["_r", "_g", "_b"].iter().position(|c| p.name.ends_with(c));
            let (value, u) = match channel {
                None => (
                    &fit["parameters"][&p.name],
                    &fit["standard_uncertainties"][&p.name],
                ),
                Some(c) => {
                    let name = &p.name[..p.name.len() - 2];
                    let of = |kind: &str| &fit[kind][name][c];
                    (of("parameters"), of("standard_uncertainties"))
                }
            };
            let value = value.as_f64().unwrap();
            assert!((value - p.value).abs() < 1e-12, "{file} {}", p.name);
            assert_eq!(u.as_f64(), p.uncertainty, "{file} {}", p.name);
        }
    }
    let read: serde_json::Value =
        serde_json::from_str(&written("a.gltf", &note("gltf", false)).unwrap()).unwrap();
    assert_eq!(
        read["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"][1],
        0.26
    );
    assert_eq!(read["extensionsUsed"].as_array().unwrap().len(), 4);
}

#[test]
fn what_cannot_be_written_is_refused_in_a_line() {
    for (file, model, scaled, said) in [
        ("a.zmx", "principled", false, ".mtlx (MaterialX)"),
        ("a.xml", "gltf", false, "fit --model principled"),
        (
            "a.mtlx",
            "kurt2",
            false,
            "MaterialX has no material of the model kurt2",
        ),
        ("a.gltf", "principled", false, "fit --model gltf"),
        ("a.xml", "principled", true, "--assume-scale"),
    ] {
        let error = written(file, &note(model, scaled)).unwrap_err().to_string();
        assert!(error.contains(said), "{error}");
    }
    // Names and values alone claim no unit.
    assert!(
        written("a.json", &note("principled", true))
            .unwrap()
            .contains("\"scale\"")
    );
    let mut other = note("principled", false);
    other.parameters.remove(4);
    assert!(
        written("a.xml", &other)
            .unwrap_err()
            .to_string()
            .contains("is missing")
    );
}
