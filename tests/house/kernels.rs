//! Every shader as naga sees it, without an adapter: it is valid, within core WebGPU's limits, laid out as in Rust, and translates to
//! each platform's language.

use cutis::error::Error;
use cutis::gpu::{Access, Failed, Shader};
use cutis::kernels::{self, ALL, COMMON, Source, update};
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module, ShaderStage, TypeInner};
use std::collections::BTreeSet;

/// Storage buffers that one stage of core WebGPU may bind.
const STORAGE_BUFFERS: usize = 8;
/// Threads per workgroup that core WebGPU guarantees.
const INVOCATIONS: u32 = 256;
/// Bytes of workgroup memory that core WebGPU guarantees.
const WORKGROUP_BYTES: u32 = 16 * 1024;
/// Bytes of a uniform binding that core WebGPU guarantees.
const UNIFORM_BYTES: u64 = 64 * 1024;

fn module(source: &Source) -> (Module, ModuleInfo) {
    let module = naga::front::wgsl::parse_str(&kernels::text(source)).expect(source.name);
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module).expect(source.name);
    (module, info)
}

#[test]
fn every_kernel_is_valid_and_laid_out_as_in_rust() {
    for source in ALL {
        let shader = Shader::read(source).unwrap_or_else(|e| panic!("{e}"));
        shader.check_params(source.params).unwrap_or_else(|e| panic!("{e}"));
        let bindings: Vec<u32> = shader.variables.iter().map(|v| v.binding).collect();
        assert_eq!(bindings, (0..bindings.len() as u32).collect::<Vec<_>>(), "{}", source.name);
        let names: BTreeSet<&str> = shader.variables.iter().map(|v| v.name.as_str()).collect();
        assert_eq!(names.len(), bindings.len(), "{}", source.name);
        assert!(names.contains("params"), "{}", source.name);
    }
}

#[test]
fn every_kernel_has_one_name_and_one_twin() {
    let names: BTreeSet<&str> = ALL.iter().map(|s| s.name).collect();
    assert_eq!(names.len(), ALL.len());
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("kernels");
    let mut files = BTreeSet::new();
    for entry in std::fs::read_dir(&folder).expect("the kernels' folder") {
        let path = entry.expect("an entry").path();
        let shared = [
            "common",
            "split",
            "deformation",
            "hyperelastic",
            "hyperelastic_cells",
            "neo_hookean",
            "mooney_rivlin",
            "linearised",
            "holzapfel",
            "collected",
            "columns",
            "compensated",
            "polar",
            "tetrahedra",
            "gathered",
        ]
        .map(|name| path.ends_with(format!("{name}.wgsl")));
        if path.extension().is_some_and(|e| e == "wgsl") && !shared.contains(&true) {
            assert!(path.with_extension("rs").is_file(), "{} has no twin", path.display());
            files.insert(path.file_stem().expect("a name").to_string_lossy().into_owned());
        }
    }
    assert_eq!(files, names.iter().map(|n| n.to_string()).collect(), "files and `kernels::ALL`");
    for source in ALL {
        let file = std::fs::read_to_string(folder.join(format!("{}.wgsl", source.name))).expect(source.name);
        assert_eq!(file, source.wgsl, "{} holds another file's text", source.name);
    }
}

#[test]
fn every_kernel_stays_within_core_limits() {
    for source in ALL {
        let shader = Shader::read(source).unwrap_or_else(|e| panic!("{e}"));
        let storage = shader.variables.iter().filter(|v| v.access != Access::Uniform).count();
        assert!(storage <= STORAGE_BUFFERS, "{} binds {storage} storage buffers", source.name);
        for v in shader.variables.iter().filter(|v| v.access == Access::Uniform) {
            assert!(v.min_bytes <= UNIFORM_BYTES, "{}: `{}` has {} bytes", source.name, v.name, v.min_bytes);
        }
        let (module, _) = module(source);
        assert_eq!(module.entry_points.len(), 1, "{}", source.name);
        let entry = &module.entry_points[0];
        assert_eq!((entry.name.as_str(), entry.stage), (source.name, ShaderStage::Compute));
        let [x, y, z] = entry.workgroup_size;
        assert!(x * y * z <= INVOCATIONS, "{} runs {} threads per workgroup", source.name, x * y * z);
        assert_eq!((x, [y, z]), (shader.workgroup, [1, 1]), "{}", source.name);
        let shared: u32 = module
            .global_variables
            .iter()
            .filter(|(_, v)| v.space == AddressSpace::WorkGroup)
            .map(|(_, v)| module.types[v.ty].inner.size(module.to_ctx()).next_multiple_of(16))
            .sum();
        assert!(shared <= WORKGROUP_BYTES, "{} shares {shared} bytes", source.name);
    }
}

