//! The blocks of one part of an EXR that show some of its rows: read in the file's order, decoded several
//! at once.

use exr::block::UncompressedBlock;
use exr::block::chunk::Chunk;
use exr::block::reader::{ChunksReader, Reader};
use exr::compression::Compression;
use exr::error::UnitResult;
use exr::math::Vec2;
use exr::meta::MetaData;
use rayon::prelude::*;
use std::io::{Read, Seek};
use std::ops::Range;

/// Blocks in memory for each thread.
const BLOCKS_A_THREAD: usize = 2;

/// Calls `take` with every block of a part, in full resolution, that shows one of `rows` of its data window,
/// in the file's order. The first and the last block are always among them: a file that was cut short does
/// not have one of them.
pub(super) fn each<R: Read + Seek>(
    reader: Reader<R>,
    part: usize,
    rows: Range<usize>,
    mut take: impl FnMut(&MetaData, UncompressedBlock) -> UnitResult,
) -> UnitResult {
    let height = reader.headers()[part].layer_size.height();
    let plain = reader.headers()[part].compression == Compression::Uncompressed;
    let mut chunks = reader.filter_chunks(false, |_, _, block| {
        let top = block.pixel_position.y();
        let bottom = top + block.pixel_size.height();
        let is_needed = top < rows.end && rows.start < bottom;
        block.layer == part
            && block.level == Vec2(0, 0)
            && (is_needed || top == 0 || bottom == height)
    })?;
    if plain {
        return chunks.decompress_sequential(false, take);
    }
    let meta = chunks.meta_data().clone();
    // In the caller's own threads, which may be at other frames: no pool is made for a frame.
    let at_once = BLOCKS_A_THREAD * rayon::current_num_threads();
    loop {
        let batch: Vec<Chunk> = chunks.by_ref().take(at_once).collect::<Result<_, _>>()?;
        if batch.is_empty() {
            return Ok(());
        }
        let decode = |chunk| UncompressedBlock::decompress_chunk(chunk, &meta, false);
        let blocks: Vec<_> = batch.into_par_iter().map(decode).collect();
        for block in blocks {
            take(&meta, block?)?;
        }
    }
}
