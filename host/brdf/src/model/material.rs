//! Materials by name: what `gonia demo --material` measures.

use super::{Brdf, Ggx, Kurt, Lambert, Microcylinder, Reciprocal, Thread, Ward};
use std::sync::Arc;

/// The azimuth of the first thread or lobe, degrees: off every axis of the grid.
const AZIMUTH_DEG: f64 = 23.0;

/// A material with its name.
#[derive(Clone)]
pub struct Material {
    /// Its name on the command line.
    pub name: &'static str,
    /// What it is, in a few words.
    pub what: &'static str,
    /// Its BRDF, 1/sr.
    pub brdf: Arc<dyn Brdf>,
}

impl Material {
    /// The names of all materials.
    pub const NAMES: [&'static str; 9] = [
        "fabric",
        "white",
        "lambert",
        "brushed-metal",
        "satin-paint",
        "linen",
        "silk",
        "satin",
        "shot-silk",
    ];

    /// Those of the microcylinder model, with the parameters its authors published.
    pub const CLOTHS: [&'static str; 4] = ["linen", "silk", "satin", "shot-silk"];

    /// The material of a name.
    pub fn named(name: &str) -> Option<Self> {
        let (name, what, brdf): (_, _, Arc<dyn Brdf>) = match name {
            "fabric" => (
                "fabric",
                "two-thread fabric",
                Arc::new(Kurt::two_thread_fabric()),
            ),
            "white" => (
                "white",
                "white reference cloth",
                Arc::new(Kurt::white_reference_fabric()),
            ),
            "lambert" => (
                "lambert",
                "ideal diffuse grey",
                Arc::new(Lambert { albedo: [0.5; 3] }),
            ),
            "brushed-metal" => ("brushed-metal", "brushed metal, GGX", Arc::new(BRUSHED)),
            "satin-paint" => ("satin-paint", "brushed paint, Ward", Arc::new(PAINT)),
            "linen" => ("linen", "linen, microcylinders", cloth_of("linen")?),
            "silk" => (
                "silk",
                "silk crêpe de Chine, microcylinders",
                cloth_of("silk")?,
            ),
            "satin" => (
                "satin",
                "polyester satin, microcylinders",
                cloth_of("satin")?,
            ),
            "shot-silk" => (
                "shot-silk",
                "shot silk, microcylinders",
                cloth_of("shot-silk")?,
            ),
            _ => return None,
        };
        Some(Self { name, what, brdf })
    }

    /// A cloth by the published formula, which is not reciprocal.
    pub fn cloth(name: &str) -> Option<Microcylinder> {
        Self::threads(name).map(|threads| Microcylinder::new(&threads))
    }

    /// The published parameters of a cloth. The authors give no azimuths: ours are square to each
    /// other.
    pub fn threads(name: &str) -> Option<[Thread; 2]> {
        let threads = match name {
            "linen" => {
                let thread = thread(
                    1.46,
                    [0.2, 0.8, 1.0],
                    0.3,
                    0.3,
                    [12.0, 24.0],
                    0.33,
                    &PAIR_25,
                );
                [thread.clone(), thread]
            }
            "silk" => {
                let colour = [1.0, 0.95, 0.05];
                [
                    thread(1.345, colour, 0.12, 0.2, [5.0, 10.0], 0.75, &SILK_TILTS),
                    thread(1.345, colour, 0.16, 0.3, [18.0, 32.0], 0.25, &[0.0]),
                ]
            }
            "satin" => {
                let colour = [1.0, 0.37, 0.3];
                [
                    thread(1.539, colour, 0.035, 0.1, [2.5, 5.0], 0.9, &SATIN_TILTS),
                    thread(1.539, colour, 0.02, 0.7, [30.0, 60.0], 0.1, &[0.0]),
                ]
            }
            "shot-silk" => [
                thread(1.345, [0.1, 1.0, 0.4], 0.2, 0.1, [4.0, 8.0], 0.86, &PAIR_25),
                thread(1.345, [1.0, 0.0, 0.1], 0.6, 0.1, [5.0, 10.0], 0.14, &[0.0]),
            ],
            _ => return None,
        };
        let [warp, mut weft] = threads;
        weft.azimuth_deg += 90.0;
        Some([warp, weft])
    }
}

const PAIR_25: [f64; 2] = [-25.0, 25.0];
const SILK_TILTS: [f64; 4] = [-35.0, -35.0, 35.0, 35.0];
const SATIN_TILTS: [f64; 8] = [-32.0, -32.0, -18.0, 0.0, 0.0, 18.0, 32.0, 32.0];

const BRUSHED: Ggx = Ggx {
    diffuse: [0.02; 3],
    specular: [0.92, 0.90, 0.86],
    f0: 0.9,
    alpha_x: 0.12,
    alpha_y: 0.4,
    azimuth_deg: AZIMUTH_DEG,
};

const PAINT: Ward = Ward {
    diffuse: [0.10, 0.16, 0.30],
    specular: [0.08; 3],
    alpha_x: 0.10,
    alpha_y: 0.25,
    azimuth_deg: AZIMUTH_DEG,
};

fn cloth_of(name: &str) -> Option<Arc<dyn Brdf>> {
    Some(Arc::new(Reciprocal(Material::cloth(name)?)))
}

fn thread(
    index: f64,
    colour: [f64; 3],
    strength: f64,
    isotropic: f64,
    [surface_width_deg, volume_width_deg]: [f64; 2],
    cover: f64,
    tilts_deg: &[f64],
) -> Thread {
    Thread {
        index,
        albedo: colour.map(|c| strength * c),
        isotropic,
        surface_width_deg,
        volume_width_deg,
        cover,
        azimuth_deg: AZIMUTH_DEG,
        tilts_deg: tilts_deg.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::checks;
    use super::*;

    #[test]
    fn every_name_is_a_material_that_loses_energy() {
        for name in Material::NAMES {
            let material = Material::named(name).unwrap();
            assert_eq!(material.name, name);
            for theta_i in [0.0, 30.0, 60.0, 80.0] {
                for phi_i in [23.0, 60.0] {
                    let albedo = checks::albedo(material.brdf.as_ref(), theta_i, phi_i);
                    assert!(
                        albedo.iter().all(|a| (0.0..1.0).contains(a)),
                        "{name} at {theta_i}/{phi_i}: {albedo:?}"
                    );
                }
            }
        }
        assert!(Material::named("velvet").is_none());
    }

    #[test]
    fn the_materials_but_the_cloths_are_positive_and_reciprocal() {
        for name in Material::NAMES {
            if !Material::CLOTHS.contains(&name) {
                checks::is_positive_and_reciprocal(Material::named(name).unwrap().brdf.as_ref());
            }
        }
    }
}
