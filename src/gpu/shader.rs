//! Kernel reflection by naga: variables, their access and size, layout of the parameters; validation of the text.

use super::Failed;
use crate::error::Result;
use crate::kernels::{Source, text};
use naga::front::wgsl;
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, StorageAccess, TypeInner};

/// Access of a kernel to a variable.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Access {
    /// Uniform buffer.
    Uniform,
    /// Storage buffer, read only.
    Read,
    /// Storage buffer, read and written.
    ReadWrite,
}

/// One bound variable of a kernel.
#[derive(Clone, Debug)]
pub struct Variable {
    /// Name in the shader.
    pub name: String,
    /// `@binding`, in group 0.
    pub binding: u32,
    /// Access.
    pub access: Access,
    /// Minimum size, bytes: that of a fixed type, or of one element of an unsized array.
    pub min_bytes: u64,
}

/// Kernel as parsed by naga.
#[derive(Clone, Debug)]
pub struct Shader {
    /// Entry point.
    pub name: &'static str,
    /// Complete WGSL text.
    pub text: String,
    /// Variables in binding order.
    pub variables: Vec<Variable>,
    /// Threads per workgroup along x.
    pub workgroup: u32,
    /// Fields of `params`: name and byte offset.
    pub params: Vec<(String, u32)>,
}

impl Shader {
    /// Parses and validates a kernel.
    ///
    /// # Errors
    /// [`Failed::Shader`] with naga's message if the text does not parse, validate or follow the project's layout.
    pub fn read(source: &Source) -> Result<Self> {
        Self::from_text(source.name, text(source))
    }

    /// Parses and validates WGSL text with the entry point `name`.
    ///
    /// # Errors
    /// As [`Shader::read`].
    pub fn from_text(name: &'static str, text: String) -> Result<Self> {
        let fail = |message: String| Failed::Shader { kernel: name, message };
        let module = wgsl::parse_str(&text).map_err(|e| fail(e.emit_to_string(&text)))?;
        Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .map_err(|e| fail(e.emit_to_string(&text)))?;
        let entry = module.entry_points.iter().find(|e| e.name == name);
        let workgroup = entry.ok_or_else(|| fail(format!("there is no entry point `{name}`")))?.workgroup_size[0];
        let context = module.to_ctx();
        let mut variables = vec![];
        let mut params = vec![];
        for (_, variable) in module.global_variables.iter() {
            let access = match variable.space {
                AddressSpace::Uniform => Access::Uniform,
                AddressSpace::Storage { access } if access.contains(StorageAccess::STORE) => Access::ReadWrite,
                AddressSpace::Storage { .. } => Access::Read,
                _ => continue,
            };
            let slot = variable.binding.as_ref().ok_or_else(|| fail("a buffer has no @binding".into()))?;
            let name = variable.name.clone().unwrap_or_default();
            let inner = &module.types[variable.ty].inner;
            if let (true, TypeInner::Struct { members, .. }) = (name == "params", inner) {
                params = members.iter().map(|m| (m.name.clone().unwrap_or_default(), m.offset)).collect();
            }
            let min_bytes = u64::from(inner.size(context));
            variables.push(Variable { name, binding: slot.binding, access, min_bytes });
        }
        variables.sort_by_key(|v| v.binding);
        Ok(Self { name, text, variables, workgroup, params })
    }

    /// Compares the `params` struct with the host's field list, one 4-byte word each.
    ///
    /// # Errors
    /// [`Failed::Shader`] that names the first field at the wrong offset.
    pub fn check_params(&self, fields: &[&str]) -> Result<()> {
        let fail = |message: String| Failed::Shader { kernel: self.name, message }.into();
        for (k, field) in fields.iter().enumerate() {
            let here = 4 * k as u32;
            match self.params.iter().find(|(name, _)| name == field) {
                Some((_, offset)) if *offset == here => {}
                Some((_, offset)) => {
                    return Err(fail(format!(
                        "field `params.{field}` is at byte {here} in Rust and {offset} in WGSL; reorder or pad so that both agree"
                    )));
                }
                None => {
                    return Err(fail(format!("field `params.{field}` is missing in WGSL; add it at byte {here}")));
                }
            }
        }
        if self.params.len() != fields.len() {
            return Err(fail(format!(
                "`params` has {} fields in WGSL and {} in Rust; make both lists the same",
                self.params.len(),
                fields.len()
            )));
        }
        Ok(())
    }
}
