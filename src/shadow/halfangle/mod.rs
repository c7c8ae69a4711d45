//! Shadow method `halfangle`: half-angle slicing.
//!
//! Kniss, Premože, Hansen, Shirley and McPherson 2003, *A Model for Volume Lighting and Modeling*, after the shadow buffer
//! of Kniss, Kindlmann and Hansen 2002. The volume is cut into slices across the half vector, the direction in the middle
//! between light and view, so that light rays and eye rays cross all slices in the same order. The picture and the light
//! are advanced slice by slice: only two light buffers exist at a time, whatever the number of slices. If the light comes
//! from behind the volume, the view is reversed, and slices are drawn from back to front.
//!
//! The papers were not read; the method follows descriptions in later work. Deviations, and why:
//! * The slab between two slices is marched by the ray caster of all methods, at its own samples. The papers draw one
//!   textured polygon for each slice, so that slices are the samples of the picture, too.
//! * `between=linear` interpolates the optical depth between the two slices around a point. The papers take the light at
//!   the slice in front (`between=constant`).
//! * A light buffer holds optical depths in 32-bit floats, which light rays march exactly from slice to slice; the papers
//!   blend colours of 8 bits.
//! * The translucency of the papers, which blurs the light buffer, is not here: shadows are those of direct light.
//!
//! Building and drawing are one: the time of the slices is part of the time of the picture, and a list of points is
//! answered by a sweep of its own.

use super::filter::Taps;
use super::keys::{
    FILTER_KEY, FIT_KEY, Fit, LOOKUP_KEY, Lookups, MAP_KEY, MARCH_KEY, MarchBy, STEP_KEY, settings,
};
use super::lookup::Lookup;
use super::method::{BuildReport, Entry, Method, ShadowMap};
use super::sections::{SECTION, SECTION_BINDING, Section, SectionPass, Sections, Slices, TOWARDS_EYE};
use super::settings::{Key, Value, choices};
use super::style::{Marker, Style};
use super::{Filter, keys::Align};
use crate::error::Result;
use crate::field::{BuildContext, DEPTH_SINK, MapShape, TILE_TEXELS, TileMarch, field_shader};
use crate::gpu::{ShaderVariant, Slot, StorageBuffer};

choices! {
    /// Transmittance between two slices of half-angle slicing.
    pub enum BetweenSlices {
        /// Interpolates optical depth linearly between the two slices.
        Linear = "linear",
        /// Takes the optical depth at the slice in front.
        Constant = "constant",
    }
}

settings! {
    /// Settings of half-angle slicing.
    pub struct HalfAngle {
        /// Number of slabs into which slices cut the volume.
        slices: u32 = Key::whole([1, 1024], "64", "number of slabs of the volume, each with light buffers in front and behind")
            .in_label()
            .search(&["16", "32", "64", "128", "256"])
            .coarse("32"),
        /// Transmittance between two slices.
        between: BetweenSlices = Key::choice(
            BetweenSlices::NAMES,
            "linear",
            "optical depth between two slices: linear, or that at the slice in front",
        )
        .search_all(),
        /// Way in which light rays are marched: cell by cell with exact integrals, or by samples at regular distances.
        march: MarchBy = Key { when: super::settings::When::Always, ..MARCH_KEY },
        /// Distance between regular samples along a light ray, in units of the smallest voxel spacing.
        step: f64 = STEP_KEY,
        /// Number of texels of a light buffer per side; `None` if chosen from the scene.
        map: Option<u32> = MAP_KEY,
        /// Region that the light buffers cover: the bricks (blocks of voxels) with extinction that the camera sees, or all
        /// bricks with extinction.
        fit: Fit = FIT_KEY,
        /// Filter of the texels around a point.
        filter: Filter = FILTER_KEY,
        /// Whether neighbouring samples of a camera ray share one transmittance query, or each makes its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "halfangle",
    summary: "half-angle slicing: light buffers that are advanced slice by slice while the picture is drawn",
    keys: HalfAngle::KEYS,
    make: |values| Some(Box::new(HalfAngle::from_values(values)?)),
    // It refuses some scenes, so that tables have it by name only.
    compared: "",
    curve: "",
    stability: "",
    published: None,
    style: Style { color: [204, 102, 119], marker: Marker::Plus },
};

impl HalfAngle {
    fn shape(&self) -> MapShape {
        self.fit.shape(self.map, self.filter, self.march.with_step(self.step), 0.0)
    }

    /// Returns the shader of the pass that carries light from one slice to the next.
    fn advance_shader(&self) -> ShaderVariant {
        field_shader("shadow/halfangle/advance.wgsl")
            .with_tile_table()
            .modules(&["field/tiles.wgsl", SECTION])
            .with_march(self.shape().march, DEPTH_SINK)
    }

    fn lookup_in(&self, is_towards_eye: bool) -> Lookup {
        let shader = field_shader("").with_tile_table().with_filter(self.filter, 1, Align::Off);
        let constant = (self.between == BetweenSlices::Constant).then_some("CONSTANT");
        let shader = shader.modules(&[SECTION, "shadow/halfangle/lookup.wgsl"]).defs(constant);
        let order = is_towards_eye.then_some(TOWARDS_EYE);
        Lookup::new(shader.defs(order)).in_sections().with_lookup_mode(self.lookup)
    }
}

impl Method for HalfAngle {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn lookup(&self) -> Option<Lookup> {
        Some(self.lookup_in(false))
    }

    fn passes(&self) -> Vec<ShaderVariant> {
        vec![self.advance_shader()]
    }

    fn taps(&self) -> Taps {
        self.filter.taps(Taps::Within(1))
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let slices = Slices::of(context, self.slices)?;
        let tiles = TileMarch::fit(context, self.shape())?;
        let bytes = u64::from(tiles.records()) * 4;
        let buffer = || StorageBuffer::zeroed(context.gpu(), "light buffer", bytes);
        let buffers = [buffer()?, buffer()?];
        let variant = context.transfer.prepared(context.gpu(), self.advance_shader())?;
        let section = |(i, planes): (usize, wgpu::Buffer)| {
            let [front, behind] =
                [&buffers[i % 2], &buffers[(i + 1) % 2]].map(wgpu::Buffer::as_entire_binding);
            let front = || (3, Slot::read(front.clone()));
            let stage = [
                (1, Slot::read_write(behind.clone())),
                (SECTION_BINDING, Slot::read(planes.as_entire_binding())),
            ];
            let (stage, workgroups) = tiles.pass("light buffer", &stage);
            let groups = [tiles.group("light buffer", &[front()]), stage];
            let group = tiles.group("light buffers", &[front(), (4, Slot::read(behind))]);
            let advance = SectionPass { variant: variant.clone(), groups, workgroups };
            Section { group, advance, planes }
        };
        let list: Vec<Section> = slices.buffers(context)?.into_iter().enumerate().map(section).collect();
        let left_out = tiles.tiles - tiles.built;
        let memory = 2 * bytes + tiles.table_bytes();
        let report = BuildReport {
            bytes: memory,
            bytes_used: memory,
            tiles: tiles.tiles,
            tiles_left_out: left_out,
            bytes_left_out: 8 * u64::from(left_out * TILE_TEXELS),
            ..Default::default()
        };
        Ok(ShadowMap {
            method: ENTRY.name,
            group: tiles.group("light space", &[]),
            lookup: Some(self.lookup_in(slices.is_towards_eye)),
            light_space: tiles.light_space,
            report,
            bound: None,
            enclosure: None,
            sections: Some(Sections { view: context.view.copied(), list }),
            _pool: None,
        })
    }
}
