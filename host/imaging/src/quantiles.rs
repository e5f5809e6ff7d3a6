//! The median of a patch's pixels, exact, in about one pass: a histogram tells in which bin it is,
//! and only that bin's values are sorted out.

/// Patches of fewer values are sorted out at once.
const FEW: usize = 192;
const BINS: usize = 256;
/// A bin with more than this share of all values (an outlier has stretched the range) tells little.
const CROWDED: usize = 8;
/// Quartiles' distance of a normal distribution in standard deviations.
const QUARTILES_SD: f32 = 1.349;
/// Values looked at together.
const LANES: usize = 16;

/// Room that is used again for every patch.
#[derive(Default)]
pub struct Workspace {
    bin_of: Vec<u8>,
    chosen: Vec<f32>,
}

/// Median, and the quartiles' distance scaled to the standard deviation of a normal distribution
/// (in large patches to a 256th of their range). The slice, which must not be empty and must hold
/// finite values, may be reordered.
pub fn median_and_spread(values: &mut [f32], room: &mut Workspace) -> (f32, f32) {
    if values.len() < FEW {
        return by_selection(values);
    }
    let (low, high) = range(values);
    let scale = (BINS - 1) as f32 / (high - low);
    if !scale.is_finite() {
        // All the same, or too far apart to be told by their difference.
        return by_selection(values);
    }
    let counts = count(values, low, scale, &mut room.bin_of);
    let n = values.len();
    let [first, second, third] = [n / 4, n / 2, n - 1 - n / 4].map(|rank| Place::of(&counts, rank));
    let crowded = n / CROWDED;
    if [&first, &second, &third].iter().any(|p| p.count > crowded) {
        return by_selection(values);
    }
    let spread = (third.within() - first.within()) / scale / QUARTILES_SD;
    let lower = Place::of(&counts, (n - 1) / 2);
    let bins = lower.bin as u8..=second.bin as u8;
    choose(values, &room.bin_of, bins, &mut room.chosen);
    let at = n / 2 - lower.below;
    let (below, upper, _) = room.chosen.select_nth_unstable_by(at, f32::total_cmp);
    (middle(n, below, *upper), spread)
}

/// The same by selection alone.
fn by_selection(values: &mut [f32]) -> (f32, f32) {
    let n = values.len();
    let (below, upper, above) = values.select_nth_unstable_by(n / 2, f32::total_cmp);
    let median = middle(n, below, *upper);
    if below.is_empty() || above.is_empty() {
        return (median, 0.0);
    }
    let quarter = n / 4;
    let upper_at = (n - 1 - quarter).saturating_sub(n / 2 + 1);
    let high = *above
        .select_nth_unstable_by(upper_at.min(above.len() - 1), f32::total_cmp)
        .1;
    let low = *below
        .select_nth_unstable_by(quarter.min(below.len() - 1), f32::total_cmp)
        .1;
    (median, (high - low) / QUARTILES_SD)
}

/// The median of `n` values from the upper one of the middle two and all that are below it.
fn middle(n: usize, below: &[f32], upper: f32) -> f32 {
    if n % 2 == 1 {
        return upper;
    }
    let lower = below.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    0.5 * (lower + upper)
}

fn range(values: &[f32]) -> (f32, f32) {
    let mut low = [f32::INFINITY; LANES];
    let mut high = [f32::NEG_INFINITY; LANES];
    let (chunks, rest) = values.as_chunks::<LANES>();
    for chunk in chunks {
        for i in 0..LANES {
            low[i] = if chunk[i] < low[i] { chunk[i] } else { low[i] };
            high[i] = if chunk[i] > high[i] {
                chunk[i]
            } else {
                high[i]
            };
        }
    }
    let least = low
        .iter()
        .chain(rest)
        .copied()
        .fold(f32::INFINITY, f32::min);
    let most = high
        .iter()
        .chain(rest)
        .copied()
        .fold(f32::NEG_INFINITY, f32::max);
    (least, most)
}

