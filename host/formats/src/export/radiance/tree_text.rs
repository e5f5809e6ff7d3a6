//! A tensor tree as text: `{ v }` is a cell of one value, `{ v v … }` a block of 2^(rank·k) values whose last axis is
//! fastest, `{ { … } { … } … }` 2^rank halves whose first axis is fastest.

use std::fmt::Write;

/// A tree.
#[derive(Debug, PartialEq)]
pub enum Tree {
    /// One value.
    Leaf(f32),
    /// 2^(rank·k) values.
    Block(Vec<f32>),
    /// 2^rank trees.
    Branch(Vec<Tree>),
}

/// The text of the tree of (2^levels)^rank values, the last axis fastest. Those within a share `alike` of their mean
/// are one cell.
pub fn text_of(values: &[f32], rank: u32, levels: u32, alike: f32) -> String {
    let all = Values {
        values,
        rank,
        levels,
        alike,
    };
    let (tree, _) = of_block(&all, &vec![0; rank as usize], 1 << levels);
    let mut text = String::new();
    put(&tree, &mut text);
    text
}

/// What a tree is made of.
struct Values<'a> {
    values: &'a [f32],
    rank: u32,
    levels: u32,
    alike: f32,
}

/// Least, most and mean.
type Range = [f32; 3];

fn of_block(all: &Values<'_>, corner: &[usize], side: usize) -> (Tree, Range) {
    let Values {
        values,
        rank,
        levels,
        alike,
    } = *all;
    let corners = (0..1usize << rank).map(|branch| -> Vec<usize> {
        let half = side / 2;
        let shifted = |(axis, at): (usize, &usize)| at + half * (branch >> axis & 1);
        corner.iter().enumerate().map(shifted).collect()
    });
    let index = |place: &[usize]| place.iter().fold(0, |at, k| (at << levels) + k);
    if side == 2 {
        // In a block of values the last axis is fastest.
        let mut ordered: Vec<(usize, f32)> = corners
            .map(|place| (index(&place), values[index(&place)]))
            .collect();
        ordered.sort_by_key(|(index, _)| *index);
        let block: Vec<f32> = ordered.into_iter().map(|(_, value)| value).collect();
        let range = range_of(block.iter().map(|v| [*v; 3]));
        return (merged(range, alike).unwrap_or(Tree::Block(block)), range);
    }
    let (trees, ranges): (Vec<Tree>, Vec<Range>) = corners
        .map(|corner| of_block(all, &corner, side / 2))
        .unzip();
    let range = range_of(ranges.into_iter());
    (merged(range, alike).unwrap_or(Tree::Branch(trees)), range)
}

fn range_of(parts: impl ExactSizeIterator<Item = Range>) -> Range {
    let share = 1.0 / parts.len() as f32;
    parts.fold([f32::INFINITY, f32::NEG_INFINITY, 0.0], |all, part| {
        [
            all[0].min(part[0]),
            all[1].max(part[1]),
            all[2] + share * part[2],
        ]
    })
}

fn merged([least, most, mean]: Range, alike: f32) -> Option<Tree> {
    (most - least <= alike * mean).then_some(Tree::Leaf(mean))
}

// Writing to a string cannot fail.
fn put(tree: &Tree, text: &mut String) {
    text.push_str("{ ");
    match tree {
        Tree::Leaf(value) => number(*value, text),
        Tree::Block(values) => values.iter().for_each(|value| number(*value, text)),
        Tree::Branch(trees) => trees.iter().for_each(|tree| put(tree, text)),
    }
    text.push_str("}\n");
}

/// A number of four digits, with a space.
pub fn number(value: f32, text: &mut String) {
    let _ = write!(text, "{value:.3e} ");
}

/// The tree of a text; `None` where it is none of this rank.
pub fn parse(text: &str, rank: u32) -> Option<Tree> {
    let spaced = text.replace('{', " { ").replace('}', " } ");
    let mut words = spaced
        .split(|c: char| c.is_whitespace() || c == ',')
        .filter(|word| !word.is_empty());
    if words.next() != Some("{") {
        return None;
    }
    let tree = parse_open(&mut words, rank, 0)?;
    words.next().is_none().then_some(tree)
}

/// Deepest branch: no file of a sensible size has more.
const DEEPEST: u32 = 16;

fn parse_open<'a>(
    words: &mut impl Iterator<Item = &'a str>,
    rank: u32,
    depth: u32,
) -> Option<Tree> {
    let (mut trees, mut values) = (Vec::new(), Vec::new());
    loop {
        match words.next()? {
            "{" if values.is_empty() && depth < DEEPEST => {
                trees.push(parse_open(words, rank, depth + 1)?);
            }
            "}" => break,
            word if trees.is_empty() => {
                let value: f32 = word.parse().ok()?;
                values.push(Some(value).filter(|v| v.is_finite() && *v >= 0.0)?);
            }
            _ => return None,
        }
    }
    if trees.len() == 1 << rank {
        return Some(Tree::Branch(trees));
    }
    match values.len() {
        1 => Some(Tree::Leaf(values[0])),
        n if n > 1 && n.is_power_of_two() && n.trailing_zeros() % rank == 0 => {
            Some(Tree::Block(values))
        }
        _ => None,
    }
}

impl Tree {
    /// The value of the cell that holds a place.
    pub fn at(&self, rank: u32, mut place: [f64; 4]) -> f32 {
        let axes = rank as usize;
        let mut tree = self;
        loop {
            match tree {
                Self::Leaf(value) => return *value,
                Self::Block(values) => {
                    let bits = values.len().trailing_zeros() / rank;
                    let side = (1u32 << bits) as f64;
                    let index = place[..axes].iter().fold(0, |at, x| {
                        (at << bits) + ((x * side) as usize).min((1 << bits) - 1)
                    });
                    return values[index];
                }
                Self::Branch(trees) => {
                    let mut branch = 0;
                    for (axis, x) in place[..axes].iter_mut().enumerate() {
                        *x *= 2.0;
                        if *x >= 1.0 {
                            branch |= 1 << axis;
                            *x -= 1.0;
                        }
                    }
                    tree = &trees[branch];
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_tree_has_its_values_where_they_were_and_merges_what_is_alike() {
        for (rank, levels) in [(3u32, 3u32), (4, 2)] {
            let n = 1usize << levels;
            let count = n.pow(rank);
            // Distinct on one side, alike on the other.
            let value = |k: usize| if k < count / 2 { k as f32 + 1.0 } else { 7.0 };
            let values: Vec<f32> = (0..count).map(value).collect();
            let text = text_of(&values, rank, levels, 0.05);
            let tree = parse(&text, rank).unwrap();
            assert!(text.matches("7.000e0").count() < count / 4);
            for (k, value) in values.iter().enumerate() {
                let mut place = [0.0; 4];
                for axis in 0..rank as usize {
                    let shift = (rank as usize - 1 - axis) * levels as usize;
                    place[axis] = ((k >> shift & (n - 1)) as f64 + 0.5) / n as f64;
                }
                let found = tree.at(rank, place);
                assert!((found / value - 1.0).abs() < 0.05, "{k}: {found}");
            }
        }
        for bad in ["", "{ 1 2 }", "{ 1", "{ { 1 } }", "1", "{ -1 }", "{ x }"] {
            assert_eq!(parse(bad, 4), None, "{bad}");
        }
        assert_eq!(parse(&"{".repeat(100_000), 4), None);
    }
}
