//! Elementary functions that give the same bits on every system.

/// Sine, exponential and the like, computed by the program itself. The functions of this kind that
/// the standard library has call those of the system, whose last bits differ between Linux, Windows
/// and macOS; a kriging system of poor condition turns them into the seventh digit of a sample.
/// `clippy.toml` refuses the others.
pub trait Elementary: Copy {
    /// sin x, of radians.
    fn sine(self) -> Self;
    /// cos x, of radians.
    fn cosine(self) -> Self;
    /// sin x and cos x, of radians.
    fn sine_cosine(self) -> (Self, Self);
    /// tan x, of radians.
    fn tangent(self) -> Self;
    /// The angle in −π/2 ..= π/2 with this sine, radians; NaN beyond ±1.
    fn arc_sine(self) -> Self;
    /// The angle in 0 ..= π with this cosine, radians; NaN beyond ±1.
    fn arc_cosine(self) -> Self;
    /// The angle in −π/2 ..= π/2 with this tangent, radians.
    fn arc_tangent(self) -> Self;
    /// The angle in −π ..= π of the point (`x`, self), radians.
    fn arc_tangent2(self, x: Self) -> Self;
    /// eˣ.
    fn exponential(self) -> Self;
    /// ln x; NaN below 0.
    fn natural_log(self) -> Self;
    /// log₁₀ x; NaN below 0.
    fn decimal_log(self) -> Self;
    /// xʸ.
    fn power(self, exponent: Self) -> Self;
    /// √(x² + y²).
    fn hypotenuse(self, other: Self) -> Self;
}

/// The functions of one type by those of libm.
macro_rules! elementary {
    ($float:ty: $sin:ident $cos:ident $sincos:ident $tan:ident $asin:ident $acos:ident $atan:ident
        $atan2:ident $exp:ident $log:ident $log10:ident $pow:ident $hypot:ident) => {
        impl Elementary for $float {
            #[inline]
            fn sine(self) -> Self {
                libm::$sin(self)
            }
            #[inline]
            fn cosine(self) -> Self {
                libm::$cos(self)
            }
            #[inline]
            fn sine_cosine(self) -> (Self, Self) {
                libm::$sincos(self)
            }
            #[inline]
            fn tangent(self) -> Self {
                libm::$tan(self)
            }
            #[inline]
            fn arc_sine(self) -> Self {
                libm::$asin(self)
            }
            #[inline]
            fn arc_cosine(self) -> Self {
                libm::$acos(self)
            }
            #[inline]
            fn arc_tangent(self) -> Self {
                libm::$atan(self)
            }
            #[inline]
            fn arc_tangent2(self, x: Self) -> Self {
                libm::$atan2(self, x)
            }
            #[inline]
            fn exponential(self) -> Self {
                libm::$exp(self)
            }
            #[inline]
            fn natural_log(self) -> Self {
                libm::$log(self)
            }
            #[inline]
            fn decimal_log(self) -> Self {
                libm::$log10(self)
            }
            #[inline]
            fn power(self, exponent: Self) -> Self {
                libm::$pow(self, exponent)
            }
            #[inline]
            fn hypotenuse(self, other: Self) -> Self {
                libm::$hypot(self, other)
            }
        }
    };
}

elementary!(f64: sin cos sincos tan asin acos atan atan2 exp log log10 pow hypot);
elementary!(f32: sinf cosf sincosf tanf asinf acosf atanf atan2f expf logf log10f powf hypotf);

#[cfg(test)]
mod tests {
    use super::*;

    /// Bits that must be the same wherever the tests run.
    #[test]
    fn the_bits_are_those_of_every_other_system() {
        let x = 0.734_251_f64;
        let values = [
            x.sine(),
            x.cosine(),
            x.tangent(),
            x.arc_sine(),
            x.arc_cosine(),
            x.arc_tangent(),
            x.arc_tangent2(-0.3),
            x.exponential(),
            x.natural_log(),
            x.decimal_log(),
            x.power(0.31),
            x.hypotenuse(1.7),
        ];
        let bits = values.map(f64::to_bits);
        assert_eq!(bits, BITS, "{bits:#x?}");
        assert_eq!(x.sine_cosine(), (x.sine(), x.cosine()));
    }

    /// Each within a unit of the last place of the correct value.
    const BITS: [u64; 12] = [
        0x3fe5_70e5_8e9e_266f,
        0x3fe7_c130_bf6c_8a4b,
        0x3fec_e21e_4dc2_e634,
        0x3fea_62d1_614f_355f,
        0x3fe7_e125_4739_24d2,
        0x3fe4_445d_68e0_7a7e,
        0x3fff_56bd_ad40_6794,
        0x4000_abde_89bb_3cdb,
        0xbfd3_c516_bcf5_1fa6,
        0xbfc1_2c01_824e_4a7e,
        0x3fed_13eb_c403_db49,
        0x3ffd_a0ee_13cc_ce19,
    ];
}
