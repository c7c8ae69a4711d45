//! Layers of optional settings: flags win over a scene file, which wins over defaults.

/// Optional settings that can be combined in layers.
pub trait Layer {
    /// Combines two layers of settings: a value of this layer wins over one of the layer below.
    #[must_use]
    fn over(&self, below: &Self) -> Self;
}

impl<T: Clone> Layer for Option<T> {
    fn over(&self, below: &Self) -> Self {
        self.clone().or_else(|| below.clone())
    }
}

impl Layer for bool {
    fn over(&self, below: &Self) -> Self {
        *self || *below
    }
}

/// Declares a struct of optional settings, or of groups of such settings, that implements [`Layer`].
macro_rules! layer {
    ($(#[$meta:meta])* pub struct $name:ident { $($(#[$field_meta:meta])* pub $field:ident: $ty:ty,)* }) => {
        $(#[$meta])*
        pub struct $name { $($(#[$field_meta])* pub $field: $ty,)* }

        impl $crate::open::layer::Layer for $name {
            fn over(&self, below: &Self) -> Self {
                Self { $($field: self.$field.over(&below.$field),)* }
            }
        }
    };
}

pub(super) use layer;
