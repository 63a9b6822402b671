//! The same pictures on a graphics adapter: off-screen, or for a window.
//!
//! Triangles, normals with creases, lights, shadows and lines are the rasteriser's ([`render`](super::render)); ambient occlusion is left
//! out, and a pixel has 4 samples, not 16. Each picture is drawn into a texture of this module, which a window shows and [`Renderer::read`]
//! brings back. One adapter repeats its own bytes; others differ from it in the last bits, and from the rasteriser at edges and in hollows.
//! The shader is `picture.wgsl`; its twin is the rasteriser itself.

use super::pipelines::{Corner, DEPTH, FORMAT, Maker, SAMPLES, Stroke, layouts};
use super::raster::{LINE_DEPTH_SHARE, ShadowMap};
use super::shade::{AMBIENT, BACKGROUND, FILL, KEY, RIM};
use super::{Camera, Image, NEAR, Surface, Triangle, View, prepare};
use crate::error::Result;
use crate::gpu::Failed;
use bytemuck::{Pod, Zeroable};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Share by which what is in front is nearer: before everything but what is closer than an eighth of its own distance.
const FRONT: f32 = 8.0;

/// Kinds of what is drawn, as the shader has them.
const WHOLE: f32 = 0.0;
const CLIPPED: f32 = 1.0;
const IN_FRONT: f32 = 2.0;

/// What a picture has in common, as the shader has it.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Frame {
    right: [f32; 4],
    up: [f32; 4],
    forward: [f32; 4],
    eye: [f32; 4],
    lens: [f32; 4],
    size: [f32; 4],
    clip: [f32; 4],
    lights: [[f32; 4]; 3],
    ambient: [f32; 4],
    map_u: [f32; 4],
    map_v: [f32; 4],
    map_w: [f32; 4],
    map_scale: [f32; 4],
}

/// Half-space that remains of what is clipped: the points with `normal · x ≥ offset`.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Clip {
    /// Of any length.
    pub normal: [f64; 3],
    /// m times the length of the normal.
    pub offset: f64,
}

/// What is drawn.
#[derive(Clone, Copy, Default)]
pub struct Drawn<'a> {
    /// Surfaces that a clipping plane cuts.
    pub clipped: &'a [Surface<'a>],
    /// Surfaces that it leaves whole.
    pub whole: &'a [Surface<'a>],
    /// Surfaces that nothing hides, and that cast no shadow.
    pub in_front: &'a [Surface<'a>],
}

/// Number of elements on the device, with room for more.
struct Array {
    raw: wgpu::Buffer,
    count: u32,
}

/// Textures of one size of picture.
struct Target {
    size: [u32; 2],
    /// What is resolved into the picture; none of one sample a pixel.
    samples: Option<wgpu::TextureView>,
    depth: wgpu::TextureView,
    picture: wgpu::Texture,
    view: wgpu::TextureView,
}

/// Draws on a device, which others may use too.
pub struct Renderer {
    device: wgpu::Device,
    queue: wgpu::Queue,
    effort: Effort,
    sky: wgpu::RenderPipeline,
    /// Where a plane clips, and where none does.
    surfaces: [wgpu::RenderPipeline; 2],
    line: wgpu::RenderPipeline,
    casts: [wgpu::RenderPipeline; 2],
    frame: wgpu::Buffer,
    frame_group: wgpu::BindGroup,
    shadow: wgpu::TextureView,
    shadow_group: wgpu::BindGroup,
    corners: Array,
    /// Number of those that cast a shadow, which come first.
    casting: u32,
    strokes: Array,
    /// `[corner]` of what casts shadows, m, for the box of their map
    points: Vec<Vec3>,
    target: Option<Target>,
}

/// What a picture may cost.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Effort {
    /// The rasteriser's light.
    #[default]
    Full,
    /// One sample a pixel, shadows of fewer cells with sharper edges: for pictures on the processor's cores beside a simulation.
    Light,
}

