//! Device health: dispatch and read-back counters, first reported error, test hooks that destroy the device or exhaust its memory.

use super::super::Failed;
use super::{Gpu, locked};
use crate::error::Result;
use std::sync::{Arc, Mutex};

/// Counters of a device's work.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Kernel launches.
    pub dispatches: u64,
    /// Times that the host waited for results.
    pub read_backs: u64,
    /// Compiled kernels.
    pub compiled: u64,
}

/// First error of a device since it was opened; later ones follow from it and are dropped.
#[derive(Clone, Default)]
pub(super) struct Fault(Arc<Mutex<Option<String>>>);

impl Fault {
    fn keep(&self, message: String) {
        if let Ok(mut slot) = self.0.lock() {
            slot.get_or_insert(message);
        }
    }

    fn first(&self) -> Option<String> {
        self.0.lock().ok().and_then(|fault| fault.clone())
    }

    /// Subscribes to the uncaptured errors of a device and to its loss.
    pub fn listen(device: &wgpu::Device) -> Self {
        let fault = Self::default();
        let (errors, end) = (fault.clone(), fault.clone());
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| match error {
            wgpu::Error::OutOfMemory { .. } => errors.keep("its memory is used up".into()),
            other => errors.keep(other.to_string()),
        }));
        device
            .set_device_lost_callback(move |reason, message| end.keep(format!("it was lost ({reason:?}): {message}")));
        fault
    }
}

/// Handle for destroying a device or exhausting its memory in tests.
#[derive(Clone)]
pub struct Handle {
    device: wgpu::Device,
    fault: Fault,
    largest: u64, // of one array, bytes
}

/// Arrays that occupy a device's memory until they are dropped.
pub struct Taken(Vec<wgpu::Buffer>);

impl Taken {
    /// Number of arrays.
    pub fn count(&self) -> usize {
        self.0.len()
    }
}

/// Maximum number of arrays made by [`Handle::exhaust`]: a petabyte in arrays of a gigabyte.
const MOST: usize = 1 << 20;

impl Handle {
    /// Destroys the device during its use, like a driver reset or an unplugged adapter; for tests of the consequences.
    pub fn destroy(&self) {
        self.device.destroy();
    }

    /// Allocates arrays of the largest size until the device refuses one; for tests of the consequences.
    pub fn exhaust(&self) -> Taken {
        let mut taken = vec![];
        let wanted = wgpu::BufferDescriptor {
            label: Some("taken"),
            size: self.largest,
            usage: wgpu::BufferUsages::STORAGE,
            mapped_at_creation: false,
        };
        while taken.len() < MOST && self.fault.first().is_none() {
            taken.push(self.device.create_buffer(&wanted));
        }
        Taken(taken)
    }
}

impl Gpu {
    /// The device and its queue, for what shares them.
    pub fn handles(&self) -> (wgpu::Device, wgpu::Queue) {
        (self.device.clone(), self.queue.clone())
    }

    /// Counters since the device was opened.
    pub fn work(&self) -> Work {
        *locked(&self.work)
    }

    /// Counts the launches of a submitted batch, and whether the host waits for it.
    pub(super) fn count(&self, dispatches: u64, read_back: bool) {
        let mut work = locked(&self.work);
        work.dispatches += dispatches;
        work.read_backs += u64::from(read_back);
    }

    /// Handle for tests.
    pub fn handle(&self) -> Handle {
        let largest = self.limits.max_buffer_size & !(wgpu::COPY_BUFFER_ALIGNMENT - 1);
        Handle { device: self.device.clone(), fault: self.fault.clone(), largest }
    }

    /// Checks that no error has occurred so far.
    ///
    /// # Errors
    /// [`Failed::Device`] with the first error.
    pub fn check_health(&self) -> Result<()> {
        self.fault.first().map_or(Ok(()), |message| Err(Failed::Device { message }.into()))
    }
}
