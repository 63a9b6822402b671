//! Adapters, buffers, bound kernels, batches and read-back over wgpu.

mod health;
mod timing;

pub use health::{Handle, Taken, Work};

use super::Failed;
use super::shader::{Access, Shader, Variable};
use crate::error::Result;
use crate::kernels::Source;
use bytemuck::{NoUninit, Pod};
use health::Fault;
use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use timing::Timing;

/// Workgroups per dimension guaranteed by core WebGPU; longer dispatches are folded into z.
const MAX_GROUPS: u64 = 65_535;

/// Adapter of this machine.
#[derive(Clone, Debug)]
pub struct Adapter {
    /// Device name.
    pub name: String,
    /// Vulkan, Metal or Dx12.
    pub backend: String,
    /// Driver and its version.
    pub driver: String,
    /// True for a software adapter, which runs on the CPU.
    pub software: bool,
    /// Maximum size of a storage binding, bytes.
    pub max_binding: u64,
    raw: wgpu::Adapter,
}

impl Adapter {
    fn new(raw: wgpu::Adapter) -> Self {
        let info = raw.get_info();
        Self {
            name: info.name.clone(),
            backend: format!("{:?}", info.backend),
            driver: format!("{} {}", info.driver, info.driver_info).trim().to_string(),
            software: info.device_type == wgpu::DeviceType::Cpu,
            max_binding: raw.limits().max_storage_buffer_binding_size,
            raw,
        }
    }

    /// Opens a device of the caller's own, with adapter and queue, for [`Gpu::from_wgpu`].
    ///
    /// # Errors
    /// [`Failed::Device`] if the driver refuses.
    pub fn request(&self, descriptor: &wgpu::DeviceDescriptor) -> Result<(wgpu::Adapter, (wgpu::Device, wgpu::Queue))> {
        let opened = pollster::block_on(self.raw.request_device(descriptor));
        Ok((self.raw.clone(), opened.map_err(|e| Failed::Device { message: e.to_string() })?))
    }

    /// True if its name, API or driver contains a text, ignoring case.
    pub fn named(&self, text: &str) -> bool {
        format!("{} {} {}", self.name, self.backend, self.driver).to_lowercase().contains(&text.to_lowercase())
    }
}

/// All adapters on Vulkan, Metal and DX12 with core WebGPU limits, hardware first.
pub fn adapters() -> Vec<Adapter> {
    let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
    descriptor.backends = wgpu::Backends::VULKAN | wgpu::Backends::METAL | wgpu::Backends::DX12;
    let backends = descriptor.backends;
    let instance = wgpu::Instance::new(descriptor);
    let mut found: Vec<Adapter> = pollster::block_on(instance.enumerate_adapters(backends))
        .into_iter()
        .filter(|raw| wgpu::Limits::default().check_limits(&raw.limits()))
        .map(Adapter::new)
        .collect();
    found.sort_by_key(|a| a.software);
    found
}

/// Device with its queue, for any number of bodies; each kernel is compiled once.
pub struct Gpu {
    /// Adapter.
    pub adapter: Adapter,
    device: wgpu::Device,
    queue: wgpu::Queue,
    timing: Mutex<Option<Arc<Timing>>>,
    limits: wgpu::Limits,
    pipelines: Mutex<HashMap<&'static str, Arc<Pipeline>>>,
    fault: Fault,
    work: Mutex<Work>,
    staging: Mutex<Option<wgpu::Buffer>>,
    made: Mutex<Log>,
    dry: bool,
}

/// Arrays made so far, and the purpose of the next ones.
#[derive(Default)]
struct Log {
    made: Vec<Made>,
    purpose: &'static str,
}

/// Takes a lock; the data are consistent even if a thread panicked while holding it.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Maximum allocation behind a buffer of a dry device, bytes; its nominal size has no limit.
const DRY_BYTES: u64 = 4096;

struct Pipeline {
    shader: Shader,
    layout: wgpu::BindGroupLayout,
    raw: wgpu::ComputePipeline,
}

/// Named array on the device.
#[derive(Clone)]
pub struct Buffer {
    raw: wgpu::Buffer,
    /// Name for messages.
    pub name: &'static str,
    /// Size, bytes.
    pub bytes: u64,
}

/// Record of an allocated array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Made {
    /// Name in the kernels.
    pub name: &'static str,
    /// Purpose.
    pub purpose: &'static str,
    /// Number of elements.
    pub elements: u64,
    /// Size with padding, bytes.
    pub bytes: u64,
}