/// Collects the values of a few bins, which hold few of them: most chunks have none.
fn choose(
    values: &[f32],
    bin_of: &[u8],
    bins: std::ops::RangeInclusive<u8>,
    chosen: &mut Vec<f32>,
) {
    chosen.clear();
    let (first, width) = (*bins.start(), bins.end() - bins.start());
    let is_in = |bin: u8| bin.wrapping_sub(first) <= width;
    for (values, bins) in values.chunks(LANES).zip(bin_of.chunks(LANES)) {
        if bins.iter().fold(false, |any, bin| any | is_in(*bin)) {
            chosen.extend(
                values
                    .iter()
                    .zip(bins)
                    .filter_map(|(value, bin)| is_in(*bin).then_some(value)),
            );
        }
    }
}

/// The histogram, and the bin of each value: the nearest of 256 marks from the lowest value to the
/// highest.
fn count(values: &[f32], low: f32, scale: f32, bin_of: &mut Vec<u8>) -> [u32; BINS] {
    bin_of.clear();
    // Past 2²³ a float has no fraction left, and its lowest bits are the integer.
    const INTEGERS: f32 = 8_388_608.0;
    bin_of.extend(
        values
            .iter()
            .map(|v| ((v - low) * scale + INTEGERS).to_bits() as u8),
    );
    // Neighbouring values fall into the same bin; four histograms do not wait for each other.
    let mut parts = [[0u32; BINS]; 4];
    let (fours, rest) = bin_of.as_chunks::<4>();
    for four in fours {
        for (part, bin) in parts.iter_mut().zip(four) {
            part[usize::from(*bin)] += 1;
        }
    }
    for bin in rest {
        parts[0][usize::from(*bin)] += 1;
    }
    let [mut sum, a, b, c] = parts;
    for i in 0..BINS {
        sum[i] += a[i] + b[i] + c[i];
    }
    sum
}

/// Where a rank is in a histogram.
struct Place {
    rank: usize,
    bin: usize,
    /// Values in lower bins.
    below: usize,
    /// Values in this bin.
    count: usize,
}

impl Place {
    fn of(counts: &[u32; BINS], rank: usize) -> Self {
        let mut below = 0;
        for (bin, count) in counts.iter().enumerate() {
            let count = *count as usize;
            if below + count > rank {
                return Self {
                    rank,
                    bin,
                    below,
                    count,
                };
            }
            below += count;
        }
        Self {
            rank,
            bin: BINS - 1,
            below,
            count: 1,
        }
    }

    /// Its place in bins, as if the values of a bin were evenly spread.
    fn within(&self) -> f32 {
        self.bin as f32 + ((self.rank - self.below) as f32 + 0.5) / self.count as f32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn of(values: &[f32]) -> (f32, f32) {
        median_and_spread(&mut values.to_vec(), &mut Workspace::default())
    }

    #[test]
    fn medians_and_spreads_are_those_of_the_sorted_values() {
        assert_eq!(of(&[5.0, 1.0, 3.0, 100.0, 2.0]).0, 3.0);
        assert_eq!(of(&[4.0, 1.0, 2.0, 3.0]).0, 2.5);
        assert_eq!(of(&[7.0]), (7.0, 0.0));
        assert_eq!(of(&[7.0; 1000]), (7.0, 0.0));
        // Of 1 ..= 101 the quartiles are 26 and 76.
        let many: Vec<f32> = (1..=101).rev().map(|i| i as f32).collect();
        let (median, spread) = of(&many);
        assert_eq!(median, 51.0);
        assert!((spread * 1.349 - 50.0).abs() < 1e-3);
    }

    proptest! {
        #[test]
        fn large_patches_have_the_median_of_selection(
            // Steps of 2⁻²⁷ from 0.2, not a range of f32: proptest 1.12 panics by itself about
            // once in ten million draws of one, where it rounds below the range's lower end.
            steps in prop::collection::vec(0i32..1 << 23, 200..3000),
            outlier in prop::option::of(-1_000_000i32..1_000_000),
        ) {
            let mut values: Vec<f32> =
                steps.iter().map(|&step| 0.2 + step as f32 * 2f32.powi(-27)).collect();
            values[7] = outlier.map_or(values[7], |value| value as f32);
            let exact = by_selection(&mut values.clone());
            let (median, spread) = of(&values);
            prop_assert_eq!(median, exact.0);
            prop_assert!((spread - exact.1).abs() <= 0.02 * exact.1, "{} {}", spread, exact.1);
        }
    }
}
