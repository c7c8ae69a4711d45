//! Shadow method `rays`: casts a shadow ray for each transmittance query.
//!
//! Estimators are random. `ratio` and `residual` are ratio tracking and residual ratio tracking (Novák, Selle and Jarosz
//! 2014) with the majorants of bricks. The control extinction of a brick is its least one: rays through empty parts of a
//! brick have no variance then. `jackknife` is the estimator of Peters 2025 with uniform strata, without its importance
//! sampling. `unbiased` is the power series of Kettunen, d'Eon, Pantaleoni and Novák 2021, up to order 16. Its samples are
//! equidistant in the integral of majorants instead of in depth, their number follows from that integral, and end points
//! are not matched. Abstracts of these papers were read; the estimators were derived again.

mod random;

use super::keys::{ESTIMATOR, LOOKUP_KEY, Lookups, MarchBy, STEP_KEY, settings};
use super::lookup::Lookup;
use super::method::{Curve, Entry, Method, ShadowMap};
use super::none::without_map;
use super::settings::{Key, Value, When, choices};
use super::style::{Marker, Style};
use super::tolerances::march_bound;
use crate::error::Result;
use crate::field::{BuildContext, field_shader};

choices! {
    /// Random estimator of the transmittance of a shadow ray.
    pub enum Estimator {
        /// Integrates the shadow ray without random numbers.
        Off = "off",
        /// Ratio tracking: random walks that collide with the largest extinction of each brick. Unbiased.
        Ratio = "ratio",
        /// Residual ratio tracking: random walks that collide with the extinction above the least one of each brick.
        /// Unbiased.
        Residual = "residual",
        /// Jackknife estimate from two stratified estimates of optical depth. Biased where these are not normally
        /// distributed.
        Jackknife = "jackknife",
        /// Power series in estimates of optical depth by ray marching. Unbiased.
        Unbiased = "unbiased",
    }
}

settings! {
    /// Settings of the shadow method `rays`. Each transmittance query marches a shadow ray with the code that builds shadow
    /// maps, or estimates its transmittance at random.
    ///
    /// Up to four segments of a camera ray share their queries (`shaders/render/raycast.wgsl`), as with every shadow
    /// method; `lookup=each` casts one shadow ray for each sample, as in the literature. Only rays that are marched cell by
    /// cell, without an estimator, have an error bound and serve as the reference of pictures.
    pub struct ShadowRays {
        /// Random estimator of the transmittance of a shadow ray.
        estimator: Estimator = Key::choice(
            Estimator::NAMES,
            "off",
            "random estimator: off, ratio tracking, residual ratio tracking, jackknife, or unbiased power series",
        ),
        /// Number of random walks (`ratio`, `residual`), or of samples of extinction in an estimate of optical depth
        /// (`jackknife`, `unbiased`).
        samples: u32 = Key::whole([1, 256], "8", "random walks (ratio, residual), or samples of an estimate of optical depth (jackknife, unbiased)")
            .when(When::Unless(ESTIMATOR, "off"))
            .in_label(),
        /// Seed of the random numbers.
        seed: u32 = Key::whole([0, u32::MAX], "1", "seed of the random numbers").when(When::Unless(ESTIMATOR, "off")),
        /// Way in which shadow rays are marched: cell by cell with exact integrals, or by samples at regular distances, as
        /// renderers usually do.
        march: MarchBy = Key::choice(
            MarchBy::NAMES,
            "cells",
            "march of shadow rays: cell by cell (exact), or by samples at regular steps",
        )
        .when(When::Is(ESTIMATOR, "off"))
        .search_all(),
        /// Distance between regular samples along a shadow ray, in units of the smallest voxel spacing. The first sample
        /// lies at the point.
        step: f64 = STEP_KEY.search(&["8", "4", "2", "1", "0.5"]),
        /// Whether neighbouring samples of a camera ray share one shadow ray, or each casts its own.
        lookup: Lookups = LOOKUP_KEY,
    }
}

pub(super) static ENTRY: Entry = Entry {
    name: "rays",
    summary: "shadow rays: slow, and close to exact if marched cell by cell",
    keys: ShadowRays::KEYS,
    make: |values| Some(Box::new(ShadowRays::from_values(values)?)),
    compared: "rays",
    curve: "",
    stability: "rays",
    published: None,
    style: Style { color: [204, 121, 167], marker: Marker::Star },
};

impl Method for ShadowRays {
    fn entry(&self) -> &'static Entry {
        &ENTRY
    }

    fn values(&self) -> Vec<Value> {
        self.to_values()
    }

    fn curve(&self) -> Curve {
        match self.estimator {
            Estimator::Off => Curve::Falls,
            Estimator::Ratio | Estimator::Residual => Curve::Stays,
            Estimator::Jackknife | Estimator::Unbiased => Curve::Rings,
        }
    }

    fn lookup(&self) -> Option<Lookup> {
        if self.estimator != Estimator::Off {
            return Some(self.random_lookup());
        }
        let shader = field_shader("").with_shadow_rays(self.march.with_step(self.step));
        Some(Lookup::new(shader.modules(&["shadow/rays/lookup.wgsl"])).with_lookup_mode(self.lookup))
    }

    fn build(&self, context: &BuildContext<'_>) -> Result<ShadowMap> {
        if self.estimator != Estimator::Off {
            return self.build_random(context);
        }
        let map = without_map(self, context, self.march.with_step(self.step));
        let bound = (self.march == MarchBy::Cells).then(|| march_bound(context, &map.light_space));
        Ok(ShadowMap { bound, ..map })
    }
}
