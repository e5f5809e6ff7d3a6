//! Linear sRGB as the CIE's X, Y, Z over those of its white point, and back.

/// Of sRGB's primaries (IEC 61966-2-1), under D65.
const XYZ: [[f64; 3]; 3] = [
    [0.4124, 0.3576, 0.1805],
    [0.2126, 0.7152, 0.0722],
    [0.0193, 0.1192, 0.9505],
];

/// Rows of the matrix that keeps greys.
fn rows() -> [[f64; 3]; 3] {
    XYZ.map(|row| {
        let white: f64 = row.iter().sum();
        row.map(|v| v / white)
    })
}

/// X, Y, Z of a colour.
pub fn xyz_of(rgb: [f64; 3]) -> [f64; 3] {
    rows().map(|row| (0..3).map(|c| row[c] * rgb[c]).sum())
}

/// The colour of X, Y, Z; what lies outside of the primaries has a component at 0.
pub fn rgb_of(xyz: [f64; 3]) -> [f64; 3] {
    let m = rows();
    let minor = |i: usize, j: usize| {
        let (a, b, c, d) = ((i + 1) % 3, (i + 2) % 3, (j + 1) % 3, (j + 2) % 3);
        m[a][c] * m[b][d] - m[a][d] * m[b][c]
    };
    let determinant: f64 = (0..3).map(|j| m[0][j] * minor(0, j)).sum();
    [0, 1, 2].map(|c| {
        let sum: f64 = (0..3).map(|row| minor(row, c) * xyz[row]).sum();
        (sum / determinant).max(0.0)
    })
}

/// Y, u', v' (CIE 1976) of X, Y, Z; a black is a grey.
pub fn yuv_of([x, y, z]: [f32; 3]) -> [f32; 3] {
    let sum = x + 15.0 * y + 3.0 * z;
    if sum > 0.0 {
        [y, 4.0 * x / sum, 9.0 * y / sum]
    } else {
        [0.0, 4.0 / 19.0, 9.0 / 19.0]
    }
}

/// X, Y, Z of Y, u', v'.
pub fn xyz_of_yuv([y, u, v]: [f64; 3]) -> [f64; 3] {
    if v <= 0.0 {
        return [y; 3];
    }
    let by = y / (4.0 * v);
    [9.0 * u * by, y, (12.0 - 3.0 * u - 20.0 * v) * by]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_come_back_and_greys_have_three_equal_values() {
        let rgb = [0.1, 0.7, 0.4];
        let back = rgb_of(xyz_of(rgb));
        assert!((0..3).all(|c| (back[c] - rgb[c]).abs() < 1e-9));
        let yuv = yuv_of(xyz_of(rgb).map(|v| v as f32)).map(f64::from);
        let back = rgb_of(xyz_of_yuv(yuv));
        assert!((0..3).all(|c| (back[c] - rgb[c]).abs() < 1e-5));
        assert!(xyz_of([0.3; 3]).iter().all(|v| (v - 0.3).abs() < 1e-12));
    }
}
