//! A rig's numbers by their keys.

use crate::Rig;

impl Rig {
    /// A number of the geometry by its key in `rig.toml`, an element of an array with its index from 0:
    /// `camera.centre_px[0]`. `None` where a calibration finds no such number.
    pub fn number_mut(&mut self, key: &str) -> Option<&mut f64> {
        let (table, name) = key.rsplit_once('.')?;
        let (name, index) = match name.strip_suffix(']').and_then(|n| n.split_once('[')) {
            Some((name, index)) => (name, index.parse().ok()?),
            None => (name, 0),
        };
        let (light, camera, target) = (&mut self.light, &mut self.camera, &mut self.target);
        Some(match (table, name) {
            ("light", "distance_m") => &mut light.distance_m,
            ("light", "beam") => light.beam.get_mut(index)?,
            ("camera", "distance_m") => &mut camera.distance_m,
            ("camera", "focal_px") => &mut camera.focal_px,
            ("camera", "focal_y_px") => camera.focal_y_px.as_mut()?,
            ("camera", "centre_px") => camera.centre_px.get_mut(index)?,
            ("camera", "k1") => &mut camera.k1,
            ("camera", "k2") => &mut camera.k2,
            ("camera", "k3") => &mut camera.k3,
            ("camera", "p1") => &mut camera.p1,
            ("camera", "p2") => &mut camera.p2,
            ("camera.mount", "roll_deg") => &mut camera.mount.roll_deg,
            ("camera.mount", "aim_mm") => camera.mount.aim_mm.get_mut(index)?,
            ("target.place", "height_mm") => &mut target.place.height_mm,
            ("target.place", "tilt_deg") => target.place.tilt_deg.get_mut(index)?,
            ("target.place", "offset_mm") => target.place.offset_mm.get_mut(index)?,
            ("light.arm" | "camera.arm", _) => {
                let arm = match table {
                    "light.arm" => &mut light.arm,
                    _ => &mut camera.arm,
                };
                match name {
                    "theta_zero_deg" => &mut arm.theta_zero_deg,
                    "phi_zero_deg" => &mut arm.phi_zero_deg,
                    "axis_miss_mm" => &mut arm.axis_miss_mm,
                    "axis_square_deg" => &mut arm.axis_square_deg,
                    "right_mm" => &mut arm.right_mm,
                    _ => return None,
                }
            }
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_key_leads_to_its_number_and_another_to_none() {
        let mut rig = Rig::paper(400);
        *rig.number_mut("camera.centre_px[1]").unwrap() = 7.0;
        *rig.number_mut("light.arm.right_mm").unwrap() = 6.0;
        *rig.number_mut("target.place.tilt_deg[0]").unwrap() = 0.1;
        assert_eq!(rig.camera.centre_px, [200.0, 7.0]);
        assert_eq!(rig.light.arm.right_mm, 6.0);
        assert_eq!(rig.target.place.tilt_deg, [0.1, 0.0]);
        let none = [
            "camera.centre_px[2]",
            "camera.width_px",
            "light",
            "light.arm.roll",
        ];
        for key in none {
            assert_eq!(rig.number_mut(key), None, "{key}");
        }
    }
}
