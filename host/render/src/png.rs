//! PNG in memory.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;

/// Encodes `width` × `height` pixels of 8-bit sRGB, row by row from the top left.
pub fn rgb(pixels: &[[u8; 3]], width: usize, height: usize) -> Vec<u8> {
    encode(pixels.as_flattened(), width, height, ::png::ColorType::Rgb)
}

/// Encodes pixels with an opacity.
pub fn rgba(pixels: &[[u8; 4]], width: usize, height: usize) -> Vec<u8> {
    encode(pixels.as_flattened(), width, height, ::png::ColorType::Rgba)
}

fn encode(bytes: &[u8], width: usize, height: usize, color: ::png::ColorType) -> Vec<u8> {
    let mut out = Vec::new();
    let mut encoder = ::png::Encoder::new(&mut out, width as u32, height as u32);
    encoder.set_color(color);
    encoder.set_depth(::png::BitDepth::Eight);
    encoder.set_source_srgb(::png::SrgbRenderingIntent::Perceptual);
    encoder.set_compression(::png::Compression::Balanced);
    // Writing to memory fails only when the bytes do not fit the size, which is ours to keep.
    let written = encoder
        .write_header()
        .and_then(|mut writer| writer.write_image_data(bytes));
    debug_assert!(written.is_ok(), "{written:?}");
    out
}

/// A PNG as the address of an image in HTML or SVG.
pub fn data_uri(png: &[u8]) -> String {
    format!("data:image/png;base64,{}", STANDARD.encode(png))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pixels_come_back() {
        let pixels: Vec<[u8; 3]> = (0..6u8).map(|k| [k, 2 * k, 255 - k]).collect();
        let bytes = rgb(&pixels, 3, 2);
        let mut reader = ::png::Decoder::new(std::io::Cursor::new(&bytes))
            .read_info()
            .unwrap();
        let mut back = vec![0; reader.output_buffer_size().unwrap()];
        let info = reader.next_frame(&mut back).unwrap();
        assert_eq!((info.width, info.height), (3, 2));
        assert_eq!(back, pixels.as_flattened());
        assert!(data_uri(&bytes).starts_with("data:image/png;base64,iVBORw0KGgo"));
    }
}
