//! Medians and other quantiles, by selection: nothing is sorted.

/// The median of finite values, which are reordered; of an even number the mean of the middle two.
/// 0 of none.
pub fn median(values: &mut [f32]) -> f32 {
    let n = values.len();
    if n == 0 {
        return 0.0;
    }
    // Most bins hold a few samples.
    if n <= 12 {
        for k in 1..n {
            let mut at = k;
            while at > 0 && values[at - 1] > values[at] {
                values.swap(at - 1, at);
                at -= 1;
            }
        }
        let middle = values[n / 2];
        return if n % 2 == 1 {
            middle
        } else {
            0.5 * (values[n / 2 - 1] + middle)
        };
    }
    let (below, middle, _) = values.select_nth_unstable_by(n / 2, f32::total_cmp);
    let middle = *middle;
    if n % 2 == 1 {
        middle
    } else {
        let lower = below.iter().copied().fold(f32::NEG_INFINITY, f32::max);
        0.5 * (lower + middle)
    }
}

/// The value below which a share of the values lie, 0 ..= 1: that of rank `share · n`, rounded down. The
/// values are reordered; `None` of none.
pub fn quantile(values: &mut [f32], share: f32) -> Option<f32> {
    let rank = (share * values.len() as f32) as usize;
    let rank = rank.min(values.len().checked_sub(1)?);
    Some(*values.select_nth_unstable_by(rank, f32::total_cmp).1)
}

/// The value below which values of a share of all weight lie, 0 ..= 1. The pairs of value and weight are sorted; `None`
/// of no weight.
pub fn weighted_quantile(values: &mut [(f32, f32)], share: f32) -> Option<f32> {
    values.sort_unstable_by(|a, b| a.0.total_cmp(&b.0));
    let all: f32 = values.iter().map(|(_, weight)| weight).sum();
    let mut below = 0.0;
    let reaches = |(_, weight): &&(f32, f32)| {
        below += weight;
        below > share * all
    };
    let at = values.iter().find(reaches);
    let value = at.or(values.last()).map(|(value, _)| *value);
    value.filter(|_| all > 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_even_odd_and_none() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(&mut []), 0.0);
        for n in 1..40u16 {
            let mut values: Vec<f32> = (0..n).map(|k| f32::from(k * 79 % 64)).collect();
            let mut sorted = values.clone();
            sorted.sort_by(f32::total_cmp);
            let (low, high) = (sorted[usize::from((n - 1) / 2)], sorted[usize::from(n / 2)]);
            assert_eq!(median(&mut values), 0.5 * (low + high), "{n}");
        }
    }

    #[test]
    fn a_quantile_is_the_value_of_its_rank() {
        let mut values: Vec<f32> = (0..100u16).map(|k| f32::from(k * 37 % 100)).collect();
        assert_eq!(quantile(&mut values, 0.25), Some(25.0));
        assert_eq!(quantile(&mut values, 0.95), Some(95.0));
        assert_eq!(quantile(&mut values, 1.0), Some(99.0));
        assert_eq!(quantile(&mut values, 0.0), Some(0.0));
        assert_eq!(quantile(&mut [], 0.5), None);
    }

    #[test]
    fn a_weight_counts_as_so_many_values() {
        let mut weighted = [(3.0, 1.0), (1.0, 5.0), (2.0, 4.0)];
        let mut all = [1.0, 1.0, 1.0, 1.0, 1.0, 2.0, 2.0, 2.0, 2.0, 3.0];
        for share in [0.0, 0.3, 0.55, 0.85, 0.95, 1.0] {
            let expected = quantile(&mut all, share);
            assert_eq!(weighted_quantile(&mut weighted, share), expected, "{share}");
        }
        assert_eq!(weighted_quantile(&mut [], 0.5), None);
        assert_eq!(weighted_quantile(&mut [(1.0, 0.0)], 0.5), None);
    }
}
