//! Reading an RGL file.

use super::tensor_file::{Data, Field, read_tensor_file};
use super::warp::{Densities, Share, cell, place_of_phi, place_of_theta};
use crate::FileError;
use crate::format::{ForeignBrdf, Gaps};
use gonia_brdf::direction::{Vec3, normalize};
use gonia_brdf::{Brdf, Elementary};
use std::collections::BTreeMap;
use std::f64::consts::TAU;
use std::path::Path;

/// A material as the file has it.
pub struct Rgl {
    /// Azimuths and polar angles of the light, radians, rising.
    phi_i: Vec<f64>,
    theta_i: Vec<f64>,
    /// Into how many equal parts symmetry divides the azimuths: 1, 2 (a half turn) or 4 (and mirrored).
    parts: u32,
    ndf: Table,
    sigma: Table,
    vndf: Densities,
    /// Of each light, three tables.
    rgb: Table,
}

/// Slices of a lattice of numbers over the unit square.
struct Table {
    size: [usize; 2],
    values: Vec<f32>,
}

impl Table {
    fn at(&self, place: [f64; 2], slice: usize) -> f64 {
        let [width, height] = self.size;
        let ([x, y], [u, v]) = cell(self.size, place);
        let node = |dx: usize, dy: usize| {
            f64::from(self.values[(slice * height + y + dy) * width + x + dx])
        };
        let row = |dy| node(0, dy) + u * (node(1, dy) - node(0, dy));
        row(0) + v * (row(1) - row(0))
    }
}

/// Reads a file of RGB values.
///
/// # Errors
/// When it is cut short, spectral, or its fields do not fit each other.
pub fn read(path: &Path) -> Result<Rgl, FileError> {
    Rgl::of(path, &read_tensor_file(path)?)
}

impl Rgl {
    /// Of a file's fields; `path` is for messages.
    ///
    /// # Errors
    /// As [`read`].
    pub fn of(path: &Path, fields: &BTreeMap<String, Field>) -> Result<Self, FileError> {
        material(&Fields { path, fields })
    }
}

fn material(fields: &Fields<'_>) -> Result<Rgl, FileError> {
    let path = fields.path;
    if fields.fields.contains_key("spectra") && !fields.fields.contains_key("rgb") {
        return Err(FileError::new(
            path,
            "holds spectra, not RGB",
            "give the file of the same material that ends in _rgb.bsdf",
        ));
    }
    let angles = |name| {
        let (shape, angles) = fields.floats(name)?;
        let angles: Vec<f64> = angles.iter().map(|angle| f64::from(*angle)).collect();
        let rise = angles.windows(2).all(|pair| pair[0] < pair[1]);
        if shape.len() == 1 && !angles.is_empty() && rise {
            return Ok(angles);
        }
        Err(fields.misfit(name))
    };
    let (phi_i, theta_i) = (angles("phi_i")?, angles("theta_i")?);
    let lights = phi_i.len() * theta_i.len();
    let table = |name, slices: usize| {
        let (shape, values) = fields.floats(name)?;
        let size = match shape {
            [.., height, width] if *width >= 2 && *height >= 2 => [*width, *height],
            _ => return Err(fields.misfit(name)),
        };
        let is_whole = values.len() == slices * size[0] * size[1];
        if is_whole && values.iter().all(|v| v.is_finite()) {
            let values = values.to_vec();
            return Ok(Table { size, values });
        }
        Err(fields.misfit(name))
    };
    let vndf = table("vndf", lights)?;
    let vndf = Densities::new(vndf.size, vndf.values).ok_or_else(|| fields.misfit("vndf"))?;
    let parts = match phi_i.as_slice() {
        [first, .., last] if phi_i.len() > 2 => (TAU / (last - first)).round() as u32,
        _ => 1,
    };
    if ![1, 2, 4].contains(&parts) {
        return Err(fields.misfit("phi_i"));
    }
    Ok(Rgl {
        parts,
        ndf: table("ndf", 1)?,
        sigma: table("sigma", 1)?,
        vndf,
        rgb: table("rgb", 3 * lights)?,
        phi_i,
        theta_i,
    })
}

