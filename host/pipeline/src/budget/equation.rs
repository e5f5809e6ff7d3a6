//! By which share each input's error changes a value.

use gonia_brdf::{Direction, Elementary};
use gonia_rig::{Budget, Input, ReferenceCalibration};

/// An independent error of the measurement equation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub enum Effect {
    /// The reference's reflectance.
    Reference = 0,
    /// Its departure from a Lambertian one.
    ReferenceAngle,
    /// Its tilt towards x.
    ReferenceTiltX,
    /// Its tilt towards y.
    ReferenceTiltY,
    /// Its height.
    ReferenceHeight,
    /// The lamp's drift.
    Drift,
    /// The camera's curve.
    Linearity,
    /// The black level.
    Offset,
    /// Stray light.
    StrayLight,
    /// The light's direction along its meridian …
    LightTheta,
    /// … and across it.
    LightPhi,
    /// The camera's direction along its meridian …
    ViewTheta,
    /// … and across it.
    ViewPhi,
    /// The cone of the lamp.
    Lamp,
    /// The cone of the lens.
    Lens,
    /// The patch that a sample is the median of.
    Patch,
}

/// How many there are.
const EFFECTS: usize = 16;

/// What kind of error an effect is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Of the value: reference, lamp, camera.
    Scale,
    /// Of the directions: where light and camera are, and over which cones the value is a mean.
    Direction,
}

impl Effect {
    /// All, in the order of their numbers.
    pub const ALL: [Self; EFFECTS] = [
        Self::Reference,
        Self::ReferenceAngle,
        Self::ReferenceTiltX,
        Self::ReferenceTiltY,
        Self::ReferenceHeight,
        Self::Drift,
        Self::Linearity,
        Self::Offset,
        Self::StrayLight,
        Self::LightTheta,
        Self::LightPhi,
        Self::ViewTheta,
        Self::ViewPhi,
        Self::Lamp,
        Self::Lens,
        Self::Patch,
    ];

    /// What kind of error it is.
    pub fn part(self) -> Part {
        if (self as usize) < Self::LightTheta as usize {
            Part::Scale
        } else {
            Part::Direction
        }
    }

    /// The input that it comes from; a patch's size is known.
    pub fn input(self) -> Option<Input> {
        Some(match self {
            Self::Reference => Input::Reference,
            Self::ReferenceAngle => Input::ReferenceAngle,
            Self::ReferenceTiltX | Self::ReferenceTiltY => Input::ReferenceTilt,
            Self::ReferenceHeight => Input::ReferenceHeight,
            Self::Drift => Input::Drift,
            Self::Linearity => Input::Linearity,
            Self::Offset => Input::Offset,
            Self::StrayLight => Input::StrayLight,
            Self::LightTheta | Self::LightPhi => Input::LightDirection,
            Self::ViewTheta | Self::ViewPhi => Input::ViewDirection,
            Self::Lamp => Input::LightDiameter,
            Self::Lens => Input::LensDiameter,
            Self::Patch => return None,
        })
    }
}

/// What the effects at a pair of directions change a value by, as shares of it, each for an error of one standard
/// uncertainty, with its sign. A value of a reciprocal table comes from what is measured there and from what is measured
/// with light and view exchanged. Where a share w comes from there, as far as is known, an effect is the mean w a +
/// (1 − w) b of the changes a and b of both, and the spread √(w (1 − w)) (a − b) of these about it, since nobody knows w
/// for certain: the sum of their squares is w a² + (1 − w) b², which is right where all comes from one of them and
/// cautious where from both.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Effects([[f64; EFFECTS]; 2]);

impl Effects {
    /// Of the changes there and exchanged, the share `w` from there.
    fn of_both([there, exchanged]: [[f64; EFFECTS]; 2], w: f64) -> Self {
        let spread = (w * (1.0 - w)).max(0.0).sqrt();
        let mut both = [[0.0; EFFECTS]; 2];
        for k in 0..EFFECTS {
            both[0][k] = w * there[k] + (1.0 - w) * exchanged[k];
            both[1][k] = spread * (there[k] - exchanged[k]);
        }
        Self(both)
    }

    /// The share of one effect, the mean of both measurements.
    pub fn of(&self, effect: Effect) -> f64 {
        self.0[0][effect as usize]
    }

