//! Numbers that look random and are the same every time.

/// Number `k` of a stream, in 0 .. 1: a hash of both (the finaliser of splitmix64), so that numbers may
/// be taken in any order.
pub fn uniform(stream: u64, k: usize) -> f64 {
    let mut x = (k as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15) ^ (stream << 56 | stream);
    x ^= x >> 31;
    x = x.wrapping_mul(0xbf58_476d_1ce4_e5b9);
    x ^= x >> 29;
    x = x.wrapping_mul(0x94d0_49bb_1331_11eb);
    (x >> 11) as f64 / (1u64 << 53) as f64
}