impl Effort {
    /// Samples of a pixel.
    fn samples(self) -> u32 {
        match self {
            Self::Full => SAMPLES,
            Self::Light => 1,
        }
    }

    /// Cells along a side of the shadow map, and those of a shadow's edge to either side.
    fn shadow(self) -> (u32, f32) {
        match self {
            Self::Full => (ShadowMap::CELLS as u32, 1.0),
            Self::Light => (512, 0.0),
        }
    }
}

impl Renderer {
    /// Pipelines and arrays on a device; nothing is loaded yet.
    pub fn new(device: wgpu::Device, queue: wgpu::Queue, effort: Effort) -> Self {
        let [frame_layout, shadow_layout] = layouts(&device);
        let frame = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("frame"),
            size: size_of::<Frame>() as u64,
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let frame_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("frame"),
            layout: &frame_layout,
            entries: &[wgpu::BindGroupEntry { binding: 0, resource: frame.as_entire_binding() }],
        });
        let (side, _) = effort.shadow();
        let usage = wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::TEXTURE_BINDING;
        let shadow = texture(&device, "shadow", [side, side], 1, DEPTH, usage).create_view(&Default::default());
        let nearest = device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("shadow"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            // lit where nothing is nearer to the light
            compare: Some(wgpu::CompareFunction::GreaterEqual),
            ..Default::default()
        });
        let shadow_group = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("shadow"),
            layout: &shadow_layout,
            entries: &[
                wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&shadow) },
                wgpu::BindGroupEntry { binding: 1, resource: wgpu::BindingResource::Sampler(&nearest) },
            ],
        });
        let make = Maker::new(&device, [&frame_layout, &shadow_layout], effort.samples());
        let (corners, strokes) = (array(&device, "corners", &[]), array(&device, "strokes", &[]));
        Self {
            effort,
            sky: make.sky(),
            surfaces: make.surfaces(),
            line: make.line(),
            casts: make.casts(),
            device,
            queue,
            frame,
            frame_group,
            shadow,
            shadow_group,
            corners,
            casting: 0,
            strokes,
            points: vec![],
            target: None,
        }
    }

    /// Takes what is drawn from now on; returns the number of triangles skipped because a corner is non-finite or not there. Nothing of the
    /// input is kept.
    pub fn load(&mut self, drawn: &Drawn) -> usize {
        let (mut corners, mut strokes, mut skipped, mut casting) = (vec![], vec![], 0, 0);
        for (surfaces, kind) in [(drawn.clipped, CLIPPED), (drawn.whole, WHOLE), (drawn.in_front, IN_FRONT)] {
            for surface in surfaces {
                skipped += add(surface, kind, &mut corners);
                add_lines(surface, kind, &mut strokes);
            }
            if kind != IN_FRONT {
                casting = corners.len();
            }
        }
        self.casting = casting as u32;
        self.points = corners[..casting].iter().map(|corner: &Corner| Vec3::from(corner.x)).collect();
        fill(&self.device, &self.queue, &mut self.corners, "corners", &corners);
        fill(&self.device, &self.queue, &mut self.strokes, "strokes", &strokes);
        skipped
    }

    /// Draws what is loaded in perspective on a light background. The picture stays on the device until the next one; with a camera without
    /// a direction it is the background.
    ///
    /// # Panics
    /// If a side is 0 or beyond `max_texture_dimension_2d` of the device.
    pub fn draw(&mut self, camera: &Camera, size: [u32; 2], clip: Option<Clip>) -> &wgpu::TextureView {
        let largest = self.device.limits().max_texture_dimension_2d;
        assert!(size.into_iter().all(|side| (1..=largest).contains(&side)), "a picture of {size:?}");
        let target = match self.target.take() {
            Some(target) if target.size == size => target,
            _ => Target::new(&self.device, size, self.effort.samples()),
        };
        let view = View::new(camera, size[0] as usize, size[1] as usize);
        let frame = view.as_ref().map_or_else(|| blank(size), |view| self.frame_of(view, size, clip));
        self.queue.write_buffer(&self.frame, 0, bytemuck::bytes_of(&frame));
        let mut encoder =
            self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("picture") });
        let (corners, casting) = if view.is_some() { (self.corners.count, self.casting) } else { (0, 0) };
        let whole = usize::from(clip.is_none());
        let strokes = if view.is_some() { self.strokes.count } else { 0 };
        // what is nearest to the first light
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("shadow"),
                depth_stencil_attachment: Some(cleared(&self.shadow)),
                ..Default::default()
            });
            pass.set_pipeline(&self.casts[whole]);
            pass.set_bind_group(0, &self.frame_group, &[]);
            pass.set_vertex_buffer(0, self.corners.raw.slice(..));
            pass.draw(0..casting, 0..1);
        }
        // background, surfaces, lines on them
        {
            let color = wgpu::RenderPassColorAttachment {
                view: target.samples.as_ref().unwrap_or(&target.view),
                depth_slice: None,
                resolve_target: target.samples.as_ref().map(|_| &target.view),
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: if target.samples.is_some() { wgpu::StoreOp::Discard } else { wgpu::StoreOp::Store },
                },
            };
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("picture"),
                color_attachments: &[Some(color)],
                depth_stencil_attachment: Some(cleared(&target.depth)),
                ..Default::default()
            });
            pass.set_bind_group(0, &self.frame_group, &[]);
            pass.set_bind_group(1, &self.shadow_group, &[]);
            pass.set_pipeline(&self.sky);
            pass.draw(0..3, 0..1);
            pass.set_pipeline(&self.surfaces[whole]);
            pass.set_vertex_buffer(0, self.corners.raw.slice(..));
            pass.draw(0..corners, 0..1);
            pass.set_pipeline(&self.line);
            pass.set_vertex_buffer(0, self.strokes.raw.slice(..));
            pass.draw(0..6, 0..strokes);
        }
        self.queue.submit([encoder.finish()]);
        &self.target.insert(target).view
    }

    /// What the shader is told of a camera.
    fn frame_of(&self, view: &View, size: [u32; 2], clip: Option<Clip>) -> Frame {
        let [width, height] = size.map(|side| side as f32);
        let axis = |k: usize| view.axes[k].as_vec3().extend(0.0).to_array();
        let up = 1.0 / view.half_tangent as f32;
        let near = (NEAR * view.distance) as f32;
        // box of all corners along the axes of the first light; the camera's box of view does not matter
        let lights = [KEY, FILL, RIM].map(|(to, bright)| (Vec3::from(to).normalize(), bright));
        let (u, v) = lights[0].0.any_orthonormal_pair();
        let (mut low, mut high) = (Vec3::MAX, Vec3::MIN);
        let eye = view.eye.as_vec3();
        let axes = view.axes.map(|axis| axis.as_vec3());
        let map_axes = [u, v, lights[0].0];
        // the light's axes in the world, so that a corner takes three products
        let world = map_axes.map(|axis| axes[0] * axis.x + axes[1] * axis.y + axes[2] * axis.z);
        for point in &self.points {
            let p = Vec3::from(world.map(|axis| axis.dot(*point - eye)));
            (low, high) = (low.min(p), high.max(p));
        }
        if self.points.is_empty() {
            (low, high) = (Vec3::ZERO, Vec3::ONE);
        }
        let side = (high - low).truncate().max_element().max(f32::MIN_POSITIVE);
        let deep = (high.z - low.z).max(f32::MIN_POSITIVE);
        let (cells, around) = self.effort.shadow();
        let cells = cells as f32;
        let map = |k: usize| map_axes[k].extend(low[k]).to_array();
        let clip = clip
            .map_or([0.0, 0.0, 0.0, -1.0], |Clip { normal: [x, y, z], offset }| [x, y, z, offset].map(|v| v as f32));
        Frame {
            right: axis(0),
            up: axis(1),
            forward: axis(2),
            eye: eye.extend(0.0).to_array(),
            lens: [up * height / width, up, near, LINE_DEPTH_SHARE as f32],
            size: [width, height, FRONT, around],
            clip,
            lights: lights.map(|(to, bright)| to.extend(bright).to_array()),
            ambient: [AMBIENT[0], AMBIENT[1], BACKGROUND[0], BACKGROUND[1]],
            map_u: map(0),
            map_v: map(1),
            map_w: map(2),
            map_scale: [1.0 / side, 1.0 / deep, cells, side / cells],
        }
    }

    /// Brings the last picture back; without pixels if there is none.
    ///
    /// # Errors
    /// [`Failed::Device`] if the device fails.
    pub fn read(&self) -> Result<Image> {
        let Some(target) = &self.target else {
            return Ok(Image { width: 0, height: 0, rgb: vec![], skipped: 0 });
        };
        let [width, height] = target.size;
        let row = (4 * width).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
        let bytes = u64::from(row) * u64::from(height);
        let staging = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("picture"),
            size: bytes,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("read") });
        let layout = wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: None };
        encoder.copy_texture_to_buffer(
            target.picture.as_image_copy(),
            wgpu::TexelCopyBufferInfo { buffer: &staging, layout },
            target.picture.size(),
        );
        self.queue.submit([encoder.finish()]);
        let failed = |message: String| Failed::Device { message };
        staging.map_async(wgpu::MapMode::Read, 0..bytes, |_| {});
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| failed(e.to_string()))?;
        let mapped = staging.get_mapped_range(0..bytes).map_err(|e| failed(e.to_string()))?;
        let mut rgb = Vec::with_capacity(3 * width as usize * height as usize);
        for line in mapped.chunks_exact(row as usize) {
            line[..4 * width as usize].chunks_exact(4).for_each(|pixel| rgb.extend_from_slice(&pixel[..3]));
        }
        Ok(Image { width, height, rgb, skipped: 0 })
    }
}