    /// That share, and the spread about it.
    pub fn mean_and_spread(&self, effect: Effect) -> [f64; 2] {
        self.0.map(|of| of[effect as usize])
    }

    /// The square of the relative standard uncertainty by one effect.
    pub fn square(&self, effect: Effect) -> f64 {
        let [mean, spread] = self.mean_and_spread(effect);
        mean * mean + spread * spread
    }

    /// The relative standard uncertainty of a part.
    pub fn u(&self, part: Part) -> f64 {
        // Those of the scale come first.
        let split = Effect::LightTheta as usize;
        let squares = |of: &[f64]| of.iter().map(|share| share * share).sum::<f64>();
        let both = self.0.each_ref().map(|of| match part {
            Part::Scale => squares(&of[..split]),
            Part::Direction => squares(&of[split..]),
        });
        (both[0] + both[1]).sqrt()
    }

    /// Adds another's, effect by effect, times a weight: an error acts in all cells alike.
    pub fn add(&mut self, other: &Self, weight: f64) {
        for (sum, of) in self.0.iter_mut().zip(&other.0) {
            for (sum, of) in sum.iter_mut().zip(of) {
                *sum += weight * of;
            }
        }
    }
}

/// What a value's surroundings are: of the BRDF in one channel about a pair of directions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shape {
    /// The value.
    pub value: f64,
    /// Its slopes per radian: light along and across its meridian, view likewise.
    pub slopes: [f64; 4],
    /// Its second derivatives per square radian, both components together, over light and over view.
    pub bends: [f64; 2],
    /// The mean over the views that the same frame shows.
    pub surround: f64,
}

impl Shape {
    /// The surroundings of the pair with light and view exchanged, where the BRDF is the same. The frame that has the
    /// value there is taken to show the same mean.
    fn exchanged(&self) -> Self {
        let [light_theta, light_phi, view_theta, view_phi] = self.slopes;
        let [light, view] = self.bends;
        Self {
            slopes: [view_theta, view_phi, light_theta, light_phi],
            bends: [view, light],
            ..*self
        }
    }
}

/// A direction as the equation needs it.
#[derive(Clone, Copy, Debug)]
pub struct Slant {
    cosine: f64,
    per_cosine: f64,
    /// tan θ, and times cos φ and sin φ.
    slope: f64,
    tangent: [f64; 2],
    /// (1 − cos θ)².
    departs: f64,
}

/// A light that grazes is held here: its tangent has no end.
const LEAST_COSINE: f64 = 0.03;

impl Slant {
    /// Of a direction.
    pub fn of(direction: Direction) -> Self {
        let (sine, cosine) = direction.theta_deg().to_radians().sine_cosine();
        let cosine = cosine.max(LEAST_COSINE);
        let (sin_phi, cos_phi) = direction.phi_deg().to_radians().sine_cosine();
        let slope = sine / cosine;
        Self {
            cosine,
            per_cosine: 1.0 / cosine,
            slope,
            tangent: [slope * cos_phi, slope * sin_phi],
            departs: (1.0 - cosine).powi(2),
        }
    }
}

/// The measurement equation with a data set's inputs.
#[derive(Clone, Debug)]
pub struct Equation {
    is_absolute: bool,
    level: f64,
    /// Its decimal logarithm.
    level_log: f64,
    per_light_mm: f64,
    /// The standard uncertainties of the effects in radians, mm and shares; of the cones, half the variance of a
    /// component of directions in them.
    inputs: [f64; EFFECTS],
    /// Half the variance of the directions of light and view over a patch.
    patch: [f64; 2],
    /// The share of a frame that shows the sample from straight above, and what the rest adds to the sample's mean.
    frame: [f64; 2],
    /// What that and the level's own surroundings add up to, over the level.
    level_frame: f64,
}

