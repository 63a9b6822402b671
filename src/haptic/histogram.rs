//! Order statistics of many values in fixed memory: counts in bins of equal width.

/// Number of bins; larger values count in the last one, and the largest value is stored.
const BINS: usize = 8192;

/// Histogram of values.
#[derive(Clone, Debug)]
pub struct Histogram {
    width: f64,
    bins: Box<[u64]>,
    count: u64,
    largest: f64,
}

impl Histogram {
    /// Empty histogram with bins of `width`.
    pub fn new(width: f64) -> Self {
        Self { width, bins: vec![0; BINS].into_boxed_slice(), count: 0, largest: 0.0 }
    }

    /// Counts a value of 0 or more; allocates nothing.
    pub fn add(&mut self, value: f64) {
        let bin = (value / self.width) as usize; // a negative float becomes 0
        self.bins[bin.min(BINS - 1)] += 1;
        self.count += 1;
        self.largest = self.largest.max(value);
    }

    /// Adds the counts of a histogram of the same width.
    pub fn merge(&mut self, other: &Self) {
        assert!(self.width == other.width, "histograms of one width");
        for (sum, more) in self.bins.iter_mut().zip(&other.bins) {
            *sum += more;
        }
        self.count += other.count;
        self.largest = self.largest.max(other.largest);
    }

    /// Smallest bin edge such that at least the fraction `share` of the values lies at or below it: at most one bin too large. `None`
    /// without values.
    pub fn quantile(&self, share: f64) -> Option<f64> {
        let rank = (share * self.count as f64).ceil().max(1.0) as u64;
        let mut below = 0;
        for (bin, count) in self.bins.iter().enumerate() {
            below += count;
            if below >= rank {
                let edge = if bin + 1 == BINS { self.largest } else { (bin + 1) as f64 * self.width };
                return Some(edge.min(self.largest));
            }
        }
        None
    }

    /// Largest value; `None` without values.
    pub fn max(&self) -> Option<f64> {
        (self.count > 0).then_some(self.largest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_are_right_to_a_bin_and_the_largest_is_exact() {
        let mut histogram = Histogram::new(1.0);
        assert_eq!((histogram.quantile(0.5), histogram.max()), (None, None));
        for value in 1..=1000 {
            histogram.add(f64::from(value));
        }
        histogram.add(1e6);
        let near = |share, wanted: f64| (histogram.quantile(share).unwrap_or(f64::NAN) - wanted).abs() <= 1.0;
        assert!(near(0.5, 501.0) && near(0.99, 991.0), "{:?}", histogram.quantile(0.99));
        assert_eq!((histogram.quantile(1.0), histogram.max()), (Some(1e6), Some(1e6)));
    }
}
