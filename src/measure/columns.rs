//! Macro that declares the row of a comparison table together with its columns.

/// Declares the fields of a comparison table row together with the table's columns, their order, units and
/// descriptions.
macro_rules! columns {
    ($($(#[doc = $about:literal])+ $name:ident [$unit:literal]: $t:ty,)*) => {
        /// Row of the comparison table: measurements of one shadow method with one setting. The fields are the first
        /// columns, in order.
        #[derive(Debug, Clone, PartialEq, Default)]
        pub struct Row {
            $($(#[doc = $about])+ pub $name: $t,)*
            /// Settings of the shadow method: pairs of name and value. Each setting has its own column at the end of
            /// the comparison table.
            pub settings: Vec<(&'static str, Cell)>,
        }

        /// All columns of the comparison table, in order: the fields of [`Row`], then one column for each setting of
        /// any method.
        pub static COLUMNS: LazyLock<Vec<Column>> = LazyLock::new(|| {
            let fields = [$((stringify!($name), $unit, concat!($($about),+).trim().to_owned())),*];
            let settings = setting_columns().into_iter().map(|(name, about)| (name, "", about));
            fields.into_iter().chain(settings).map(|(name, unit, about)| Column { name, unit, about }).collect()
        });

        impl Row {
            /// Returns the cells of a comparison table row, one for each column of [`COLUMNS`].
            pub fn cells(&self) -> Vec<Cell> {
                let mut cells = vec![$(self.$name.clone().into()),*];
                cells.extend(COLUMNS[cells.len()..].iter().map(|c| self.setting(c.name)));
                cells
            }

            /// Parses a comparison table row from cell texts, given by column name. A missing column gets its default
            /// value.
            ///
            /// # Errors
            /// Returns the name of the first column whose text is not a valid value.
            pub fn from_texts(texts: &BTreeMap<String, String>) -> Result<Self, &'static str> {
                let given = |key: &str| texts.get(key).filter(|text| !text.is_empty());
                let setting = |(key, _)| Some((key, Cell::from_text(given(key)?)?));
                Ok(Self {
                    $($name: match texts.get(stringify!($name)) {
                        Some(text) => FromText::from_text(text).ok_or(stringify!($name))?,
                        None => Default::default(),
                    },)*
                    settings: setting_columns().into_iter().filter_map(setting).collect(),
                })
            }
        }
    };
}

pub(super) use columns;