/// The fields of a file.
struct Fields<'a> {
    path: &'a Path,
    fields: &'a BTreeMap<String, Field>,
}

impl Fields<'_> {
    fn floats(&self, name: &str) -> Result<(&[usize], &[f32]), FileError> {
        match self.fields.get(name) {
            Some(Field {
                shape,
                data: Data::Floats(floats),
            }) => Ok((shape, floats)),
            Some(_) => Err(self.misfit(name)),
            None => Err(FileError::new(
                self.path,
                format_args!(
                    "has no field '{name}'; found {}",
                    self.fields.keys().cloned().collect::<Vec<_>>().join(", ")
                ),
                "give a file that Mitsuba's 'measured' reads",
            )),
        }
    }

    fn misfit(&self, name: &str) -> FileError {
        FileError::new(
            self.path,
            format_args!("the field '{name}' is not what it should be in shape, type or values"),
            "copy the file again",
        )
    }
}

impl ForeignBrdf for Rgl {
    fn gaps(&self) -> Option<Gaps> {
        None
    }
}

impl Rgl {
    /// Whether azimuths count from the light's.
    fn is_isotropic(&self) -> bool {
        self.phi_i.len() <= 2
    }

    /// The up to four lights about a direction, with their shares.
    fn lights_about(&self, theta: f64, phi: f64) -> Vec<Share> {
        let mut shares = Vec::with_capacity(4);
        for (p, of_phi) in between(&self.phi_i, phi) {
            for (t, of_theta) in between(&self.theta_i, theta) {
                if of_phi * of_theta > 0.0 {
                    shares.push((p * self.theta_i.len() + t, of_phi * of_theta));
                }
            }
        }
        shares
    }
}

/// The nodes beside a value, with their shares; the last one beyond the ends.
fn between(nodes: &[f64], value: f64) -> [(usize, f64); 2] {
    let last = nodes.len() - 1;
    let above = nodes.partition_point(|node| *node <= value).min(last);
    let below = above.saturating_sub(1);
    if below == above {
        return [(below, 1.0), (above, 0.0)];
    }
    let share = (value - nodes[below]) / (nodes[above] - nodes[below]);
    let share = share.clamp(0.0, 1.0);
    [(below, 1.0 - share), (above, share)]
}

impl Brdf for Rgl {
    fn eval(&self, mut light: Vec3, mut view: Vec3) -> [f64; 3] {
        if self.parts >= 2 {
            // The file holds the azimuths from −π on: the rest by a half turn, or by two mirrors.
            let turns_y = light[1] > 0.0;
            let turns_x = if self.parts == 4 {
                light[0] > 0.0
            } else {
                turns_y
            };
            for v in [&mut light, &mut view] {
                v[0] = if turns_x { -v[0] } else { v[0] };
                v[1] = if turns_y { -v[1] } else { v[1] };
            }
        }
        let m = normalize([0, 1, 2].map(|i| light[i] + view[i]));
        let theta_of = |v: Vec3| v[0].hypotenuse(v[1]).arc_tangent2(v[2]);
        let (theta_i, phi_i) = (theta_of(light), light[1].arc_tangent2(light[0]));
        let phi_m = if self.is_isotropic() {
            // The half vector turned by −φi.
            let (x, y) = (light[0], light[1]);
            place_of_phi(m[0] * x + m[1] * y, m[1] * x - m[0] * y)
        } else {
            place_of_phi(m[0], m[1])
        };
        let place = [place_of_theta(theta_of(m)), phi_m];
        let of_light = [place_of_theta(theta_i), place_of_phi(light[0], light[1])];
        let shares = self.lights_about(theta_i, phi_i);
        let uniform = self.vndf.to_uniform(place, &shares);
        let factor = self.ndf.at(place, 0) / (4.0 * self.sigma.at(of_light, 0) * view[2]);
        [0, 1, 2].map(|c| {
            let value = |(light, share): &Share| share * self.rgb.at(uniform, 3 * light + c);
            factor * shares.iter().map(value).sum::<f64>()
        })
    }
}
