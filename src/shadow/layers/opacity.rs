//! `osm`: opacity shadow maps.
//!
//! Kim and Neumann 2001, *Opacity Shadow Maps*. Symbols: `D_i` (`1 <= i <= N`) the depth of the i-th map, `D_0` the
//! least depth of the volume, `Ω` the opacity thickness stored at a texel of a map, `κ` the scale of stored
//! opacities with `exp(-κ) = 2^-d` for `d` bits. `T = exp(-κ Ω)`, `Ω` linear between `D_(i-1)` and `D_i`.
//!
//! Deviations from the paper, and why:
//! * A map's planes are spheres around a point light: depth is distance along the light ray, as for every method
//!   here.
//! * All maps are made in one pass by marching each texel's ray, not by drawing primitives once a map.
//! * `slicing=density` is the paper's 1-D BSP carried to its end: planes at equal shares of the optical mass by
//!   depth, weighed over 128 x 128 rays in 1024 bins, from the first bin in which one of them meets any: what is in
//!   front of it and narrower than their spacing casts no shadow there. `slicing=gamma` puts plane `i` at the share `(i / N)^2.2`.
//! * Maps are stored together, since a ray caster asks for depths in any order; the paper keeps two at a time.
//! * 8 bits are the paper's; 16-bit and 32-bit floats hold the optical depth itself.

use super::super::spec::Setting;
use super::super::{BuildContext, Entry, Filter, Key, LightSpace, Method, ShadowMap};
use super::keys::{self, Given};
use super::record::Record;
use super::split::{SPLIT_BINS, Split, SplitTable};
use super::{Pass, PassLeftOut, Recipe, march_variant};
use crate::error::Result;
use crate::gpu::{Span, StorageBuffer, read_back, uniform_buffer};
use std::time::Instant;

const LOOKUP: &[&str] = &["shadow/layers_layout.wgsl", "shadow/layers_read.wgsl", "shadow/opacity.wgsl"];
/// Exponent of `slicing=gamma`.
const GAMMA: f64 = 2.2;
/// Workgroups a side of the weighing pass: 128 rays, 8 a workgroup.
const MASS_GROUPS: u32 = 16;

/// Where the planes lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Slicing {
    Uniform,
    Density,
    Gamma,
}

/// Settings of an opacity shadow map.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct OpacityShadowMap {
    /// Maps, `N` of the paper: 1 to 512.
    pub layers: u32,
    pub slicing: Slicing,
    /// Texels a side that a lookup averages: 1 or 3.
    pub kernel: u32,
    /// Bits of a stored optical depth: 8, 16 or 32.
    pub bits: u32,
    /// Texels a side.
    pub map: u32,
    pub filter: Filter,
}

impl Default for OpacityShadowMap {
    fn default() -> Self {
        Self {
            layers: 32,
            slicing: Slicing::Uniform,
            kernel: 1,
            bits: 16,
            map: 512,
            filter: Filter::Bilinear,
        }
    }
}

pub(in super::super) static ENTRY: Entry = Entry {
    name: "osm",
    summary: "opacity shadow maps (Kim and Neumann 2001): planes across the light",
    keys: &[
        Key { name: "layers", values: "1..512", default: "32", help: "planes" },
        Key {
            name: "slicing",
            values: "uniform|density|gamma",
            default: "uniform",
            help: "planes evenly spaced, at equal shares of optical mass, or further apart behind",
        },
        Key { name: "kernel", values: "1|3", default: "1", help: "texels a side that are averaged" },
        keys::BITS,
        keys::MAP,
        keys::FILTER,
    ],
    parse: |setting| Ok(Box::new(OpacityShadowMap::from_setting(setting)?)),
};

const SLICINGS: [(&str, Slicing); 3] =
    [("uniform", Slicing::Uniform), ("density", Slicing::Density), ("gamma", Slicing::Gamma)];

impl OpacityShadowMap {
    fn from_setting(setting: &Setting) -> Result<Self> {
        let mut s = Self::default();
        for (key, value) in &setting.params {
            let given = Given { entry: &ENTRY, key, value };
            match key.as_str() {
                "layers" => s.layers = given.layers()?,
                "slicing" => s.slicing = given.one_of(&SLICINGS)?,
                "kernel" => s.kernel = given.one_of(&[("1", 1), ("3", 3)])?,
                "bits" => s.bits = given.bits()?,
                "map" => s.map = given.map()?,
                "filter" => s.filter = given.filter()?,
                _ => return Err(given.refuse()),
            }
        }
        Ok(s)
    }

    /// The split, and the time it took to weigh the volume where that was needed.
    fn split(
        &self,
        context: &BuildContext<'_>,
        light_space: &LightSpace,
        recipe: &Recipe,
    ) -> Result<(Split, Option<Span>)> {
        match self.slicing {
            Slicing::Uniform => Ok((Split::Power(1.0), None)),
            Slicing::Gamma => Ok((Split::Power(GAMMA), None)),
            // A single plane lies at the far end whatever lies before it.
            Slicing::Density if self.layers == 1 => Ok((Split::Power(1.0), None)),
            Slicing::Density => {
                let (mass, span) = weigh(context, light_space, recipe)?;
                Ok((Split::Tables(vec![SplitTable::of_mass(&mass)]), Some(span)))
            }
        }
    }
}