impl Equation {
    /// Of a budget.
    pub fn new(budget: &Budget) -> Self {
        let value = |input| budget.value(input);
        // Of a component over a disc of this diameter, as it is seen from a distance: (D/4)².
        let cone = |input, distance: f64| 0.5 * (value(input) / (4.0 * distance)).powi(2);
        let inputs = Effect::ALL.map(|effect| match (effect, effect.input()) {
            (Effect::Lamp, _) => cone(Input::LightDiameter, budget.light_mm),
            (Effect::Lens, _) => cone(Input::LensDiameter, budget.camera_mm),
            (_, Some(input)) if input.unit() == "degrees" => value(input).to_radians(),
            (_, Some(input)) => value(input),
            (_, None) => 1.0,
        });
        let patch = |distance: f64| (budget.patch_mm / distance).powi(2) / 24.0;
        Self {
            is_absolute: budget.calibration == ReferenceCalibration::KnownReference,
            level: budget.level,
            level_log: budget.level.decimal_log(),
            per_light_mm: 1.0 / budget.light_mm,
            inputs,
            patch: [patch(budget.light_mm), patch(budget.camera_mm)],
            frame: [budget.frame_share, budget.surround],
            level_frame: 1.0 + budget.surround / budget.level,
        }
    }

    /// The effects at a pair of directions of a BRDF that is made reciprocal, whose value comes by the share `there`
    /// (0 ..= 1; one half where it is not known) from what is measured there, by the rest from what is measured with light and
    /// view exchanged.
    pub fn of_reciprocal(
        &self,
        (light, view): (&Slant, &Slant),
        shape: &Shape,
        there: f64,
    ) -> Effects {
        let here = self.shares(light, view, shape);
        let exchanged = self.shares(view, light, &shape.exchanged());
        Effects::of_both([here, exchanged], there)
    }

    /// The effects on a value that was measured at a pair of directions; all zero of a value that is not positive, of which nothing is a share.
    pub fn at(&self, light: &Slant, view: &Slant, shape: &Shape) -> Effects {
        Effects([self.shares(light, view, shape), [0.0; EFFECTS]])
    }

    /// The squares of the relative standard uncertainties of scale and direction ([`Effects::u`]) of what
    /// [`Self::of_reciprocal`] gives, without a list of the effects: a table has hundreds of millions of values.
    pub fn squares(&self, (light, view): (&Slant, &Slant), shape: &Shape, there: f64) -> [f64; 2] {
        let Some(bright) = self.bright(shape) else {
            return [0.0; 2];
        };
        let mut squares = [0.0; 2];
        let mut add = |effect: Effect, share: f64, weight: f64| {
            squares[usize::from(effect.part() == Part::Direction)] += weight * share * share;
        };
        self.each(light, view, shape, bright, &mut |effect, share| {
            add(effect, share, there);
        });
        let exchanged = shape.exchanged();
        self.each(view, light, &exchanged, bright, &mut |effect, share| {
            add(effect, share, 1.0 - there);
        });
        squares
    }

    fn shares(&self, light: &Slant, view: &Slant, shape: &Shape) -> [f64; EFFECTS] {
        let mut effects = [0.0; EFFECTS];
        if let Some(bright) = self.bright(shape) {
            self.each(light, view, shape, bright, &mut |effect, share| {
                effects[effect as usize] = share;
            });
        }
        effects
    }

    /// One over a value, and the decimal logarithm of the level over it; `None` of a value that is not positive.
    #[inline(always)]
    fn bright(&self, shape: &Shape) -> Option<[f64; 2]> {
        // What is known of linearity needs no more digits than single precision has.
        let log = |value: f64| f64::from((value as f32).max(f32::MIN_POSITIVE).natural_log());
        (shape.value > 0.0).then(|| {
            let log = std::f64::consts::LOG10_E * log(shape.value);
            [1.0 / shape.value, self.level_log - log]
        })
    }

