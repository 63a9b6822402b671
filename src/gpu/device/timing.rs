//! Busy time of the device: timestamps at the begin and end of every compute pass, where the adapter supports them.

use super::{Batch, Buffer, Gpu, locked};
use crate::error::Result;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU32, Ordering::Relaxed};

/// Maximum number of timestamps between two readings: the limit of core WebGPU for a query set.
const MOST: u32 = 4096;

/// Timestamps of the passes since the last reading.
pub(super) struct Timing {
    set: wgpu::QuerySet,
    resolved: Buffer,
    /// Timestamp period, ns
    period: f32,
    next: AtomicU32,
    missed: AtomicBool,
}

impl Timing {
    /// Timestamp writes of a pass that begins now; `None` once the set is full.
    pub fn of_pass(&self) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let free = |begin: u32| (begin + 2 <= MOST).then_some(begin + 2);
        let Ok(begin) = self.next.fetch_update(Relaxed, Relaxed, free) else {
            self.missed.store(true, Relaxed);
            return None;
        };
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.set,
            beginning_of_pass_write_index: Some(begin),
            end_of_pass_write_index: Some(begin + 1),
        })
    }
}

impl Gpu {
    /// Switches timing on or off for batches made from now on; no effect without timestamp support.
    pub fn time_passes(&self, on: bool) {
        if !on || !self.device.features().contains(wgpu::Features::TIMESTAMP_QUERY) {
            *locked(&self.timing) = None;
            return;
        }
        let set = self.device.create_query_set(&wgpu::QuerySetDescriptor {
            label: Some("passes"),
            ty: wgpu::QueryType::Timestamp,
            count: MOST,
        });
        let usage = wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC;
        let resolved = self.buffer("timestamps", u64::from(MOST) * 8, usage);
        let period = self.queue.get_timestamp_period();
        let (next, missed) = (AtomicU32::new(0), AtomicBool::new(false));
        *locked(&self.timing) = Some(Arc::new(Timing { set, resolved, period, next, missed }));
    }

    /// Submits a batch and waits; returns the busy time since the last call, s. `None` without timestamps, or if there were more passes
    /// than timestamps.
    ///
    /// # Errors
    /// As [`Gpu::submit_and_read`].
    pub fn busy(&self, mut batch: Batch) -> Result<Option<f64>> {
        let Some(timing) = locked(&self.timing).clone() else {
            self.submit(batch);
            return Ok(None);
        };
        let count = timing.next.swap(0, Relaxed);
        let missed = timing.missed.swap(false, Relaxed);
        if count == 0 {
            self.submit(batch);
            return Ok(Some(0.0));
        }
        batch.resolve(&timing.set, count, &timing.resolved);
        let parts = self.submit_and_read(batch, &[(&timing.resolved, u64::from(count) * 8)])?;
        let stamps: Vec<u64> = super::cast(&parts[0]);
        let ticks: u64 = stamps.chunks(2).map(|pass| pass[1].saturating_sub(pass[0])).sum();
        Ok((!missed).then(|| ticks as f64 * f64::from(timing.period) * 1e-9))
    }
}
