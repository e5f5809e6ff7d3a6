//! What is measured: materials of the demo, and made-up ones that nothing in gonia was chosen on.

use gonia_brdf::Vec3;
use gonia_brdf::model::{Brdf, Ggx, Kurt, KurtLobe, Material, Ward};
use std::sync::Arc;

/// Materials of the demo.
pub const OWN: [&str; 9] = [
    "white",
    "fabric",
    "satin-paint",
    "shot-silk",
    "lambert",
    "brushed-metal",
    "linen",
    "silk",
    "satin",
];

/// Made-up ones.
pub const UNSEEN: [&str; 4] = ["sheen", "cross", "pearl", "slate"];

/// Two BRDFs together.
struct Sum<A, B>(A, B);

impl<A: Brdf, B: Brdf> Brdf for Sum<A, B> {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let (a, b) = (self.0.eval(light, view), self.1.eval(light, view));
        [0, 1, 2].map(|c| a[c] + b[c])
    }
}

/// Values that turn with the azimuth by a half: a base that is no lobe.
struct Wavy {
    of: f64,
    by: f64,
}

impl Brdf for Wavy {
    fn eval(&self, light: Vec3, view: Vec3) -> [f64; 3] {
        let turn = |d: Vec3| d[0] * d[0] - d[1] * d[1] + d[0] * d[1];
        [self.of * (1.0 + self.by * (turn(light) + turn(view))) / std::f64::consts::PI; 3]
    }
}

fn ggx(diffuse: f64, specular: f64, alpha: [f64; 2], azimuth_deg: f64) -> Ggx {
    Ggx {
        diffuse: [diffuse; 3],
        specular: [specular; 3],
        f0: 0.06,
        alpha_x: alpha[0],
        alpha_y: alpha[1],
        azimuth_deg,
    }
}

/// The material of one of these names.
pub fn named(name: &str) -> Arc<dyn Brdf> {
    match name {
        // Dark, with a broad lobe.
        "sheen" => Arc::new(ggx(0.03, 1.0, [0.45, 0.3], 65.0)),
        // Two narrow crossed lobes of unequal width.
        "cross" => {
            let lobe = |mx: f64, my: f64, azimuth_deg: f64| KurtLobe {
                specular: [0.06; 3],
                f0: 0.08,
                mx,
                my,
                alpha: 0.2,
                azimuth_deg,
            };
            let lobes = [lobe(0.12, 0.5, 50.0), lobe(0.3, 0.18, 115.0)];
            Arc::new(Kurt::new([0.12; 3], &lobes))
        }
        // A bright base under a medium lobe, on values that turn.
        "pearl" => Arc::new(Sum(
            ggx(0.3, 1.0, [0.22, 0.28], 10.0),
            Wavy { of: 0.25, by: 0.3 },
        )),
        // Dull, nearly matte, with a wide off-axis streak.
        "slate" => Arc::new(Sum(
            Ward {
                diffuse: [0.08; 3],
                specular: [0.05; 3],
                alpha_x: 0.5,
                alpha_y: 0.2,
                azimuth_deg: 140.0,
            },
            Wavy { of: 0.05, by: 0.2 },
        )),
        _ => Material::named(name).expect("a material of the demo").brdf,
    }
}
