//! Memory layouts of WGSL structs, for tests that compare them with the Rust structs.

use super::{ShaderVariant, Tuning, compose};
use wgpu::naga;

/// Returns the size of a WGSL struct, and the names and offsets of its members without padding.
pub fn wgsl_layout(variant: &ShaderVariant, name: &str) -> (usize, Vec<(String, usize)>) {
    let module = compose(variant, &Tuning::SOFTWARE).unwrap();
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

/// Asserts that a WGSL struct and a Rust struct have the same size, members and offsets.
macro_rules! assert_layout {
    ($variant:expr, $name:literal, $ty:ty: $($field:ident),* $(,)?) => {
        assert_eq!(
            $crate::gpu::wgsl_layout($variant, $name),
            (size_of::<$ty>(), vec![$((stringify!($field).to_string(), std::mem::offset_of!($ty, $field))),*])
        )
    };
}

pub(crate) use assert_layout;
