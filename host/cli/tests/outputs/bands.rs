//! One table of bands through every command.

use crate::bench::{Bench, fill_with_errors, samples};
use crate::common::{gonia, gonia_ok, text};
use gonia_brdf::Elementary;
use gonia_formats::dense::read_dense_channels;
use gonia_rig::Channels;
use std::fs;

/// A spectrum that rises with the wavelength, more so with the polar angle of the view; nanometres, degrees.
fn spectrum(theta_v: f64, wavelength: f64) -> f64 {
    0.1 + 0.3 * (wavelength - 400.0) / 300.0 * (0.5 + 0.5 * theta_v.to_radians().sine())
}

/// A table of samples all over two hemispheres with these columns of values.
fn table_of(names: &str, values: &dyn Fn(f64) -> Vec<f64>) -> String {
    let mut table = format!("{names},theta_i,phi_i,theta_v,phi_v\n");
    for sample in samples() {
        let (theta_i, theta_v) = (sample.theta_i_deg, sample.theta_v_deg);
        // Light and view exchanged have one value.
        let values = values(0.5 * f64::from(theta_i + theta_v));
        let values: Vec<String> = values.iter().map(f64::to_string).collect();
        let (phi_i, phi_v) = (sample.phi_i_deg, sample.phi_v_deg);
        table += &format!("{},{theta_i},{phi_i},{theta_v},{phi_v}\n", values.join(","));
    }
    table
}

// long: one table goes through every command
#[test]
fn bands_are_filled_asked_compared_and_drawn_as_what_they_are() {
    let bench = Bench::new();
    // In falling order, and with one of four digits, which letters would sort wrongly.
    let wavelengths: Vec<f64> = (0..31).rev().map(|k| 400.0 + 20.0 * f64::from(k)).collect();
    let names: Vec<String> = wavelengths.iter().map(|w| format!("{w}nm")).collect();
    let of = |theta: f64| wavelengths.iter().map(|w| spectrum(theta, *w)).collect();
    fs::write(bench.at("s.csv"), table_of(&names.join(","), &of)).unwrap();
    let (samples, dense, error) = (bench.at("s.csv"), bench.at("d.exr"), bench.at("e.exr"));
    let step = ["--step", "15"];
    let fill = fill_with_errors(&samples, &dense, &error);
    let said = gonia_ok(&[&fill[..], &step].concat(), "");
    assert!(said.contains("31 bands from 400nm to 1000nm"), "{said}");
    let asked = "theta_i,phi_i,theta_v,phi_v\n30,60,45,200\n";
    for file in [&dense, &samples] {
        let printed = gonia_ok(&["query", text(file)], asked);
        let (header, row) = printed.trim().split_once('\n').unwrap();
        let header: Vec<&str> = header.split(',').skip(4).collect();
        let values: Vec<f64> = row.split(',').skip(4).map(|v| v.parse().unwrap()).collect();
        assert_eq!((header.len(), values.len()), (31, 31));
        for (k, (name, value)) in header.iter().zip(values).enumerate() {
            let wavelength = 400.0 + 20.0 * k as f64;
            assert_eq!(*name, format!("{wavelength}nm"));
            let truth = spectrum(37.5, wavelength);
            assert!((value / truth - 1.0).abs() < 0.02, "{name} {value} {truth}");
        }
    }
    assert_eq!(read_dense_channels(&error).unwrap().planes.len(), 31);
    let compared = gonia_ok(&["compare", text(&dense), text(&dense)], "");
    assert!(
        compared.contains("bands      |ln| RMS 0.0000"),
        "{compared}"
    );
    let picture = bench.at("p.png");
    let drawn = ["render", text(&dense), "-o", text(&picture), "--px", "32"];
    gonia_ok(&drawn, "");
    let folder = bench.at("bands");
    fs::create_dir(&folder).unwrap();
    fs::copy(&dense, folder.join("dense.exr")).unwrap();
    fs::copy(&error, folder.join("error.exr")).unwrap();
    gonia_ok(&["report", text(&folder)], "");
    let report = fs::read_to_string(folder.join("report.html")).unwrap();
    for said in [
        "Measured were 31 bands from 400nm to 1000nm",
        "share of the value, at 560nm",
    ] {
        assert!(report.contains(said), "{said}");
    }
    let fit = ["fit", text(&dense), "--model", "lambert", "--starts", "1"];
    let fitted = gonia_ok(
        &[&fit[..], &["-o", text(&folder.join("l.exr"))]].concat(),
        "",
    );
    assert!(fitted.contains("lambert"), "{fitted}");
    gonia_ok(&["report", text(&folder)], "");
    let report = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(report.contains("lambert"));
    let output = gonia(&[&fill[..4], &["--method", "nearest"], &step].concat(), "");
    let said = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{said}");
    let last = said.lines().last().unwrap_or_default();
    let words = "--method with the channels 31 bands from 400nm to 1000nm: only the default";
    assert!(last.contains(words), "{said}");
    // Files of other channels are not one set, and not compared.
    let grey = bench.at("y.csv");
    fs::write(&grey, table_of("Y", &|theta| vec![spectrum(theta, 550.0)])).unwrap();
    let one = bench.at("y.exr");
    let both = ["fill", text(&samples), text(&grey), "-o", text(&one)];
    let output = gonia(&[&both[..], &step].concat(), "");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("y.csv: has the channels Y, but"), "{said}");
    assert!(!one.exists());
    gonia_ok(
        &[&["fill", text(&grey), "-o", text(&one)], &step[..]].concat(),
        "",
    );
    assert_eq!(
        read_dense_channels(&one).unwrap().channels,
        Channels::Single
    );
    let output = gonia(&["compare", text(&one), text(&dense)], "");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("y.exr: has the channels Y, and"), "{said}");
}