/// Kernel with its bound buffers.
#[derive(Clone)]
pub struct Bound {
    pipeline: Arc<Pipeline>,
    group: wgpu::BindGroup,
}

impl Gpu {
    /// Opens an adapter: the first whose name, backend or driver contains `text` (any case), or the first at all.
    ///
    /// # Errors
    /// [`Failed::NoAdapter`] if none matches, [`Failed::Device`] if the driver refuses.
    pub fn open(text: Option<&str>) -> Result<Self> {
        let all = adapters();
        let Some(adapter) = all.iter().find(|a| a.named(text.unwrap_or(""))).cloned() else {
            let list: Vec<String> = all.iter().map(|a| format!("`{}` ({})", a.name, a.backend)).collect();
            let refused = Failed::NoAdapter {
                wanted: text
                    .map_or("any Vulkan, Metal or DX12 adapter".into(), |t| format!("an adapter named like `{t}`")),
                found: if list.is_empty() { "none".into() } else { list.join(", ") },
            };
            return Err(refused.into());
        };
        Self::request(adapter, false)
    }

    /// A device that compiles and binds but stores no data and runs nothing: it shows the allocations of a set-up without an adapter.
    ///
    /// # Errors
    /// [`Failed::Device`] if wgpu was built without its `noop` backend.
    pub fn dry() -> Result<Self> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::NOOP;
        descriptor.backend_options.noop.enable = true;
        let instance = wgpu::Instance::new(descriptor);
        let found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::NOOP));
        let missing = || Failed::Device { message: "wgpu was built without its `noop` backend".into() };
        Self::request(Adapter::new(found.into_iter().next().ok_or_else(missing)?), true)
    }

    fn request(adapter: Adapter, dry: bool) -> Result<Self> {
        let mut limits = wgpu::Limits::default();
        limits.max_buffer_size = adapter.raw.limits().max_buffer_size;
        limits.max_storage_buffer_binding_size = adapter.raw.limits().max_storage_buffer_binding_size;
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("cutis"),
            required_limits: limits.clone(),
            required_features: adapter.raw.features() & wgpu::Features::TIMESTAMP_QUERY,
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        };
        let (_, (device, queue)) = adapter.request(&descriptor)?;
        let fault = Fault::listen(&device);
        Ok(Self::around(adapter, device, queue, fault, dry))
    }

    /// Uses the caller's device, for a program that also draws or computes on it. The caller gets its errors; a lost device is reported at
    /// the next read-back. It needs core WebGPU limits. With `TIMESTAMP_QUERY` it is timed, all simulations on it together. A map callback
    /// of the caller may run while this waits, and must not call into it.
    ///
    /// # Errors
    /// [`Failed::Device`] if the device's limits are below core WebGPU's.
    pub fn from_wgpu(adapter: wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Result<Self> {
        if !wgpu::Limits::default().check_limits(&device.limits()) {
            let message = "its limits are below wgpu::Limits::default(); request those with it".into();
            return Err(Failed::Device { message }.into());
        }
        Ok(Self::around(Adapter::new(adapter), device, queue, Fault::default(), false))
    }

    fn around(adapter: Adapter, device: wgpu::Device, queue: wgpu::Queue, fault: Fault, dry: bool) -> Self {
        Self {
            adapter,
            limits: device.limits(),
            device,
            queue,
            timing: Mutex::default(),
            pipelines: Mutex::default(),
            fault,
            work: Mutex::default(),
            staging: Mutex::default(),
            made: Mutex::default(),
            dry,
        }
    }

    /// Sets the purpose of the arrays made from now on.
    pub fn making(&self, purpose: &'static str) {
        locked(&self.made).purpose = purpose;
    }

    /// Arrays and uniforms made so far, in order.
    pub fn arrays(&self) -> Vec<Made> {
        locked(&self.made).made.clone()
    }

    /// Kernels compiled so far, by name.
    pub fn kernels(&self) -> Vec<&'static str> {
        let mut names: Vec<_> = locked(&self.pipelines).keys().copied().collect();
        names.sort_unstable();
        names
    }

    fn note(&self, name: &'static str, elements: u64, bytes: u64) {
        let mut log = locked(&self.made);
        let purpose = log.purpose;
        log.made.push(Made { name, purpose, elements, bytes });
    }

    /// Checks that an array of this size, bytes, can be made.
    ///
    /// # Errors
    /// [`Failed::TooLarge`] if it exceeds the adapter's limit for one binding.
    pub fn fits(&self, name: &str, bytes: u64) -> Result<()> {
        let limits = [
            ("max_storage_buffer_binding_size", self.limits.max_storage_buffer_binding_size),
            ("max_buffer_size", self.limits.max_buffer_size),
        ];
        for (limit_name, limit) in limits {
            if bytes > limit {
                return Err(Failed::TooLarge { array: name.into(), bytes, limit_name, limit }.into());
            }
        }
        Ok(())
    }

    /// Zeroed storage array of `count` elements (at least 16 bytes, so that an empty one can be bound).
    ///
    /// # Errors
    /// [`Failed::TooLarge`] if it exceeds the adapter's limit for one binding.
    pub fn array<T: NoUninit>(&self, name: &'static str, count: usize) -> Result<Buffer> {
        let bytes = (count * size_of::<T>()).next_multiple_of(16).max(16) as u64;
        self.fits(name, bytes)?;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::COPY_SRC;
        self.note(name, count as u64, bytes);
        Ok(self.buffer(name, bytes, usage))
    }

    /// Storage array with the given elements.
    ///
    /// # Errors
    /// As [`Gpu::array`].
    pub fn array_of<T: NoUninit>(&self, name: &'static str, data: &[T]) -> Result<Buffer> {
        let buffer = self.array::<T>(name, data.len())?;
        self.write(&buffer, 0, data);
        Ok(buffer)
    }

    /// Storage array of `count` elements, which are made where the device stores them: a dry one asks for none.
    ///
    /// # Errors
    /// As [`Gpu::array`].
    ///
    /// # Panics
    /// If `data` makes another number of elements.
    pub fn array_with<T: NoUninit>(
        &self,
        name: &'static str,
        count: usize,
        data: impl FnOnce() -> Vec<T>,
    ) -> Result<Buffer> {
        let buffer = self.array::<T>(name, count)?;
        if !self.dry {
            let data = data();
            assert_eq!(data.len(), count, "elements of the array `{name}`");
            self.write(&buffer, 0, &data);
        }
        Ok(buffer)
    }

    /// True for a device that stores no data ([`Gpu::dry`]).
    pub fn is_dry(&self) -> bool {
        self.dry
    }

    /// Uniform buffer of at least `bytes`, filled with `data`.
    pub fn uniform<T: NoUninit>(&self, name: &'static str, bytes: usize, data: &[T]) -> Buffer {
        let bytes = bytes.max(size_of_val(data)).next_multiple_of(16) as u64;
        self.note(name, bytes / size_of::<T>() as u64, bytes);
        let buffer = self.buffer(name, bytes, wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST);
        self.write(&buffer, 0, data);
        buffer
    }

    fn buffer(&self, name: &'static str, bytes: u64, usage: wgpu::BufferUsages) -> Buffer {
        let size = if self.dry { bytes.min(DRY_BYTES) } else { bytes };
        let descriptor = wgpu::BufferDescriptor { label: Some(name), size, usage, mapped_at_creation: false };
        Buffer { raw: self.device.create_buffer(&descriptor), name, bytes }
    }

    /// Writes elements at a byte offset; they are visible to the next submission.
    pub fn write<T: NoUninit>(&self, buffer: &Buffer, offset: u64, data: &[T]) {
        if !data.is_empty() && !self.dry {
            self.queue.write_buffer(&buffer.raw, offset, bytemuck::cast_slice(data));
        }
    }

    /// Compiles a kernel (once) and binds buffers by the shader's names.
    ///
    /// # Errors
    /// [`Failed::Shader`] if the text is invalid, [`Failed::Binding`] for a missing, unknown or too small buffer.
    pub fn bind(&self, source: &Source, buffers: &[(&str, &Buffer)]) -> Result<Bound> {
        let pipeline = self.pipeline(source)?;
        self.bind_pipeline(pipeline, buffers)
    }

    /// As [`Gpu::bind`], from a list that may hold more buffers than the shader names; if a name occurs twice, the later entry is used.
    ///
    /// # Errors
    /// As [`Gpu::bind`].
    pub fn bind_from(&self, source: &Source, buffers: &[(&str, &Buffer)]) -> Result<Bound> {
        let pipeline = self.pipeline(source)?;
        let named = |v: &Variable| buffers.iter().rev().find(|(name, _)| *name == v.name).copied();
        let list: Vec<(&str, &Buffer)> = pipeline.shader.variables.iter().filter_map(named).collect();
        self.bind_pipeline(pipeline, &list)
    }

    fn pipeline(&self, source: &Source) -> Result<Arc<Pipeline>> {
        let mut pipelines = locked(&self.pipelines);
        if let Some(pipeline) = pipelines.get(source.name) {
            return Ok(pipeline.clone());
        }
        let made = Arc::new(self.compile(Shader::read(source)?)?);
        pipelines.insert(source.name, made.clone());
        Ok(made)
    }

    /// Compiles and binds the text of a single shader, for tests that break one on purpose.
    ///
    /// # Errors
    /// As [`Gpu::bind`].
    pub fn bind_shader(&self, shader: Shader, buffers: &[(&str, &Buffer)]) -> Result<Bound> {
        let pipeline = Arc::new(self.compile(shader)?);
        self.bind_pipeline(pipeline, buffers)
    }

    fn compile(&self, shader: Shader) -> Result<Pipeline> {
        // layout entries of the shader's variables
        let entries: Vec<wgpu::BindGroupLayoutEntry> = shader
            .variables
            .iter()
            .map(|v| wgpu::BindGroupLayoutEntry {
                binding: v.binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: match v.access {
                        Access::Uniform => wgpu::BufferBindingType::Uniform,
                        Access::Read => wgpu::BufferBindingType::Storage { read_only: true },
                        Access::ReadWrite => wgpu::BufferBindingType::Storage { read_only: false },
                    },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
        // compile within an error scope
        locked(&self.work).compiled += 1;
        let scope = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let label = Some(shader.name);
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label,
            source: wgpu::ShaderSource::Wgsl(shader.text.as_str().into()),
        });
        let layout =
            self.device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label, entries: &entries });
        let pipeline_layout = self.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label,
            bind_group_layouts: &[Some(&layout)],
            immediate_size: 0,
        });
        let raw = self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label,
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(shader.name),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        // an invalid kernel is an error here
        if let Some(e) = pollster::block_on(scope.pop()) {
            return Err(Failed::Shader { kernel: shader.name, message: e.to_string() }.into());
        }
        Ok(Pipeline { shader, layout, raw })
    }

    fn bind_pipeline(&self, pipeline: Arc<Pipeline>, buffers: &[(&str, &Buffer)]) -> Result<Bound> {
        let variables = &pipeline.shader.variables;
        let known = || variables.iter().map(|v| v.name.as_str()).collect::<Vec<_>>().join(", ");
        let fail = |name: &str, problem: String| Failed::Binding {
            kernel: pipeline.shader.name,
            name: name.to_string(),
            known: known(),
            problem,
        };
        for (name, _) in buffers {
            if !variables.iter().any(|v| v.name == *name) {
                return Err(fail(name, "the shader has no such variable".into()).into());
            }
        }
        let mut entries = vec![];
        for v in variables {
            let given = buffers.iter().find(|(name, _)| *name == v.name);
            let (_, buffer) = given.ok_or_else(|| fail(&v.name, "no buffer was given for it".into()))?;
            if buffer.bytes < v.min_bytes {
                let problem =
                    format!("its buffer `{}` has {} bytes, {} are needed", buffer.name, buffer.bytes, v.min_bytes);
                return Err(fail(&v.name, problem).into());
            }
            entries.push(wgpu::BindGroupEntry { binding: v.binding, resource: buffer.raw.as_entire_binding() });
        }
        let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(pipeline.shader.name),
            layout: &pipeline.layout,
            entries: &entries,
        });
        Ok(Bound { pipeline, group })
    }

    /// A new batch of commands.
    pub fn batch(&self) -> Batch {
        let encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("batch") });
        Batch { pass: None, encoder, timing: locked(&self.timing).clone(), dispatches: 0 }
    }

    /// Submits a batch without waiting.
    pub fn submit(&self, batch: Batch) {
        self.count(batch.dispatches, false);
        self.queue.submit([batch.finish()]);
    }

    /// Submits a batch and reads the first bytes of each buffer back; waits for the device.
    ///
    /// # Errors
    /// [`Failed::Device`] if the device was lost or reported an error since the last call.
    ///
    /// # Panics
    /// If more bytes are requested than a buffer has.
    pub fn submit_and_read(&self, mut batch: Batch, wanted: &[(&Buffer, u64)]) -> Result<Vec<Vec<u8>>> {
        let total: u64 = wanted.iter().map(|(_, bytes)| bytes.next_multiple_of(16)).sum();
        // locked until the bytes are copied out, because other threads use the same staging buffer
        let mut slot = locked(&self.staging);
        let staging = self.staging(&mut slot, total.max(16));
        batch.pass = None;
        let mut offset = 0;
        for (buffer, bytes) in wanted {
            let padded = bytes.next_multiple_of(16);
            assert!(
                padded <= buffer.bytes,
                "{bytes} bytes asked of buffer `{}`, which has {}",
                buffer.name,
                buffer.bytes
            );
            batch.encoder.copy_buffer_to_buffer(&buffer.raw, 0, &staging, offset, padded);
            offset += bytes.next_multiple_of(16);
        }
        self.count(batch.dispatches, true);
        self.queue.submit([batch.finish()]);
        let failed = |message: String| Failed::Device { message };
        staging.map_async(wgpu::MapMode::Read, 0..total.max(16), |_| {});
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| failed(e.to_string()))?;
        self.check_health()?;
        let view = staging.get_mapped_range(0..total.max(16)).map_err(|e| failed(e.to_string()))?;
        let mut offset = 0usize;
        let parts = wanted
            .iter()
            .map(|(_, bytes)| {
                let part = view[offset..offset + *bytes as usize].to_vec();
                offset += bytes.next_multiple_of(16) as usize;
                part
            })
            .collect();
        drop(view);
        staging.unmap();
        Ok(parts)
    }

    fn staging(&self, slot: &mut Option<wgpu::Buffer>, bytes: u64) -> wgpu::Buffer {
        match slot {
            Some(buffer) if buffer.size() >= bytes => buffer.clone(),
            _ => {
                let size = bytes.next_power_of_two();
                let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
                let made = self.buffer("staging", size, usage).raw;
                *slot = Some(made.clone());
                made
            }
        }
    }

    /// Reads one array back.
    ///
    /// # Errors
    /// As [`Gpu::submit_and_read`].
    pub fn read<T: Pod>(&self, buffer: &Buffer, count: usize) -> Result<Vec<T>> {
        let parts = self.submit_and_read(self.batch(), &[(buffer, (count * size_of::<T>()) as u64)])?;
        Ok(cast(&parts[0]))
    }
}

