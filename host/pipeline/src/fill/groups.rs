//! Which channels are filled together.
//!
//! Channels of the same samples have their places in common, so that a factorisation serves for many of them: for
//! as many as [`WIDTHS`](gonia_brdf::interpolate::WIDTHS) has. Up to nine go in groups of three, more in groups of
//! 31: the last of the groups share some channels with the others, and a group of fewer has some of them twice.

/// Three channels of so many that stand for all; of three these.
pub(super) fn spread_over(channels: usize) -> [usize; 3] {
    [1, 3, 5].map(|sixth| sixth * channels / 6)
}

/// Whether the three that stand for all are all there are: of one channel and of three.
pub(super) fn stand_for_themselves(channels: usize) -> bool {
    groups::<3>(channels) == [spread_over(channels)]
}

/// The groups of `N` that some channels are filled in, evenly spread.
pub(super) fn groups<const N: usize>(channels: usize) -> Vec<[usize; N]> {
    let count = channels.div_ceil(N);
    let spread = channels.saturating_sub(N);
    (0..count)
        .map(|k| group(k * spread / (count - 1).max(1), channels))
        .collect()
}

/// The groups of some channels: the middle of a spectrum, which chooses the settings for all, first.
pub(super) fn groups_from_middle<const N: usize>(channels: usize) -> Vec<[usize; N]> {
    let mut groups = groups(channels);
    let middle = groups.len() / 2;
    groups.swap(0, middle);
    groups
}

/// The group that begins with `first`; of fewer channels than it holds some are in it twice.
fn group<const N: usize>(first: usize, channels: usize) -> [usize; N] {
    std::array::from_fn(|c| {
        if channels < N {
            c * channels / N
        } else {
            first + c
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_hold_every_channel_and_no_channel_beyond() {
        fn check<const N: usize>(channels: usize) {
            let groups = groups::<N>(channels);
            let mut held = vec![false; channels];
            for channel in groups.iter().flatten() {
                held[*channel] = true;
            }
            assert!(held.iter().all(|held| *held), "{channels} {groups:?}");
            assert_eq!(groups.len(), channels.div_ceil(N));
        }
        for channels in [1, 2, 3, 4, 8, 9] {
            check::<3>(channels);
        }
        for channels in [10, 30, 31, 32, 62, 63, 200] {
            check::<31>(channels);
        }
    }

    #[test]
    fn one_channel_and_three_stand_for_themselves() {
        assert_eq!((spread_over(1), spread_over(3)), ([0; 3], [0, 1, 2]));
        assert_eq!(spread_over(31), [5, 15, 25]);
        let these: Vec<usize> = (0..100).filter(|n| stand_for_themselves(*n)).collect();
        assert_eq!(these, [1, 3]);
    }
}