/// Corners of a surface's triangles; returns the number of those skipped.
fn add(surface: &Surface, kind: f32, corners: &mut Vec<Corner>) -> usize {
    let points: Vec<Option<Vec3>> = surface
        .positions
        .iter()
        .map(|p| Some(glam::DVec3::from_array(*p).as_vec3()).filter(|p| p.is_finite()))
        .collect();
    let mut triangles: Vec<Triangle> = vec![];
    let skipped = prepare(surface, &points, &mut triangles);
    for triangle in &triangles {
        for k in 0..3 {
            corners.push(Corner {
                x: triangle.corners[k].to_array(),
                normal: triangle.normals[k].to_array(),
                color: triangle.colors[k].to_array(),
                material: [triangle.shininess, kind],
            });
        }
    }
    skipped
}

/// Lines of a surface; those with a missing or non-finite end are left out.
fn add_lines(surface: &Surface, kind: f32, strokes: &mut Vec<Stroke>) {
    let point = |id: u32| {
        let p = surface.positions.get(id as usize)?.map(|v| v as f32);
        p.iter().all(|v| v.is_finite()).then_some(p)
    };
    for outline in surface.outlines {
        let stroke = |ids: &[u32; 2]| {
            let ends = [point(ids[0])?, point(ids[1])?];
            Some(Stroke { ends, ink: outline.ink, style: [outline.width, kind] })
        };
        strokes.extend(outline.lines.iter().filter_map(stroke));
    }
}

