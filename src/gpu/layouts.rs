//! Memory layouts of WGSL structs.

#[cfg(test)]
use super::{ShaderVariant, Tuning, compose};
use wgpu::naga;

/// Memory layout of a WGSL struct.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StructLayout {
    /// Size of a WGSL struct, bytes.
    pub size: usize,
    /// Names and offsets (bytes) of the members of a WGSL struct, without padding.
    pub members: Vec<(String, usize)>,
}

impl StructLayout {
    /// Returns the layout of a struct in a composed WGSL module; `None` if the module has no struct of that name.
    pub fn of(module: &naga::Module, name: &str) -> Option<Self> {
        module.types.iter().find_map(|(_, ty)| match (&ty.name, &ty.inner) {
            // Composed modules mangle the names of what they import.
            (Some(n), naga::TypeInner::Struct { members, span })
                if n == name || n.starts_with(&format!("{name}X_naga_oil")) =>
            {
                let named = members.iter().filter_map(|m| Some((m.name.clone()?, m.offset as usize)));
                let members = named.filter(|m| !m.0.starts_with("padding")).collect();
                Some(Self { size: *span as usize, members })
            }
            _ => None,
        })
    }
}

/// Returns the layout of a WGSL struct of a shader, for tests that compare it with the Rust struct.
#[cfg(test)]
pub fn wgsl_layout(variant: &ShaderVariant, name: &str) -> StructLayout {
    let found = StructLayout::of(&compose(variant, &Tuning::SOFTWARE).unwrap(), name);
    found.unwrap_or_else(|| panic!("{name} is not in {}", variant.entry))
}

/// Asserts that a WGSL struct and a Rust struct have the same size, members and offsets.
#[cfg(test)]
macro_rules! assert_layout {
    ($variant:expr, $name:literal, $ty:ty: $($field:ident),* $(,)?) => {
        assert_eq!(
            $crate::gpu::wgsl_layout($variant, $name),
            $crate::gpu::StructLayout {
                size: size_of::<$ty>(),
                members: vec![$((stringify!($field).to_string(), std::mem::offset_of!($ty, $field))),*],
            }
        )
    };
}

#[cfg(test)]
pub(crate) use assert_layout;
