//! The sensor of a raw exposure: by rig.toml, by the file, or by both where they agree.

use gonia_formats::FileError;
use gonia_formats::raw_frame::{FileSensor, RawFile};
use gonia_rig::{Bayer, Remark, Sensor};
use std::path::Path;

/// Levels of rig.toml and of a file that differ by more than this share of the range contradict each other.
const LEVELS_AGREE: f64 = 0.01;
/// Exposure times that differ by more than this factor do: 1/60 s is 1/64 s, as cameras name it.
const TIMES_AGREE: f64 = 1.12;

/// The sensor of a file.
///
/// # Errors
/// It is said nowhere, or rig.toml and the file contradict each other.
pub(crate) fn of_file(
    path: &Path,
    of_rig: Option<&Sensor>,
    file: &RawFile,
) -> Result<Sensor, FileError> {
    match (of_rig, &file.sensor) {
        (Some(rig), None) => Ok(rig.clone()),
        (Some(rig), Some(own)) => agreed(path, rig, own),
        (None, Some(own)) => own.sensor().ok_or_else(|| {
            let pattern = own.bayer.map_or(String::new(), |bayer| format!(" and bayer {}", name(bayer)));
            FileError::new(
                path,
                "does not say its noise, and rig.toml has no [sensor]",
                format_args!(
                    "give gain_e_per_count and read_noise_e there, with black_counts {}, saturation_counts {}{} as the file says",
                    own.black_counts,
                    own.saturation_counts,
                    pattern,
                ),
            )
        }),
        (None, None) => Err(FileError::new(
            path,
            "is a raw exposure, but rig.toml has no [sensor]",
            "give black_counts, saturation_counts, gain_e_per_count and read_noise_e there",
        )),
    }
}

/// As rig.toml has it.
fn name(bayer: Bayer) -> String {
    format!("{bayer:?}").to_uppercase()
}

/// What rig.toml says, where the file does not contradict it; the file's pattern where rig.toml has none.
fn agreed(path: &Path, rig: &Sensor, own: &FileSensor) -> Result<Sensor, FileError> {
    let tolerance = LEVELS_AGREE * (own.saturation_counts - own.black_counts);
    let contradicts = |what: String, key: &str| {
        let remedy = format!("mend {key} in rig.toml");
        Err(FileError::new(path, what, remedy))
    };
    if (rig.black_counts - own.black_counts).abs() > tolerance {
        let what = format!(
            "says that it is black at {} counts, but rig.toml says {}",
            own.black_counts, rig.black_counts
        );
        return contradicts(what, "sensor.black_counts");
    }
    if rig.saturation_counts > own.saturation_counts + tolerance {
        let what = format!(
            "says that it saturates at {} counts, but rig.toml says {}",
            own.saturation_counts, rig.saturation_counts
        );
        return contradicts(what, "sensor.saturation_counts");
    }
    match (rig.bayer, own.bayer) {
        (Some(said), Some(found)) if said != found => {
            let what = format!(
                "says that its colour filters are {}, but rig.toml says {}",
                name(found),
                name(said)
            );
            contradicts(what, "sensor.bayer")
        }
        _ => Ok(Sensor {
            bayer: rig.bayer.or(own.bayer),
            ..rig.clone()
        }),
    }
}

/// What is to be said when a file was not exposed as long as is said of it.
pub(crate) fn exposure_remark(path: &Path, exposure_s: f64, file: &RawFile) -> Option<Remark> {
    let own = file.sensor.as_ref()?.exposure_s?;
    let ratio = (own / exposure_s).max(exposure_s / own);
    (ratio > TIMES_AGREE).then(|| {
        Remark::new(
            path.display(),
            format_args!("says that it was exposed for {own} s, and {exposure_s} s is used"),
            "check exposure_s in frames.csv",
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_rig::RawFrame;

    fn file(noise: Option<[f64; 2]>) -> RawFile {
        RawFile {
            raw: RawFrame {
                width: 1,
                height: 1,
                channels: 1,
                counts: vec![0],
            },
            bits: 16,
            encoded: None,
            sensor: Some(FileSensor {
                black_counts: 512.0,
                saturation_counts: 4096.0,
                bayer: Some(Bayer::Gbrg),
                noise,
                exposure_s: Some(0.25),
            }),
        }
    }

    #[test]
    fn a_file_says_its_sensor_and_rig_toml_may_not_contradict_it() {
        let path = Path::new("a.dng");
        let own = of_file(path, None, &file(Some([1e-4, 1e-6]))).unwrap();
        // Var = 1e-4 x + 1e-6 over 3584 counts: 2.79 electrons a count, 10 electrons of read noise.
        assert!((own.gain_e_per_count - 1.0 / 0.3584).abs() < 1e-12);
        assert!((own.read_noise_e - 10.0).abs() < 1e-9);
        assert_eq!(own.bayer, Some(Bayer::Gbrg));
        let error = of_file(path, None, &file(None)).unwrap_err().to_string();
        assert!(
            error.contains("does not say its noise") && error.contains("bayer GBRG"),
            "{error}"
        );

        let rig = Sensor {
            black_counts: 514.0,
            saturation_counts: 4000.0,
            bayer: None,
            ..own
        };
        let agreed = of_file(path, Some(&rig), &file(None)).unwrap();
        assert_eq!(
            (agreed.black_counts, agreed.bayer),
            (514.0, Some(Bayer::Gbrg))
        );
        let wrong = [
            Sensor {
                black_counts: 64.0,
                ..rig.clone()
            },
            Sensor {
                saturation_counts: 16_383.0,
                ..rig.clone()
            },
            Sensor {
                bayer: Some(Bayer::Rggb),
                ..rig.clone()
            },
        ];
        for (sensor, said) in wrong.iter().zip([
            "black at 512 counts, but rig.toml says 64",
            "saturates at 4096 counts, but rig.toml says 16383",
            "colour filters are GBRG, but rig.toml says RGGB",
        ]) {
            let error = of_file(path, Some(sensor), &file(None))
                .unwrap_err()
                .to_string();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn a_nominal_time_draws_no_remark_and_another_one_does() {
        let path = Path::new("a.dng");
        for near in [0.25, 0.266, 0.235] {
            assert_eq!(exposure_remark(path, near, &file(None)), None);
        }
        let remark = exposure_remark(path, 0.5, &file(None)).unwrap().to_string();
        assert!(
            remark.contains("exposed for 0.25 s, and 0.5 s is used"),
            "{remark}"
        );
    }
}