/// Frame of a background alone.
fn blank(size: [u32; 2]) -> Frame {
    let ambient = [AMBIENT[0], AMBIENT[1], BACKGROUND[0], BACKGROUND[1]];
    Frame { size: [size[0] as f32, size[1] as f32, 0.0, 0.0], ambient, ..Frame::zeroed() }
}

fn array(device: &wgpu::Device, label: &'static str, bytes: &[u8]) -> Array {
    // room for a wound that grows, so that not every frame makes an array
    let size = (bytes.len() as u64).next_power_of_two().max(4096);
    let usage = wgpu::BufferUsages::VERTEX | wgpu::BufferUsages::COPY_DST;
    let descriptor = wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
    Array { raw: device.create_buffer(&descriptor), count: 0 }
}

fn fill<T: Pod>(device: &wgpu::Device, queue: &wgpu::Queue, to: &mut Array, label: &'static str, data: &[T]) {
    let bytes = bytemuck::cast_slice(data);
    if to.raw.size() < bytes.len() as u64 {
        *to = array(device, label, bytes);
    }
    queue.write_buffer(&to.raw, 0, bytes);
    to.count = data.len() as u32;
}

fn texture(
    device: &wgpu::Device,
    label: &'static str,
    [width, height]: [u32; 2],
    sample_count: u32,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
        mip_level_count: 1,
        sample_count,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage,
        view_formats: &[],
    })
}

