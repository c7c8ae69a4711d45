//! The open volume on the device, with tables and shadow maps that are kept from one picture to the next.

use crate::engine::method_choice::MethodChoice;
use crate::engine::reading::Opened;
use crate::engine::{Change, MapCoverage, ShadowCache, Work};
use crate::error::{Error, Result};
use crate::gpu::Gpu;
use crate::render::{DeviceTransfer, LoadedVolume, Renderer};
use crate::scene::Scene;
use crate::shadow::ShadowMap;
use crate::transfer::TransferFunction;
use std::sync::Arc;

/// What the render thread draws from.
pub struct OnDevice {
    pub renderer: Renderer,
    pub loaded: Option<LoadedVolume>,
    kept: ShadowCache,
}

/// What a picture, or a query, of one method reads.
pub struct Prepared<'a> {
    pub renderer: &'a Renderer,
    pub loaded: &'a LoadedVolume,
    pub transfer: &'a DeviceTransfer,
    /// Of each light that shines, in their order.
    pub shadows: Vec<&'a ShadowMap>,
    pub spec: String,
}

impl OnDevice {
    /// No volume; a submission keeps the queue no longer than about `submission_ms`.
    pub fn new(gpu: Gpu, submission_ms: f64) -> Self {
        Self { renderer: Renderer::live(gpu, submission_ms), loaded: None, kept: ShadowCache::default() }
    }

    /// Lets go of everything that may be half made.
    pub fn forget(&mut self) {
        self.loaded = None;
        self.kept = ShadowCache::default();
    }

    /// Takes a volume onto the device; where that fails the old one stays.
    pub fn load(&mut self, opened: &Opened) -> Result<()> {
        let loaded = self.renderer.load(Arc::clone(&opened.volume))?;
        self.loaded = Some(loaded.with_strands(opened.strands.clone()));
        self.kept = ShadowCache::default();
        Ok(())
    }

    /// Whether the volume was made from strands.
    pub fn is_of_strands(&self) -> bool {
        self.loaded.as_ref().is_some_and(|loaded| loaded.strands.is_some())
    }

    /// Makes the tables of `tf`, as far as it differs from the function before: what of it reaches pictures.
    pub fn set_transfer(&mut self, tf: &TransferFunction, work: &mut Work) -> Result<Option<Change>> {
        let Some(loaded) = &self.loaded else { return Ok(None) };
        self.kept.set_transfer(&self.renderer, loaded, tf, work)
    }

    /// How many structures [`Self::prepare`] would build for the picture of a scene.
    pub fn missing(&self, choice: &MethodChoice, scene: &Scene) -> usize {
        let missing = |loaded| self.kept.missing(loaded, &choice.spec(), scene);
        self.loaded.as_ref().map_or(scene.lights.len(), missing)
    }

    /// Builds the shadow structures of a method for the picture of a scene, or for every point under its lights, unless they
    /// are kept.
    ///
    /// # Errors
    /// Settings out of range, a structure that the adapter cannot hold, or no volume or tables to make it of.
    pub fn prepare(
        &mut self,
        choice: &MethodChoice,
        asked: (&Scene, MapCoverage),
        work: &mut Work,
    ) -> Result<Prepared<'_>> {
        let nothing = || Error::runtime("cannot draw", "render thread", "no volume is open");
        let loaded = self.loaded.as_ref().ok_or_else(nothing)?;
        let (spec, method) = (choice.spec(), choice.method()?);
        self.kept.prepare(&self.renderer, loaded, (&spec, method.as_ref()), asked, work)?;
        let transfer = self.kept.transfer().ok_or_else(nothing)?;
        let shadows = self.kept.shadows(&spec, asked.0).ok_or_else(nothing)?;
        Ok(Prepared { renderer: &self.renderer, loaded, transfer, shadows, spec })
    }
}
