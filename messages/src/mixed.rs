//! Numbers that look drawn by lot and are the same every time.

/// A number whose bits depend on all of another's (G. Steele, D. Lea and C. Flood, "Fast splittable pseudorandom number
/// generators", 2014: SplitMix64).
pub fn mixed(number: u64) -> u64 {
    let mut z = number.wrapping_add(0x9e37_79b9_7f4a_7c15);
    z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    z ^ (z >> 31)
}