    /// Gives each effect its share, of a positive value.
    #[inline(always)]
    fn each(
        &self,
        light: &Slant,
        view: &Slant,
        shape: &Shape,
        [per_value, bright_log]: [f64; 2],
        to: &mut impl FnMut(Effect, f64),
    ) {
        let Shape {
            slopes,
            bends,
            surround,
            ..
        } = *shape;
        let mut set = |effect: Effect, sensitivity: f64| {
            to(effect, self.inputs[effect as usize] * sensitivity);
        };
        let mut light_slope = slopes[0] * per_value;
        if self.is_absolute {
            set(Effect::Reference, 1.0);
            set(Effect::ReferenceAngle, light.departs + view.departs);
            set(Effect::ReferenceTiltX, light.tangent[0]);
            set(Effect::ReferenceTiltY, light.tangent[1]);
            // Of cos θ/d² at a point that is nearer to the light.
            let nearer = (3.0 * light.cosine - light.per_cosine) * self.per_light_mm;
            set(Effect::ReferenceHeight, nearer);
            set(Effect::Drift, 1.0);
        } else {
            // No reference at the same pose takes the light's cosine out.
            light_slope -= light.slope;
        }
        set(Effect::Linearity, -bright_log);
        set(
            Effect::Offset,
            (self.level * per_value - 1.0) * light.per_cosine,
        );
        // Of the sample, less what the reference (else the mean of the samples) has, over the part of the frame that
        // shows them.
        let [share, rest] = self.frame;
        let spread = (surround + rest) * per_value - self.level_frame;
        set(Effect::StrayLight, share * view.cosine * spread);
        set(Effect::LightTheta, light_slope);
        set(Effect::LightPhi, slopes[1] * per_value);
        set(Effect::ViewTheta, slopes[2] * per_value);
        set(Effect::ViewPhi, slopes[3] * per_value);
        let bends = bends.map(|bend| bend * per_value);
        set(Effect::Lamp, bends[0]);
        set(Effect::Lens, bends[1]);
        let over_patch = self.patch[0] * bends[0] + self.patch[1] * bends[1];
        set(Effect::Patch, over_patch);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gonia_brdf::Vec3;
    use gonia_brdf::direction::{dot, normalize};
    use gonia_rig::KnownFrom;

    const LEVEL: f64 = 0.3;
    const LIGHT_MM: f64 = 900.0;
    const CAMERA_MM: f64 = 1500.0;
    /// The sample's share of the frame from straight above, and what the rest adds to its mean.
    const FRAME: [f64; 2] = [0.4, 0.02];

    /// Something smooth with slopes in all directions, which is not isotropic.
    fn brdf(light: Vec3, view: Vec3) -> f64 {
        let half = normalize([0, 1, 2].map(|k| light[k] + view[k]));
        0.05 + 0.1 * light[0].powi(2)
            + 0.07 * view[1]
            + 0.4 * (-8.0 * (half[0] * half[0] + 2.0 * half[1] * half[1])).exponential()
    }

    /// Errors of one measurement, in the units of the inputs (radians for degrees).
    #[derive(Clone, Copy, Default)]
    struct Errors {
        reference: f64,
        angle: f64,
        tilt: [f64; 2],
        height: f64,
        drift: f64,
        linearity: f64,
        offset: f64,
        stray: f64,
        light: [f64; 2],
        view: [f64; 2],
    }

    /// Where a direction truly is that is off by so much along and across its meridian.
    fn off(direction: Vec3, [along, across]: [f64; 2]) -> Vec3 {
        let flat = direction[0].hypotenuse(direction[1]);
        let across_unit = [-direction[1] / flat, direction[0] / flat, 0.0];
        let along_unit = [
            direction[2] * direction[0] / flat,
            direction[2] * direction[1] / flat,
            -flat,
        ];
        normalize([0, 1, 2].map(|k| direction[k] + along * along_unit[k] + across * across_unit[k]))
    }

    /// cos θ/d² of a plane that is tilted and raised about the sample's centre.
    fn irradiance(light: Vec3, [x, y]: [f64; 2], height: f64) -> f64 {
        let normal = normalize([x, y, 1.0]);
        let to = [0, 1, 2].map(|k| LIGHT_MM * light[k] - if k == 2 { height } else { 0.0 });
        let square = dot(to, to);
        dot(normalize(to), normal) / square
    }

    /// The value that a rig with errors measures: counts of material and reference, taken for what they are not.
    fn measured(light: Vec3, view: Vec3, surround: f64, is_absolute: bool, e: Errors) -> f64 {
        let (true_light, true_view) = (off(light, e.light), off(view, e.view));
        let f = brdf(true_light, true_view);
        let above = irradiance([0.0, 0.0, 1.0], [0.0; 2], 0.0);
        let curve =
            |signal: f64, to: f64| signal * (signal / to).power(e.linearity / 10f64.natural_log());
        let departs = |d: Vec3| e.angle * (1.0 - d[2]).powi(2);
        let reference = LEVEL / (1.0 + e.reference + departs(light) + departs(view));
        let signal = |value: f64, around: f64, irradiance: f64| {
            let mean = FRAME[0] * view[2] * (around + FRAME[1]);
            (value + e.stray * mean) * irradiance + e.offset * LEVEL * above
        };
        let on_it = irradiance(true_light, [0.0; 2], 0.0);
        let material = signal(f, surround, on_it) * (1.0 + e.drift);
        if !is_absolute {
            return curve(material, LEVEL * on_it) / irradiance(light, [0.0; 2], 0.0);
        }
        // A reference that stands higher and tilted against what is thought of it.
        let on_reference = irradiance(true_light, e.tilt, e.height);
        let of_reference = signal(reference, reference, on_reference);
        curve(material, of_reference) / of_reference * LEVEL
    }

    fn shape(light: Vec3, view: Vec3, surround: f64) -> Shape {
        let h = 1e-4;
        let value = brdf(light, view);
        let at = |l: [f64; 2], v: [f64; 2]| brdf(off(light, l), off(view, v));
        let mut slopes = [0.0; 4];
        for axis in 0..2 {
            let turn = |s: f64| [0, 1].map(|k| if k == axis { s * h } else { 0.0 });
            slopes[axis] = (at(turn(1.0), [0.0; 2]) - at(turn(-1.0), [0.0; 2])) / (2.0 * h);
            slopes[2 + axis] = (at([0.0; 2], turn(1.0)) - at([0.0; 2], turn(-1.0))) / (2.0 * h);
        }
        Shape {
            value,
            slopes,
            bends: [0.0; 2],
            surround,
        }
    }

    /// Every input is one small number, so that an error of one u is that number.
    const SMALL: f64 = 1e-5;

    fn equation(calibration: ReferenceCalibration) -> Equation {
        let of = |input: Input| {
            let is_angle = input.unit() == "degrees";
            let value = if is_angle { SMALL.to_degrees() } else { SMALL };
            (value, KnownFrom::Stated)
        };
        let lengths = [LIGHT_MM, CAMERA_MM, 14.0];
        Equation::new(&Budget::new(calibration, LEVEL, lengths, of).with_frame(FRAME))
    }

    #[test]
    fn each_effect_is_what_a_rig_with_that_error_measures() {
        type Sets = fn(&mut Errors);
        let sets: [(Effect, Sets); 13] = [
            (Effect::Reference, |e| e.reference = SMALL),
            (Effect::ReferenceAngle, |e| e.angle = SMALL),
            (Effect::ReferenceTiltX, |e| e.tilt[0] = -SMALL),
            (Effect::ReferenceTiltY, |e| e.tilt[1] = -SMALL),
            (Effect::ReferenceHeight, |e| e.height = -SMALL),
            (Effect::Drift, |e| e.drift = SMALL),
            (Effect::Linearity, |e| e.linearity = SMALL),
            (Effect::Offset, |e| e.offset = SMALL),
            (Effect::StrayLight, |e| e.stray = SMALL),
            (Effect::LightTheta, |e| e.light[0] = SMALL),
            (Effect::LightPhi, |e| e.light[1] = SMALL),
            (Effect::ViewTheta, |e| e.view[0] = SMALL),
            (Effect::ViewPhi, |e| e.view[1] = SMALL),
        ];
        for [ti, pi, tv, pv] in [
            [20.0, 30.0, 40.0, 200.0],
            [70.0, 300.0, 10.0, 80.0],
            [50.0, 170.0, 75.0, 340.0],
        ] {
            let (light, view) = (Direction::from_deg(ti, pi), Direction::from_deg(tv, pv));
            let (i, v) = (light.to_vec3(), view.to_vec3());
            let slants = (Slant::of(light), Slant::of(view));
            for is_absolute in [true, false] {
                let calibration = if is_absolute {
                    ReferenceCalibration::KnownReference
                } else {
                    ReferenceCalibration::GeometricModel
                };
                let surround = 0.8 * brdf(i, v);
                let effects =
                    equation(calibration).at(&slants.0, &slants.1, &shape(i, v, surround));
                for (effect, set) in sets {
                    let scale_only = [Effect::Drift, Effect::StrayLight, Effect::Offset];
                    if !is_absolute && (scale_only.contains(&effect) || effect == Effect::Reference)
                    {
                        continue;
                    }
                    let mut errors = Errors::default();
                    set(&mut errors);
                    let (off, on) = (
                        measured(i, v, surround, is_absolute, errors),
                        measured(i, v, surround, is_absolute, Errors::default()),
                    );
                    let seen = off / on - 1.0;
                    let said = effects.of(effect);
                    assert!(
                        (seen - said).abs() < 1e-3 * SMALL + 2e-3 * seen.abs(),
                        "{effect:?} {ti} {tv} {is_absolute}: {seen:e} {said:e}"
                    );
                }
            }
        }
    }

    #[test]
    fn cones_change_a_value_by_what_its_mean_over_them_differs() {
        // A paraboloid about straight above, whose second derivatives are known.
        let (light, view) = (Direction::from_deg(0.0, 0.0), Direction::from_deg(0.0, 0.0));
        let shape = Shape {
            value: 0.5,
            slopes: [0.0; 4],
            bends: [-8.0, -4.0],
            surround: 0.5,
        };
        let rig = gonia_rig::Rig::paper(100);
        let lengths = [LIGHT_MM, CAMERA_MM, 60.0];
        let budget = Budget::new(
            ReferenceCalibration::KnownReference,
            LEVEL,
            lengths,
            |input| rig.input(input),
        )
        .with(Input::LightDiameter, 90.0)
        .with(Input::LensDiameter, 30.0);
        let effects = Equation::new(&budget).at(&Slant::of(light), &Slant::of(view), &shape);
        // The mean of a·x² + a·y² over a disc of radius r is a·r²/2, over a square of side s it is a·s²/6.
        let disc = |a: f64, r: f64| a * r * r / 2.0;
        let square = |a: f64, s: f64| a * s * s / 6.0;
        for (effect, mean) in [
            (Effect::Lamp, disc(-2.0, 45.0 / LIGHT_MM)),
            (Effect::Lens, disc(-1.0, 15.0 / CAMERA_MM)),
            (
                Effect::Patch,
                square(-2.0, 60.0 / LIGHT_MM) + square(-1.0, 60.0 / CAMERA_MM),
            ),
        ] {
            let said = effects.of(effect) * shape.value;
            assert!((said - mean).abs() < 1e-9, "{effect:?} {said} {mean}");
        }
    }

    #[test]
    fn a_reciprocal_value_has_the_effects_of_either_measurement() {
        let (light, view) = (
            Direction::from_deg(70.0, 20.0),
            Direction::from_deg(0.0, 0.0),
        );
        let slants = (Slant::of(light), Slant::of(view));
        let shape = Shape {
            value: 0.3,
            slopes: [0.4, 0.1, -0.2, 0.0],
            bends: [-1.0, 3.0],
            surround: 0.3,
        };
        let equation = equation(ReferenceCalibration::KnownReference);
        let one = equation.at(&slants.0, &slants.1, &shape);
        let of = |there| equation.of_reciprocal((&slants.0, &slants.1), &shape, there);
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9 * b.abs().max(1e-6);
        // The reference's error is the same in both; light from straight above does not show a tilt; the light stood where
        // the view is, and its error acts by the slope there.
        let tilt = one.of(Effect::ReferenceTiltX);
        let slopes = [0.4, -0.2].map(|slope| SMALL * slope / 0.3);
        for (effect, [there, exchanged]) in [
            (Effect::Reference, [one.of(Effect::Reference); 2]),
            (Effect::ReferenceTiltX, [tilt, 0.0]),
            (Effect::LightTheta, slopes),
            (Effect::ViewTheta, [slopes[1], slopes[0]]),
        ] {
            for share in [0.0, 0.3, 0.5, 1.0] {
                let both = of(share);
                let mean = share * there + (1.0 - share) * exchanged;
                assert!(close(both.of(effect), mean), "{effect:?} {share}");
                let square = share * there.powi(2) + (1.0 - share) * exchanged.powi(2);
                assert!(close(both.square(effect), square), "{effect:?} {share}");
            }
        }
    }

    #[test]
    fn nothing_is_a_share_of_nothing() {
        let slant = Slant::of(Direction::from_deg(30.0, 0.0));
        for value in [0.0, -1.0, f64::NAN] {
            let shape = Shape {
                value,
                ..Shape::default()
            };
            let known = ReferenceCalibration::KnownReference;
            assert_eq!(
                equation(known).at(&slant, &slant, &shape),
                Effects::default()
            );
        }
    }
}
