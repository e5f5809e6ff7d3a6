//! Single precision numbers as bytes, little-endian on every system.

/// So many at a time become bytes.
const CHUNK: usize = 1 << 18;

/// Writes their bytes: without all of them in memory once more. `write` is given how many went before, and bytes.
///
/// # Errors
/// The first of `write`'s.
pub(crate) fn write_bytes<E>(
    values: &[f32],
    mut write: impl FnMut(usize, &[u8]) -> Result<(), E>,
) -> Result<(), E> {
    let chunks = values.chunks(CHUNK).enumerate();
    chunks
        .map(|(k, chunk)| (k * CHUNK, to_bytes(chunk)))
        .try_for_each(|(before, bytes)| write(before, &bytes))
}

/// Their bytes.
pub(crate) fn to_bytes(values: &[f32]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(4 * values.len());
    for value in values {
        bytes.extend_from_slice(&value.to_le_bytes());
    }
    bytes
}

/// The numbers of bytes; of a number that is cut off nothing.
pub(crate) fn floats_of(bytes: &[u8]) -> impl Iterator<Item = f32> {
    bytes
        .as_chunks::<4>()
        .0
        .iter()
        .map(|b| f32::from_le_bytes(*b))
}
