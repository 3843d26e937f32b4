//! Random numbers that are the same on every machine, for scripts and rehearsals.

/// The generator `SplitMix64` (Steele, Lea and Flood, 2014).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct SplitMix(pub(crate) u64);

impl SplitMix {
    pub(crate) fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut x = self.0;
        x = (x ^ (x >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        x = (x ^ (x >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        x ^ (x >> 31)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn random_numbers_are_those_of_splitmix64() {
        // The first outputs of the reference implementation for the seeds 0 and 1234567.
        let mut zero = SplitMix(0);
        assert_eq!([zero.next(), zero.next()], [0xE220_A839_7B1D_CDAF, 0x6E78_9E6A_A1B9_65F4]);
        let mut other = SplitMix(1_234_567);
        assert_eq!(other.next(), 6_457_827_717_110_365_317);
    }
}
