//! Layers of optional settings: values from command-line flags win over those of a scene file, which win over
//! defaults.

/// Set of optional settings that can be combined with another set, such as command-line flags with a scene file.
pub trait Layer {
    /// Combines two sets of optional settings: a value of `self` wins over one of `below`.
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

/// Declares a struct of optional settings that implements [`Layer`], field by field.
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