/// Converts bytes to elements.
pub fn cast<T: Pod>(bytes: &[u8]) -> Vec<T> {
    bytemuck::pod_collect_to_vec(bytes)
}

/// Commands recorded for one submission; each dispatch sees the results of the previous ones.
pub struct Batch {
    // dropped before the encoder
    pass: Option<wgpu::ComputePass<'static>>,
    encoder: wgpu::CommandEncoder,
    timing: Option<Arc<Timing>>,
    dispatches: u64,
}

impl Batch {
    /// Dispatches a kernel over `threads` × `rows`; 0 of either is a no-op.
    pub fn run(&mut self, kernel: &Bound, threads: usize, rows: u32) {
        if threads == 0 || rows == 0 {
            return;
        }
        let groups = (threads as u64).div_ceil(u64::from(kernel.pipeline.shader.workgroup));
        let folds = groups.div_ceil(MAX_GROUPS);
        let (encoder, timing) = (&mut self.encoder, &self.timing);
        drop(self.pass.take_if(|_| timing.as_ref().is_some_and(|timing| timing.by_launch)));
        let pass = self.pass.get_or_insert_with(|| {
            let timestamp_writes = timing.as_ref().and_then(|timing| timing.of_pass(kernel.pipeline.shader.name));
            let descriptor = wgpu::ComputePassDescriptor { label: None, timestamp_writes };
            encoder.begin_compute_pass(&descriptor).forget_lifetime()
        });
        self.dispatches += 1;
        pass.set_pipeline(&kernel.pipeline.raw);
        pass.set_bind_group(0, &kernel.group, &[]);
        pass.dispatch_workgroups(groups.div_ceil(folds) as u32, rows, folds as u32);
    }

    /// Copies bytes between buffers.
    pub fn copy(&mut self, from: &Buffer, from_byte: u64, to: &Buffer, to_byte: u64, bytes: u64) {
        self.pass = None;
        self.encoder.copy_buffer_to_buffer(&from.raw, from_byte, &to.raw, to_byte, bytes);
    }

    /// Zeroes bytes of a buffer.
    pub fn clear(&mut self, buffer: &Buffer, from_byte: u64, bytes: u64) {
        if bytes > 0 {
            self.pass = None;
            self.encoder.clear_buffer(&buffer.raw, from_byte, Some(bytes));
        }
    }

    /// Copies the first `count` timestamps of a set into a buffer.
    fn resolve(&mut self, set: &wgpu::QuerySet, count: u32, to: &Buffer, to_byte: u64) {
        self.pass = None;
        self.encoder.resolve_query_set(set, 0..count, &to.raw, to_byte);
    }

    fn finish(mut self) -> wgpu::CommandBuffer {
        self.pass = None;
        self.encoder.finish()
    }
}