/// mat3 and vec3 in storage have holes that Rust's arrays have not.
#[test]
fn storage_holds_scalars_vec2_and_vec4() {
    for source in ALL {
        let (module, _) = module(source);
        let storage = |space| matches!(space, AddressSpace::Storage { .. });
        for (_, v) in module.global_variables.iter().filter(|(_, v)| storage(v.space)) {
            let element = match module.types[v.ty].inner {
                TypeInner::Array { base, .. } => &module.types[base].inner,
                ref inner => inner,
            };
            let packed = match element {
                TypeInner::Scalar(_) | TypeInner::Atomic(_) => true,
                TypeInner::Vector { size, .. } => *size != naga::VectorSize::Tri,
                _ => false,
            };
            assert!(packed, "{}: `{}` holds {element:?}", source.name, v.name.as_deref().unwrap_or(""));
        }
    }
}

fn shader_error(result: cutis::error::Result<impl Sized>) -> (&'static str, String) {
    match result {
        Err(Error::Gpu(Failed::Shader { kernel, message })) => (kernel, message),
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("it was taken"),
    }
}

#[test]
fn a_field_out_of_place_is_named() {
    let check = |from: &str, to: &str| {
        let broken = COMMON.replacen(from, to, 1);
        assert_ne!(broken, COMMON, "`{from}` is not in the common part; choose another part to break");
        let shader = Shader::from_text("update", format!("{broken}\n{}", update::SOURCE.wgsl)).expect("valid WGSL");
        shader_error(shader.check_params(update::SOURCE.params)).1
    };
    assert_eq!(
        check("nodes_x: u32, nodes_y: u32", "nodes_y: u32, nodes_x: u32"),
        "field `params.nodes_x` is at byte 0 in Rust and 4 in WGSL; reorder or pad so that both agree"
    );
    let swapped = check("gravity_y: f32, gravity_z: f32", "gravity_z: f32, gravity_y: f32");
    assert!(swapped.starts_with("field `params.gravity_y` is at byte "), "{swapped}");
    let renamed = check("cell_count: u32", "cell_number: u32");
    assert!(renamed.starts_with("field `params.cell_count` is missing in WGSL; add it at byte 28"), "{renamed}");
    let count = update::SOURCE.params.len();
    assert_eq!(
        check("}\n\nconst GROUP", "    extra: f32,\n}\n\nconst GROUP"),
        format!("`params` has {} fields in WGSL and {count} in Rust; make both lists the same", count + 1)
    );
}

#[test]
fn a_broken_shader_is_an_error_that_shows_the_place() {
    let broken = |from: &str, to: &str| {
        let wgsl = update::SOURCE.wgsl.replacen(from, to, 1);
        assert_ne!(wgsl, update::SOURCE.wgsl, "`{from}` is not in the kernel; choose another part to break");
        let (kernel, message) = shader_error(Shader::from_text("update", format!("{COMMON}\n{wgsl}")));
        assert_eq!(kernel, "update");
        message
    };
    let unparsed = broken("let head =", "let head +");
    assert!(unparsed.contains("let head +"), "{unparsed}");
    let unknown = broken("head.y * p[i]", "head.y * q[i]");
    assert!(unknown.contains("`q`") || unknown.contains("'q'"), "{unknown}");
    let mistyped = broken("node < params.node_count", "node < params.step");
    assert!(mistyped.contains("params.step"), "{mistyped}");
    let readonly = broken("read_write> x", "read> x");
    assert!(!readonly.is_empty());
    let unbound = broken("@group(0) @binding(4) ", "");
    assert!(!unbound.is_empty());
    let nameless = broken("fn update(", "fn refresh(");
    assert_eq!(nameless, "there is no entry point `update`");
    let words = Failed::Shader { kernel: "update", message: nameless }.to_string();
    assert!(words.starts_with("kernel `update` does not compile: "), "{words}");
}

/// What the drivers of Vulkan, Metal and DX12 are given; naga refuses here what it could not write there.
#[test]
fn every_kernel_translates_to_spirv_msl_and_hlsl() {
    use naga::back::{hlsl, msl, spv};
    for source in ALL {
        let (module, info) = module(source);
        let name = || source.name.to_string();
        let entry = spv::PipelineOptions { shader_stage: ShaderStage::Compute, entry_point: name() };
        let options = spv::Options { fake_missing_bindings: true, ..spv::Options::default() };
        let words = spv::write_vec(&module, &info, &options, Some(&entry)).expect(source.name);
        assert_eq!(words[0], 0x0723_0203, "{}", source.name);
        let options = msl::Options { lang_version: (2, 4), fake_missing_bindings: true, ..msl::Options::default() };
        let entry = msl::PipelineOptions { entry_point: Some((ShaderStage::Compute, name())), ..Default::default() };
        let (text, _) = msl::write_string(&module, &info, &options, &entry).expect(source.name);
        assert!(text.contains("kernel void"), "{}", source.name);
        let options = hlsl::Options { fake_missing_bindings: true, ..hlsl::Options::default() };
        let entry = hlsl::PipelineOptions { entry_point: Some((ShaderStage::Compute, name())) };
        let mut text = String::new();
        let mut writer = hlsl::Writer::new(&mut text, &options, &entry);
        writer.write(&module, &info, None).expect(source.name);
        assert!(text.contains("[numthreads("), "{}", source.name);
    }
}
