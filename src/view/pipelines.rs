//! Pipelines of pictures on a graphics adapter: background, surfaces, lines, shadow map; and the vertices that they take.

use bytemuck::{Pod, Zeroable};

/// Format of a picture: sRGB by gamma 2, as the rasteriser's.
pub(super) const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
pub(super) const DEPTH: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// Samples of a pixel: what every adapter offers.
pub(super) const SAMPLES: u32 = 4;

/// Text of the shader.
pub const WGSL: &str = include_str!("picture.wgsl");

/// Corner of a triangle.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Corner {
    pub(super) x: [f32; 3],
    pub(super) normal: [f32; 3],
    pub(super) color: [f32; 3],
    /// Shininess, and its kind.
    pub(super) material: [f32; 2],
}

/// Line with its style.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
pub(super) struct Stroke {
    pub(super) ends: [[f32; 3]; 2],
    pub(super) ink: [f32; 3],
    /// Width, pixels, and its kind.
    pub(super) style: [f32; 2],
}

/// Layouts of the bindings: of a picture, and of its shadows.
pub(super) fn layouts(device: &wgpu::Device) -> [wgpu::BindGroupLayout; 2] {
    let layout = |label: &'static str, entries: &[wgpu::BindGroupLayoutEntry]| {
        device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries })
    };
    let entry = |binding: u32, visibility: wgpu::ShaderStages, ty: wgpu::BindingType| wgpu::BindGroupLayoutEntry {
        binding,
        visibility,
        ty,
        count: None,
    };
    let uniform = wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset: false,
        min_binding_size: None,
    };
    let depth = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Depth,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    let compares = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison);
    let shades = wgpu::ShaderStages::FRAGMENT;
    [
        layout("frame", &[entry(0, wgpu::ShaderStages::VERTEX_FRAGMENT, uniform)]),
        layout("shadow", &[entry(0, shades, depth), entry(1, shades, compares)]),
    ]
}

/// Makes the pipelines.
pub(super) struct Maker<'a> {
    device: &'a wgpu::Device,
    module: wgpu::ShaderModule,
    samples: u32,
    /// With shadows, and without.
    layouts: [wgpu::PipelineLayout; 2],
}

/// What two pipelines differ in.
struct Kind<'a> {
    vertex: &'static str,
    fragment: &'static str,
    buffer: Option<wgpu::VertexBufferLayout<'a>>,
    compare: wgpu::CompareFunction,
    writes_depth: bool,
    blend: Option<wgpu::BlendState>,
    /// Of the shadow map, not of the picture.
    casts: bool,
}

impl<'a> Maker<'a> {
    pub(super) fn new(device: &'a wgpu::Device, [frame, shadow]: [&wgpu::BindGroupLayout; 2], samples: u32) -> Self {
        let source = wgpu::ShaderSource::Wgsl(WGSL.into());
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor { label: Some("picture"), source });
        let layout = |layouts: &[Option<&wgpu::BindGroupLayout>]| {
            device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some("picture"),
                bind_group_layouts: layouts,
                immediate_size: 0,
            })
        };
        let layouts = [layout(&[Some(frame), Some(shadow)]), layout(&[Some(frame)])];
        Self { device, module, samples, layouts }
    }

    fn pipeline(&self, kind: Kind) -> wgpu::RenderPipeline {
        let color = wgpu::ColorTargetState { format: FORMAT, blend: kind.blend, write_mask: wgpu::ColorWrites::ALL };
        let colors = [Some(color)];
        self.device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(kind.fragment),
            layout: Some(&self.layouts[usize::from(kind.casts)]),
            vertex: wgpu::VertexState {
                module: &self.module,
                entry_point: Some(kind.vertex),
                compilation_options: Default::default(),
                buffers: &[kind.buffer],
            },
            // both sides are drawn
            primitive: wgpu::PrimitiveState::default(),
            depth_stencil: Some(wgpu::DepthStencilState {
                format: DEPTH,
                depth_write_enabled: Some(kind.writes_depth),
                depth_compare: Some(kind.compare),
                stencil: wgpu::StencilState::default(),
                bias: wgpu::DepthBiasState::default(),
            }),
            multisample: wgpu::MultisampleState {
                count: if kind.casts { 1 } else { self.samples },
                ..Default::default()
            },
            fragment: Some(wgpu::FragmentState {
                module: &self.module,
                entry_point: Some(kind.fragment),
                compilation_options: Default::default(),
                targets: if kind.casts { &[] } else { &colors },
            }),
            multiview_mask: None,
            cache: None,
        })
    }

    pub(super) fn sky(&self) -> wgpu::RenderPipeline {
        self.pipeline(Kind {
            vertex: "sky_vertex",
            fragment: "sky",
            buffer: None,
            compare: wgpu::CompareFunction::Always,
            writes_depth: false,
            blend: None,
            casts: false,
        })
    }

    /// Where a plane clips, and where none does.
    pub(super) fn surfaces(&self) -> [wgpu::RenderPipeline; 2] {
        ["surface", "surface_whole"].map(|fragment| self.surface(fragment))
    }

    fn surface(&self, fragment: &'static str) -> wgpu::RenderPipeline {
        self.pipeline(Kind {
            vertex: "surface_vertex",
            fragment,
            buffer: Some(of_corners(&CORNER)),
            compare: wgpu::CompareFunction::Greater,
            writes_depth: true,
            blend: None,
            casts: false,
        })
    }

    /// As [`Maker::surfaces`].
    pub(super) fn casts(&self) -> [wgpu::RenderPipeline; 2] {
        ["cast_shadow", "cast_whole"].map(|fragment| self.cast(fragment))
    }

    fn cast(&self, fragment: &'static str) -> wgpu::RenderPipeline {
        self.pipeline(Kind {
            vertex: "cast_vertex",
            fragment,
            buffer: Some(of_corners(&CAST)),
            compare: wgpu::CompareFunction::Greater,
            writes_depth: true,
            blend: None,
            casts: true,
        })
    }

    pub(super) fn line(&self) -> wgpu::RenderPipeline {
        // what is below times the ink; by gamma 2 a product is the same of linear colours
        let times = wgpu::BlendComponent {
            src_factor: wgpu::BlendFactor::Dst,
            dst_factor: wgpu::BlendFactor::Zero,
            operation: wgpu::BlendOperation::Add,
        };
        self.pipeline(Kind {
            vertex: "line_vertex",
            fragment: "line",
            buffer: Some(wgpu::VertexBufferLayout {
                array_stride: size_of::<Stroke>() as u64,
                step_mode: wgpu::VertexStepMode::Instance,
                attributes: &STROKE,
            }),
            compare: wgpu::CompareFunction::GreaterEqual,
            writes_depth: false,
            blend: Some(wgpu::BlendState { color: times, alpha: times }),
            casts: false,
        })
    }
}

const CORNER: [wgpu::VertexAttribute; 4] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x2];
/// Position and material of a corner.
const CAST: [wgpu::VertexAttribute; 2] = [CORNER[0], CORNER[3]];
const STROKE: [wgpu::VertexAttribute; 4] =
    wgpu::vertex_attr_array![0 => Float32x3, 1 => Float32x3, 2 => Float32x3, 3 => Float32x2];

fn of_corners(attributes: &[wgpu::VertexAttribute]) -> wgpu::VertexBufferLayout<'_> {
    wgpu::VertexBufferLayout {
        array_stride: size_of::<Corner>() as u64,
        step_mode: wgpu::VertexStepMode::Vertex,
        attributes,
    }
}
