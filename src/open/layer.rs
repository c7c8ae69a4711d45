//! Layers of optional settings: flags over a scene file over defaults.

/// Optional settings that can be laid over others.
pub trait Layer {
    /// Combines two layers of settings: values of `self` where given, values of `below` otherwise.
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

/// Declares a struct of optional settings, or of groups of them, as a [`Layer`].
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