/// Optical mass by depth, in fixed point.
fn weigh(context: &BuildContext<'_>, light_space: &LightSpace, recipe: &Recipe) -> Result<(Vec<u32>, Span)> {
    let gpu = context.renderer.gpu();
    let uniform = uniform_buffer(gpu, "light space", &recipe.uniform(light_space));
    let mass = StorageBuffer::zeroed(gpu, "optical mass", 4 * SPLIT_BINS as u64)?;
    let unused = super::super::plain::unused_texture(gpu)?;
    let list = StorageBuffer::zeroed(gpu, "unused", 16)?;
    let pass = Pass { store: None, first: &unused, second: &unused, stage: &mass };
    let variant = march_variant(context, "shadow/layers_mass.wgsl", &["shadow/mass_sink.wgsl"], Vec::new())?;
    let span =
        pass.run(context, "optical mass", &variant, &uniform, [MASS_GROUPS; 2], list.as_entire_binding())?;
    Ok((read_back::<u32>(gpu, &mass, SPLIT_BINS)?, span))
}

impl Method for OpacityShadowMap {
    fn name(&self) -> &'static str {
        ENTRY.name
    }

    fn params(&self) -> String {
        let standard = Self::default();
        let slicing = SLICINGS.iter().find(|(_, s)| *s == self.slicing).map_or("", |(name, _)| name);
        keys::params(
            self.layers,
            &[
                ("slicing", slicing.into(), self.slicing != standard.slicing),
                ("kernel", self.kernel.to_string(), self.kernel != standard.kernel),
                ("bits", self.bits.to_string(), self.bits != standard.bits),
                ("filter", "nearest".into(), self.filter != standard.filter),
            ],
        )
    }

    fn map_size(&self) -> Option<u32> {
        Some(self.map)
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        let start = Instant::now();
        let light_space = LightSpace::fit(context.volume, &context.transfer.active, context.light, self.map);
        let [near, far] = light_space.z_range;
        let mut recipe = Recipe {
            record: Record {
                layers: self.layers,
                bits: self.bits,
                depths: 0,
                depth_bits: 0,
                own_split: false,
            },
            split: Split::Power(1.0),
            reach_mm: far - near,
            last_takes_rest: true,
            split_choice: 0,
            filter: self.filter,
            kernel: self.kernel,
        };
        let host_ms = start.elapsed().as_secs_f64() * 1e3;
        let (split, weighing) = self.split(context, &light_space, &recipe)?;
        recipe.split = split;
        let mut built = recipe.build(context, light_space, None)?;
        built.report.host_ms += host_ms;
        built.report.device = match (built.report.device, weighing) {
            (Some(device), Some(before)) => Some(before.plus(device)),
            (device, _) => device,
        };
        if self.slicing == Slicing::Density && weighing.is_none() {
            built.report.passes_left_out = &[PassLeftOut {
                what: "weighing the volume",
                why: "a single plane lies at its far side",
                optional: None,
            }];
        }
        Ok(built.behind(context, LOOKUP, recipe.read_defs()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::super::parse_list;

    #[test]
    fn every_key_is_read_and_shown() {
        let shown = |text: &str| parse_list(text).unwrap().iter().map(|m| m.params()).collect::<Vec<_>>();
        assert_eq!(shown("osm"), ["layers=32"]);
        assert_eq!(
            shown("osm:layers=8,512,slicing=density,gamma"),
            [
                "layers=8 slicing=density",
                "layers=8 slicing=gamma",
                "layers=512 slicing=density",
                "layers=512 slicing=gamma",
            ]
        );
        assert_eq!(
            shown("osm:kernel=3,bits=8,filter=nearest,map=64"),
            ["layers=32 kernel=3 bits=8 filter=nearest"]
        );
        assert_eq!(parse_list("osm:map=64").unwrap()[0].map_size(), Some(64));
    }

    #[test]
    fn what_is_out_of_range_is_refused_by_name() {
        for (text, why) in [
            ("osm:layers=0", "osm:layers=0): expected 1..512"),
            ("osm:layers=513", "expected 1..512"),
            ("osm:layers=2.5", "expected 1..512"),
            ("osm:slicing=bsp", "expected uniform|density|gamma"),
            ("osm:kernel=2", "expected 1|3"),
            ("osm:bits=24", "expected 8|16|32"),
            ("osm:map=0", "expected 1..8192"),
            ("osm:filter=linear", "expected nearest|bilinear"),
            ("osm:epsilon=0.1", "there is: layers, slicing, kernel, bits, map, filter"),
        ] {
            let error = parse_list(text).unwrap_err();
            assert!(error.to_string().contains(why), "{error}");
            assert_eq!(error.exit_status(), 2);
        }
    }
}
