//! Pseudo-random numbers, the same on every machine for the same seed.
//!
//! Source: Knuth's MMIX generator (The Art of Computer Programming, volume 2, section 3.3.4); Steele, Lea, Flood 2014 (SplitMix64).

/// Generator.
#[derive(Clone, Debug)]
pub struct Random {
    state: u64,
    step: fn(&mut u64) -> u64,
}

impl Random {
    /// Knuth's generator, of which only the high bits are random.
    pub fn new(seed: u64) -> Self {
        let step = |state: &mut u64| {
            *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            *state
        };
        Self { state: seed, step }
    }

    /// SplitMix64: neighbouring seeds give independent sequences.
    pub fn split_mix(seed: u64) -> Self {
        let step = |state: &mut u64| {
            *state = state.wrapping_add(GOLDEN);
            mixed(*state)
        };
        Self { state: seed, step }
    }

    /// 64 bits.
    pub fn bits(&mut self) -> u64 {
        (self.step)(&mut self.state)
    }

    /// Number in [0, 1).
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    /// Number in [−1, 1).
    pub fn signed(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 52) as f64 - 1.0
    }

    /// Number between two bounds.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Integer below `count`.
    pub fn below(&mut self, count: u64) -> u64 {
        (self.bits() >> 33) % count
    }
}

/// 2⁶⁴ over the golden ratio.
const GOLDEN: u64 = 0x9e37_79b9_7f4a_7c15;

/// The finaliser of SplitMix64, which mixes bits.
fn mixed(bits: u64) -> u64 {
    let bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    bits ^ (bits >> 31)
}

/// Number in [−1, 1) as a function of a key.
pub fn scattered(key: u64) -> f64 {
    (mixed(key.wrapping_add(1).wrapping_mul(GOLDEN)) >> 11) as f64 / (1u64 << 52) as f64 - 1.0
}
