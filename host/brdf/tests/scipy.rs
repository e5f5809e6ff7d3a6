//! The baselines against scipy's `RBFInterpolator`: the numbers are printed by `bench/baselines/scipy_reference.py`,
//! which makes the same bins.

#![allow(clippy::unwrap_used)]

use gonia_brdf::Elementary;
use gonia_brdf::baselines::{BaselineSettings, BasisFunction, Predictor, Rule, Workspace};
use gonia_brdf::direction::{Vec3, dot};
use gonia_brdf::{Bins, Direction, Grid, Sample};

const QUERIES: [[f64; 4]; 4] = [
    [33.3, 47.1, 21.7, 160.9],
    [12.9, 301.3, 55.1, 0.7],
    [78.3, 359.1, 64.7, 181.3],
    [41.9, 95.3, 43.1, 93.7],
];

/// As printed, case by case, query by query.
const SCIPY: [[f64; 3]; 24] = [
    // linear, smoothing 0.001, 200 neighbours, length None
    [0.672795316889, 1.01367215973, 0.345061020721],
    [0.545228232621, 1.00041460974, 0.244630851136],
    [0.908090809988, 0.994110412617, 0.284564922661],
    [0.502903909643, 0.987221680115, 0.202182844309],
    // linear, smoothing 0.0, 50 neighbours, length None
    [0.679675655656, 1.01357276308, 0.347940399558],
    [0.545824776768, 1.00059280696, 0.244697687006],
    [0.911986359754, 0.994097605745, 0.284746989306],
    [0.501933995097, 0.986756537112, 0.20117445826],
    // thin_plate_spline, smoothing 0.001, 200 neighbours, length None
    [0.670201956579, 1.01367245531, 0.342826256835],
    [0.545505690397, 1.00041132363, 0.244419695551],
    [0.905229533919, 0.993695659444, 0.274402824564],
    [0.504494936338, 0.987110757066, 0.20339952578],
    // cubic, smoothing 0.01, 100 neighbours, length None
    [0.672280859384, 1.01346367186, 0.342712723054],
    [0.54646953576, 1.00023429419, 0.245456410329],
    [0.902902072972, 0.993780006866, 0.274587468774],
    [0.503283049889, 0.987234973825, 0.202509348797],
    // gaussian, smoothing 0.001, 60 neighbours, length 0.5
    [0.686879278797, 1.01401188638, 0.354075772446],
    [0.553293931463, 1.00051585939, 0.251480530835],
    [0.915337449358, 0.996505860855, 0.294565666703],
    [0.499910225658, 0.982765624749, 0.199504279451],
    // multiquadric, smoothing 0.001, 60 neighbours, length 0.5
    [0.677909527647, 1.01372883987, 0.347387597405],
    [0.547123998148, 1.00050008279, 0.245725318349],
    [0.903077778175, 0.993505010464, 0.27156691983],
    [0.502098802087, 0.987030538847, 0.201436698316],
];

fn bins() -> Bins {
    let grid = Grid::with_step_deg(10.0).unwrap();
    let samples: Vec<Sample> = (0..3000u64)
        .map(|k| {
            let cell = k * 104_729 % (288 * 288);
            let light = grid.direction(36 + cell as usize / 288);
            let view = grid.direction(36 + cell as usize % 288);
            Sample::new(
                light,
                view,
                value(light.to_vec3(), view.to_vec3()).map(|v| v as f32),
            )
        })
        .collect();
    let bins = Bins::new(grid, &samples);
    assert_eq!(bins.bins().len(), samples.len());
    bins
}

fn value(i: Vec3, v: Vec3) -> [f64; 3] {
    let d = [i[0] + v[0], i[1] + v[1], i[2] + v[2] - 1.2];
    let lobe = (-3.0 * dot(d, d)).exponential();
    [0.5 + lobe, 1.0 + 0.3 * i[0] * v[1], 0.2 + lobe * i[2]]
}

#[test]
fn radial_basis_functions_give_what_scipy_gives() {
    let bins = bins();
    let rbf = |kernel: BasisFunction, nugget, neighbours| BaselineSettings {
        rule: Rule::Rbf {
            kernel,
            length: kernel.usual_length().unwrap_or(1.0),
        },
        neighbours,
        nugget,
        ..BaselineSettings::PAPER
    };
    let cases = [
        (BaselineSettings::PAPER, 1e-9),
        // Without a nugget, or with a tail along six nearly dependent axes, more digits are lost.
        (rbf(BasisFunction::Linear, 0.0, 50), 1e-9),
        (rbf(BasisFunction::ThinPlate, 1e-3, 200), 1e-9),
        (rbf(BasisFunction::Cubic, 1e-2, 100), 1e-9),
        (rbf(BasisFunction::Gaussian, 1e-3, 60), 1e-9),
        (rbf(BasisFunction::Multiquadric, 1e-3, 60), 1e-9),
    ];
    let mut work = Workspace::default();
    for ((settings, tolerance), expected) in cases.iter().zip(SCIPY.chunks(QUERIES.len())) {
        let predictor = Predictor::new(&bins, settings).unwrap();
        for (query, expected) in QUERIES.iter().zip(expected) {
            let light = Direction::from_deg(query[0], query[1]).to_vec3();
            let view = Direction::from_deg(query[2], query[3]).to_vec3();
            let got = predictor.at(light, view, &mut work).unwrap();
            for c in 0..3 {
                let off = (got[c] - expected[c]).abs();
                assert!(
                    off < *tolerance,
                    "{settings} at {query:?}: {got:?}, {expected:?}"
                );
            }
        }
    }
}
