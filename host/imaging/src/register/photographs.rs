//! Lines in photographs by a real camera: its noise, its compression, its lens.

use super::*;
use gonia_brdf::{Elementary, Pose};
use gonia_rig::{CameraGeometry, TargetPlace};

/// The edges of five squares by five, as if the target's lines ran along them.
const TARGET: Target = Target {
    line_offset_mm: 335.0,
    line_width_mm: 7.0,
    material_half_mm: 280.0,
    mark_mm: None,
    mark_radius_mm: None,
    mirror_height_mm: None,
    place: TargetPlace {
        height_mm: 0.0,
        tilt_deg: [0.0; 2],
        offset_mm: [0.0; 2],
    },
};
const SQUARE_MM: f64 = 2.0 * 335.0 / 5.0;

/// A photograph of a chessboard, cut to five squares by five, and its 36 corners.
struct Photograph {
    png: &'static [u8],
    corners_csv: &'static str,
    /// Where the lens' axis meets it.
    centre_px: [f64; 2],
}

const PHOTOGRAPHS: [Photograph; 3] = [
    Photograph {
        png: include_bytes!("../../tests/photographs/chessboard_02.png"),
        corners_csv: include_str!("../../tests/photographs/chessboard_02.csv"),
        centre_px: [115.825, 129.488],
    },
    Photograph {
        png: include_bytes!("../../tests/photographs/chessboard_11.png"),
        corners_csv: include_str!("../../tests/photographs/chessboard_11.csv"),
        centre_px: [114.825, 117.488],
    },
    Photograph {
        png: include_bytes!("../../tests/photographs/chessboard_14.png"),
        corners_csv: include_str!("../../tests/photographs/chessboard_14.csv"),
        centre_px: [138.825, 119.488],
    },
];

/// Its edges: the length of the gradient, by central differences.
fn edges(png: &[u8]) -> Frame {
    let mut reader = png::Decoder::new(std::io::Cursor::new(png))
        .read_info()
        .unwrap();
    let mut grey = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut grey).unwrap();
    let (width, height) = (info.width as usize, info.height as usize);
    let at = |x: usize, y: usize| f32::from(grey[y * info.line_size + x]);
    let mut rgb = vec![[0.0; 3]; width * height];
    for y in 1..height - 1 {
        for x in 1..width - 1 {
            let across = at(x + 1, y) - at(x - 1, y);
            let down = at(x, y + 1) - at(x, y - 1);
            rgb[y * width + x] = [across.hypotenuse(down); 3];
        }
    }
    Frame { width, height, rgb }
}

/// Places in mm on the board and in pixels of the picture.
fn corners(csv: &str) -> Vec<([f64; 2], [f64; 2])> {
    let rows = csv.lines().skip(1);
    rows.map(|row| {
        let n: Vec<f64> = row.split(',').map(|n| n.parse().unwrap()).collect();
        let mm = [(n[0] - 2.5) * SQUARE_MM, (2.5 - n[1]) * SQUARE_MM];
        (mm, [n[2], n[3]])
    })
    .collect()
}

fn rms(distances: impl Iterator<Item = f64> + Clone) -> f64 {
    let count = distances.clone().count() as f64;
    (distances.map(|d| d * d).sum::<f64>() / count).sqrt()
}

#[test]
fn lines_in_a_photograph_are_found_from_corners_pointed_at_by_hand() {
    for (number, photograph) in PHOTOGRAPHS.iter().enumerate() {
        let frame = edges(photograph.png);
        let rig = Rig {
            camera: CameraGeometry {
                distance_m: 1.8,
                width_px: frame.width,
                height_px: frame.height,
                focal_px: 532.941,
                centre_px: photograph.centre_px,
                k1: -0.2904,
                k2: 0.1048,
                ..Rig::paper(frame.width).camera
            },
            target: TARGET,
            ..Rig::paper(frame.width)
        };
        let registrar = Registrar::new(&rig);
        let seen = corners(photograph.corners_csv);
        let a = TARGET.line_offset_mm;
        let outer = [[-a, -a], [a, -a], [a, a], [-a, a]];
        // Four corners, each pointed at some pixels off.
        let off = [[4.0, -3.0], [-5.0, 2.0], [3.0, 4.0], [-2.0, -5.0]];
        let pointed_at = [0, 1, 2, 3].map(|i| {
            let nearest = |p: &&([f64; 2], [f64; 2])| {
                (p.0[0] - outer[i][0]).hypotenuse(p.0[1] - outer[i][1]) < 1.0
            };
            let corner = registrar
                .camera
                .undistort(seen.iter().find(nearest).unwrap().1);
            [corner[0] + off[i][0], corner[1] + off[i][1]]
        });
        let predicted = Homography::from_corners(&outer, &pointed_at).unwrap();
        let search_px = SEARCH_WIDTHS * frame.width as f64 + 4.0;
        let shot = registrar.shot(&frame, Pose::from_deg([0.0; 4]));
        let strips = registrar.strips(&shot, &predicted, search_px);
        let hough = strips.each_ref().map(|strip| {
            strongest_line(
                &frame,
                strip,
                0.5 * TARGET.line_width_mm,
                search_px,
                HOUGH_RESOLUTION,
                LineEdges::Together,
            )
        });
        let fit = fit_lines(&strips, &Starts::Around(hough), &TARGET);
        let lines = fit.lines.map(|line| line.expect("a line is missing").line);
        let lines: Vec<f64> = lines.iter().flat_map(|l| [l.offset, l.slope]).collect();
        let found = registrar
            .homography(&strips, &lines.try_into().unwrap())
            .unwrap();
        let miss = |map: &Homography, (mm, px): &([f64; 2], [f64; 2])| {
            let at = registrar.camera.distort(map.apply(*mm));
            (at[0] - px[0]).hypotenuse(at[1] - px[1])
        };
        let before = rms(seen.iter().map(|c| miss(&predicted, c)));
        let after = rms(seen.iter().map(|c| miss(&found, c)));
        println!(
            "{number}: {before:.2} px by hand, {after:.3} px by the lines, blur {:.2}",
            fit.sigma_px
        );
        assert!(before > 2.0);
        assert!(after < 0.3, "{number}: {after}");
    }
}
