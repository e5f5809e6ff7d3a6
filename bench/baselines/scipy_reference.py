"""Values of scipy's RBFInterpolator on a small set of bins, as the constants that
host/brdf/src/cellwise/scipy_tests.rs is tested against.

    python bench/baselines/scipy_reference.py
"""

import numpy as np
from scipy.interpolate import RBFInterpolator
from scipy.spatial import cKDTree

N_BINS = 3000
# theta_i, phi_i, theta_v, phi_v in degrees, off the lattice, one across phi = 0 and one grazing.
QUERIES = [
    (33.3, 47.1, 21.7, 160.9),
    (12.9, 301.3, 55.1, 0.7),
    (78.3, 359.1, 64.7, 181.3),
    (41.9, 95.3, 43.1, 93.7),
]
# Kernel, smoothing, neighbours, length in radii of the neighbourhood (scipy's 1 / epsilon).
CASES = [
    ("linear", 1e-3, 200, None),
    ("linear", 0.0, 50, None),
    ("thin_plate_spline", 1e-3, 200, None),
    ("cubic", 1e-2, 100, None),
    ("gaussian", 1e-3, 60, 0.5),
    ("multiquadric", 1e-3, 60, 0.5),
]


def vectors(theta_deg, phi_deg):
    theta, phi = np.radians(theta_deg), np.radians(phi_deg)
    return np.stack(
        [np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1
    )


def bins():
    """Distinct cells of a 10 degree grid, without poles, and values that vary over it."""
    k = np.arange(N_BINS)
    cell = k * 104729 % (288 * 288)
    light, view = 36 + cell // 288, 36 + cell % 288
    i = vectors(10.0 * (light // 36), 10.0 * (light % 36))
    v = vectors(10.0 * (view // 36), 10.0 * (view % 36))
    d = i + v - np.array([0.0, 0.0, 1.2])
    lobe = np.exp(-3.0 * np.sum(d * d, axis=-1))
    values = np.stack(
        [0.5 + lobe, 1.0 + 0.3 * i[:, 0] * v[:, 1], 0.2 + lobe * i[:, 2]], axis=-1
    )
    return np.concatenate([i, v], axis=-1), values.astype(np.float32).astype(np.float64)


def main():
    points, values = bins()
    tree = cKDTree(points)
    for kernel, smoothing, neighbours, length in CASES:
        print(f"    // {kernel}, smoothing {smoothing}, {neighbours} neighbours, length {length}")
        for query in QUERIES:
            theta_i, phi_i, theta_v, phi_v = query
            at = np.concatenate([vectors(theta_i, phi_i), vectors(theta_v, phi_v)])[None]
            distances, found = tree.query(at[0], neighbours)
            epsilon = 1.0 if length is None else 1.0 / (length * distances.max())
            rbf = RBFInterpolator(
                points[found], values[found], smoothing=smoothing, kernel=kernel, epsilon=epsilon
            )
            r, g, b = rbf(at)[0]
            print(f"    [{r:.12}, {g:.12}, {b:.12}],")


if __name__ == "__main__":
    main()
