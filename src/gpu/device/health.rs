//! What a device was given to do, and whether it still does it: counts of its work, its first fault, and a way to take it away.

use super::super::Failed;
use super::{Gpu, locked};
use crate::error::Result;
use std::sync::{Arc, Mutex};

/// Work handed to a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Kernels launched.
    pub dispatches: u64,
    /// Times that the host waited for values.
    pub read_backs: u64,
    /// Kernels compiled.
    pub compiled: u64,
}

/// The first thing that went wrong on a device since it was opened; what follows from it is not kept.
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

    /// Listens to a device: its errors that nobody asked for, and its end.
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

/// A device, to be taken away while it works.
#[derive(Clone)]
pub struct Handle {
    device: wgpu::Device,
    fault: Fault,
    largest: u64, // bytes of one array
}

/// Arrays that take a device's memory until they are dropped.
pub struct Taken(Vec<wgpu::Buffer>);

impl Taken {
    /// How many there are.
    pub fn count(&self) -> usize {
        self.0.len()
    }
}

/// Arrays that [`Handle::exhaust`] makes at most: a petabyte in arrays of a gigabyte.
const MOST: usize = 1 << 20;

impl Handle {
    /// Ends the device under whoever uses it, as a driver's reset or a pulled plug does; for tests of what follows.
    pub fn destroy(&self) {
        self.device.destroy();
    }

    /// Takes the device's memory, in arrays of the largest size, until it refuses one; for tests of what follows.
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
    /// Work handed over since the device was opened.
    pub fn work(&self) -> Work {
        *locked(&self.work)
    }

    /// Counts the launches of a batch that is submitted, and whether the host waits for it.
    pub(super) fn count(&self, dispatches: u64, read_back: bool) {
        let mut work = locked(&self.work);
        work.dispatches += dispatches;
        work.read_backs += u64::from(read_back);
    }

    /// The device, to be taken away.
    pub fn handle(&self) -> Handle {
        let largest = self.limits.max_buffer_size & !(wgpu::COPY_BUFFER_ALIGNMENT - 1);
        Handle { device: self.device.clone(), fault: self.fault.clone(), largest }
    }

    /// Whether all went well so far.
    ///
    /// # Errors
    /// [`Failed::Device`] with what went wrong first.
    pub fn sound(&self) -> Result<()> {
        self.fault.first().map_or(Ok(()), |message| Err(Failed::Device { message }.into()))
    }
}
