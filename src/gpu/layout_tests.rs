//! Layouts of structs in WGSL, for tests that compare them with the structs in Rust.

use super::{ShaderVariant, compose};
use wgpu::naga;

/// Size of a struct, and names and offsets of its members without paddings.
pub fn wgsl_layout(variant: &ShaderVariant, name: &str) -> (usize, Vec<(String, usize)>) {
    let module = compose(variant, false).unwrap();
    let found = module.types.iter().find_map(|(_, ty)| match (&ty.name, &ty.inner) {
        // Composed modules mangle the names of what they import.
        (Some(n), naga::TypeInner::Struct { members, span })
            if n == name || n.starts_with(&format!("{name}X_naga_oil")) =>
        {
            let members = members.iter().map(|m| (m.name.clone().unwrap(), m.offset as usize));
            Some((*span as usize, members.filter(|m| !m.0.starts_with("padding")).collect()))
        }
        _ => None,
    });
    found.unwrap_or_else(|| panic!("{name} is not in {}", variant.entry))
}

/// Asserts that a struct of a variant and one of Rust have the same size, members and offsets.
macro_rules! assert_layout {
    ($variant:expr, $name:literal, $ty:ty: $($field:ident),* $(,)?) => {
        assert_eq!(
            $crate::gpu::wgsl_layout($variant, $name),
            (size_of::<$ty>(), vec![$((stringify!($field).to_string(), std::mem::offset_of!($ty, $field))),*])
        )
    };
}

pub(crate) use assert_layout;