/// A depth texture that a pass begins with nothing in.
fn cleared(view: &wgpu::TextureView) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    let depth_ops = Some(wgpu::Operations { load: wgpu::LoadOp::Clear(0.0), store: wgpu::StoreOp::Store });
    wgpu::RenderPassDepthStencilAttachment { view, depth_ops, stencil_ops: None }
}

impl Target {
    fn new(device: &wgpu::Device, size: [u32; 2], samples: u32) -> Self {
        let drawn = wgpu::TextureUsages::RENDER_ATTACHMENT;
        let shown = drawn | wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_SRC;
        let picture = texture(device, "picture", size, 1, FORMAT, shown);
        Self {
            size,
            samples: (samples > 1)
                .then(|| texture(device, "samples", size, samples, FORMAT, drawn).create_view(&Default::default())),
            depth: texture(device, "depth", size, samples, DEPTH, drawn).create_view(&Default::default()),
            view: picture.create_view(&Default::default()),
            picture,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::pipelines::WGSL;
    use super::*;
    use std::mem::offset_of;

    #[test]
    fn the_shader_is_valid_and_laid_out_as_in_rust() {
        let module = naga::front::wgsl::parse_str(WGSL).expect("WGSL");
        use naga::valid::{Capabilities, ValidationFlags, Validator};
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).expect("valid WGSL");
        let (_, frame) = module.types.iter().find(|(_, ty)| ty.name.as_deref() == Some("Frame")).expect("the uniform");
        let naga::TypeInner::Struct { members, span } = &frame.inner else { panic!("a struct") };
        let found: Vec<(&str, usize)> =
            members.iter().map(|m| (m.name.as_deref().unwrap_or_default(), m.offset as usize)).collect();
        let wanted = [
            ("right", offset_of!(Frame, right)),
            ("up", offset_of!(Frame, up)),
            ("forward", offset_of!(Frame, forward)),
            ("eye", offset_of!(Frame, eye)),
            ("lens", offset_of!(Frame, lens)),
            ("size", offset_of!(Frame, size)),
            ("clip", offset_of!(Frame, clip)),
            ("lights", offset_of!(Frame, lights)),
            ("ambient", offset_of!(Frame, ambient)),
            ("map_u", offset_of!(Frame, map_u)),
            ("map_v", offset_of!(Frame, map_v)),
            ("map_w", offset_of!(Frame, map_w)),
            ("map_scale", offset_of!(Frame, map_scale)),
        ];
        assert_eq!((found.as_slice(), *span as usize), (&wanted[..], size_of::<Frame>()));
        // what the drivers of Vulkan, Metal and DX12 are given
        let options = naga::back::spv::Options::default();
        naga::back::spv::write_vec(&module, &info, &options, None).expect("SPIR-V");
        let options =
            naga::back::msl::Options { lang_version: (2, 4), fake_missing_bindings: true, ..Default::default() };
        naga::back::msl::write_string(&module, &info, &options, &Default::default()).expect("MSL");
        let options = naga::back::hlsl::Options { fake_missing_bindings: true, ..Default::default() };
        let (mut text, all) = (String::new(), naga::back::hlsl::PipelineOptions::default());
        naga::back::hlsl::Writer::new(&mut text, &options, &all).write(&module, &info, None).expect("HLSL");
    }
}
