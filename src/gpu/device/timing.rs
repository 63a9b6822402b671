//! Busy time of the device: timestamps at the begin and end of every compute pass, or of every launch, where the adapter supports them.

use super::{Batch, Buffer, Gpu, locked};
use crate::error::Result;
use std::sync::{Arc, Mutex};

/// Maximum number of timestamps of a query set: the limit of core WebGPU.
const MOST: u32 = 4096;
/// Query sets of timing by launches, of which a step has thousands.
const SETS: u32 = 32;

/// Timestamps since the last reading.
pub(super) struct Timing {
    sets: Vec<wgpu::QuerySet>,
    resolved: Buffer,
    /// Timestamp period, ns
    period: f32,
    /// Every launch is a pass of its own.
    pub by_launch: bool,
    begun: Mutex<Begun>,
}

/// What has begun since the last reading.
#[derive(Default)]
struct Begun {
    /// First kernel of each pass with timestamps.
    kernels: Vec<&'static str>,
    /// Passes without timestamps, because the sets were full.
    missed: u32,
}

impl Timing {
    /// Timestamp writes of a pass that begins now with `kernel`; `None` once the sets are full.
    pub fn of_pass(&self, kernel: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let mut begun = locked(&self.begun);
        let begin = 2 * begun.kernels.len() as u32;
        let Some(set) = self.sets.get((begin / MOST) as usize) else {
            begun.missed += 1;
            return None;
        };
        begun.kernels.push(kernel);
        Some(wgpu::ComputePassTimestampWrites {
            query_set: set,
            beginning_of_pass_write_index: Some(begin % MOST),
            end_of_pass_write_index: Some(begin % MOST + 1),
        })
    }
}

impl Gpu {
    /// Switches timing of passes on or off for batches made from now on; no effect without timestamp support.
    pub fn time_passes(&self, on: bool) {
        *locked(&self.timing) = if on { self.timing(false) } else { None };
    }

    /// Switches timing of launches on or off for batches made from now on, which take longer, since each launch is a pass of its own; no
    /// effect without timestamp support. For finding where the time goes: see [`Gpu::launch_times`].
    pub fn time_launches(&self, on: bool) {
        *locked(&self.timing) = if on { self.timing(true) } else { None };
    }

    fn timing(&self, by_launch: bool) -> Option<Arc<Timing>> {
        if !self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            return None;
        }
        let descriptor =
            wgpu::QuerySetDescriptor { label: Some("passes"), ty: wgpu::QueryType::Timestamp, count: MOST };
        let count = if by_launch { SETS } else { 1 };
        let sets = (0..count).map(|_| self.device.create_query_set(&descriptor)).collect();
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let resolved = self.buffer("timestamps", u64::from(count * MOST) * 8, usage);
        let period = self.queue.get_timestamp_period();
        Some(Arc::new(Timing { sets, resolved, period, by_launch, begun: Mutex::default() }))
    }

    /// Submits a batch and waits; returns the busy time since the last call, s. `None` without timestamps, or if there were more passes
    /// than timestamps.
    ///
    /// # Errors
    /// As [`Gpu::submit_and_read`].
    pub fn busy(&self, batch: Batch) -> Result<Option<f64>> {
        let times = self.launch_times(batch)?;
        Ok(times.map(|times| times.iter().map(|(_, time)| time).sum()))
    }

    /// Submits a batch and waits; returns the launches since the last call in their order, each with its kernel and time, s; the passes with
    /// their first kernel after [`Gpu::time_passes`]. `None` without timestamps, or if there were more than timestamps.
    ///
    /// # Errors
    /// As [`Gpu::submit_and_read`].
    pub fn launch_times(&self, mut batch: Batch) -> Result<Option<Vec<(&'static str, f64)>>> {
        let Some(timing) = locked(&self.timing).clone() else {
            self.submit(batch);
            return Ok(None);
        };
        let begun = std::mem::take(&mut *locked(&timing.begun));
        let count = 2 * begun.kernels.len() as u32;
        if count == 0 {
            self.submit(batch);
            return Ok(Some(vec![]));
        }
        for (first, set) in (0..count).step_by(MOST as usize).zip(&timing.sets) {
            batch.resolve(set, (count - first).min(MOST), &timing.resolved, u64::from(first) * 8);
        }
        let parts = self.submit_and_read(batch, &[(&timing.resolved, u64::from(count) * 8)])?;
        let stamps: Vec<u64> = super::cast(&parts[0]);
        let seconds = |pass: &[u64]| pass[1].saturating_sub(pass[0]) as f64 * f64::from(timing.period) * 1e-9;
        let times = begun.kernels.into_iter().zip(stamps.chunks(2).map(seconds)).collect();
        Ok((begun.missed == 0).then_some(times))
    }
}
