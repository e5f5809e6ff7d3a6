//! The nodes nearest to a place.
//!
//! Nodes are sorted into leaves of a few neighbours each, and a kd-tree holds only the leaves'
//! centres: finding 20 leaves and ranking their nodes is several times cheaper than finding 150
//! nodes one by one, and a block needs a good neighbourhood, not the exact one.

use super::coordinates::{Point, distance2};
use super::nodes::Node;
use kiddo::{ImmutableKdTree, SquaredEuclidean};
use std::num::NonZero;

/// Nodes a leaf, at most.
const LEAF: usize = 8;
/// More nodes are ranked than are asked for, by this factor.
const SURPLUS: f64 = 1.6;

/// Nodes in an order in which leaves are contiguous, and a tree over the leaves.
pub struct Neighbours {
    nodes: Vec<Node>,
    leaf_starts: Vec<u32>,
    tree: Option<ImmutableKdTree<f32, 6>>,
}

impl Neighbours {
    /// Builds the tree.
    pub fn new(mut nodes: Vec<Node>) -> Self {
        let mut leaf_starts = Vec::new();
        split(&mut nodes, 0, &mut leaf_starts);
        let n = nodes.len() as u32;
        let ends = leaf_starts.iter().skip(1).copied().chain([n]);
        let centres: Vec<Point> = leaf_starts
            .iter()
            .zip(ends)
            .map(|(start, end)| centre(&nodes[*start as usize..end as usize]))
            .collect();
        let tree = ImmutableKdTree::new_from_slice(&centres).ok();
        Self {
            nodes,
            leaf_starts,
            tree,
        }
    }

    /// All nodes.
    pub fn nodes(&self) -> &[Node] {
        &self.nodes
    }

    /// Writes the numbers of (nearly) the `n` nearest nodes to `found`, in no order, and returns
    /// the distance of the farthest of them. Fewer when there are not as many.
    pub fn gather(&self, place: &Point, n: usize, found: &mut Vec<(f32, u32)>) -> f32 {
        found.clear();
        let leaves = ((n as f64 * SURPLUS) as usize).div_ceil(LEAF / 2 + 1);
        let (Some(tree), Some(leaves)) = (&self.tree, NonZero::new(leaves)) else {
            return 0.0;
        };
        for leaf in tree
            .query(place)
            .nearest_n::<SquaredEuclidean<f32>>(leaves)
            .execute()
        {
            let start = self.leaf_starts[leaf.item as usize];
            let end = self
                .leaf_starts
                .get(leaf.item as usize + 1)
                .copied()
                .unwrap_or(self.nodes.len() as u32);
            for k in start..end {
                found.push((distance2(place, &self.nodes[k as usize].point), k));
            }
        }
        if found.len() > n {
            found.select_nth_unstable_by(n, |a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            found.truncate(n);
        }
        found.iter().map(|f| f.0).fold(0.0, f32::max).sqrt()
    }
}

/// Sorts nodes into leaves by halving along the widest axis; appends where each leaf starts.
fn split(nodes: &mut [Node], offset: u32, leaf_starts: &mut Vec<u32>) {
    if nodes.is_empty() {
        return;
    }
    if nodes.len() <= LEAF {
        leaf_starts.push(offset);
        return;
    }
    let axis = widest_axis(nodes);
    let middle = nodes.len() / 2;
    nodes.select_nth_unstable_by(middle, |a, b| a.point[axis].total_cmp(&b.point[axis]));
    let (left, right) = nodes.split_at_mut(middle);
    let right_offset = offset + middle as u32;
    if left.len() > 20_000 {
        let mut right_starts = Vec::new();
        rayon::join(
            || split(left, offset, leaf_starts),
            || split(right, right_offset, &mut right_starts),
        );
        leaf_starts.extend(right_starts);
    } else {
        split(left, offset, leaf_starts);
        split(right, right_offset, leaf_starts);
    }
}

fn widest_axis(nodes: &[Node]) -> usize {
    let mut low = [f32::INFINITY; 6];
    let mut high = [f32::NEG_INFINITY; 6];
    // A thousand nodes show the shape of a large set.
    for node in nodes.iter().step_by(nodes.len().div_ceil(1000)) {
        for k in 0..6 {
            low[k] = low[k].min(node.point[k]);
            high[k] = high[k].max(node.point[k]);
        }
    }
    let width = |k: &usize| high[*k] - low[*k];
    (0..6)
        .max_by(|a, b| width(a).total_cmp(&width(b)))
        .unwrap_or(0)
}

fn centre(nodes: &[Node]) -> Point {
    let mut sum = [0.0; 6];
    for node in nodes {
        for k in 0..6 {
            sum[k] += node.point[k];
        }
    }
    sum.map(|s| s / nodes.len() as f32)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lattice() -> Vec<Node> {
        (0..4000u32)
            .map(|k| Node {
                point: [
                    (k % 20) as f32,
                    (k / 20 % 20) as f32,
                    (k / 400) as f32,
                    0.0,
                    0.0,
                    0.0,
                ],
                log_value: [k as f32; 3],
                count: 1.0,
            })
            .collect()
    }

    #[test]
    fn what_is_gathered_is_nearly_the_nearest() {
        let neighbours = Neighbours::new(lattice());
        let mut found = Vec::new();
        for place in [[10.2, 9.9, 5.1, 0.0, 0.0, 0.0], [0.0; 6]] {
            let radius = neighbours.gather(&place, 60, &mut found);
            assert_eq!(found.len(), 60);
            let mut exact: Vec<f32> = neighbours
                .nodes()
                .iter()
                .map(|n| distance2(&place, &n.point).sqrt())
                .collect();
            exact.sort_by(f32::total_cmp);
            assert!(radius <= 1.15 * exact[59], "{radius} {}", exact[59]);
            let mut numbers: Vec<u32> = found.iter().map(|f| f.1).collect();
            numbers.sort();
            numbers.dedup();
            assert_eq!(numbers.len(), 60);
        }
    }

    #[test]
    fn few_nodes_or_none_are_all_there_is() {
        let mut found = Vec::new();
        let few = Neighbours::new(lattice().into_iter().take(3).collect());
        few.gather(&[0.0; 6], 60, &mut found);
        assert_eq!(found.len(), 3);
        let none = Neighbours::new(Vec::new());
        assert_eq!(none.gather(&[0.0; 6], 60, &mut found), 0.0);
        assert!(found.is_empty());
    }

    #[test]
    fn identical_nodes_do_not_break_the_tree() {
        let mut nodes = lattice();
        nodes.iter_mut().for_each(|n| n.point = [1.0; 6]);
        let neighbours = Neighbours::new(nodes);
        let mut found = Vec::new();
        assert_eq!(neighbours.gather(&[1.0; 6], 60, &mut found), 0.0);
        assert_eq!(found.len(), 60);
    }
}
