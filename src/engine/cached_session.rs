//! Volume on a device, with tables and shadow maps that are reused from one picture to the next.

use super::invalidation::{Change, Stage};
use super::shadow_cache::{MapCoverage, MapSource, ShadowCache, Work};
use crate::error::{Error, Result};
use crate::field::LoadedVolume;
use crate::render::{DeviceTransfer, DisabledOptimizations, Picture, Renderer};
use crate::scene::Scene;
use crate::shadow::{Method, ShadowMap};
use crate::strands::VoxelisedStrands;
use crate::transfer::TransferFunction;
use crate::volume::Volume;
use std::sync::Arc;

/// Volume, tables and cached shadow maps on one device.
pub struct CachedSession {
    /// Device and pipelines.
    pub renderer: Arc<Renderer>,
    /// Volume; `None` before [`Self::load`].
    pub loaded: Option<LoadedVolume>,
    transfer: Option<(TransferFunction, DeviceTransfer)>,
    forced: DisabledOptimizations,
    shadows: ShadowCache,
}

/// Inputs of a picture or a query with one method.
pub struct Prepared<'a> {
    /// Device and pipelines.
    pub renderer: &'a Renderer,
    /// Volume.
    pub loaded: &'a LoadedVolume,
    /// Tables of the transfer function.
    pub transfer: &'a DeviceTransfer,
    /// Shadow structure of each light that shines, in their order.
    pub shadows: Vec<&'a ShadowMap>,
}

impl Prepared<'_> {
    /// Renders a picture.
    ///
    /// # Errors
    /// See [`Renderer::render`].
    pub fn render(&self, scene: &Scene) -> Result<Picture> {
        self.renderer.render(self.loaded, self.transfer, self.shadows.clone(), scene)
    }
}

impl CachedSession {
    /// Creates a session without a volume.
    pub fn new(renderer: Arc<Renderer>, forced: DisabledOptimizations, shadows: ShadowCache) -> Self {
        Self { renderer, loaded: None, transfer: None, forced, shadows }
    }

    /// Uploads a volume and the strands that it was made from. On failure the previous volume stays.
    ///
    /// # Errors
    /// A volume that the adapter cannot hold.
    pub fn load(&mut self, volume: Arc<Volume>, strands: Option<Arc<VoxelisedStrands>>) -> Result<()> {
        self.loaded = Some(self.renderer.load(volume)?.with_strands(strands));
        self.reset(self.forced);
        Ok(())
    }

    /// Removes tables and maps; new tables use `forced`.
    pub fn reset(&mut self, forced: DisabledOptimizations) {
        self.forced = forced;
        self.transfer = None;
        self.shadows.clear();
    }

    /// Removes the volume, tables and maps.
    pub fn unload(&mut self) {
        self.loaded = None;
        self.reset(self.forced);
    }

    /// Whether the volume was made from strands.
    pub fn has_strands(&self) -> bool {
        self.loaded.as_ref().is_some_and(|loaded| loaded.strands.is_some())
    }

    /// Volume and tables; `None` before [`Self::set_transfer`].
    pub fn source(&self) -> Option<MapSource<'_>> {
        let (loaded, (_, transfer)) = self.loaded.as_ref().zip(self.transfer.as_ref())?;
        Some(MapSource { renderer: &self.renderer, loaded, transfer })
    }

    /// Makes the tables of `tf` as far as they differ; `None` where nothing changed.
    ///
    /// # Errors
    /// A function that cannot be drawn, or a device out of memory. The previous tables stay.
    pub fn set_transfer(&mut self, tf: &TransferFunction, work: &mut Work) -> Result<Option<Change>> {
        let Some(loaded) = &self.loaded else { return Ok(None) };
        let change = match &self.transfer {
            Some((before, _)) if before == tf => return Ok(None),
            Some((before, tables)) => Change::between_functions((before, tables), tf, loaded),
            None => Change::Opacity,
        };
        let tables = match &self.transfer {
            Some((_, before)) if change.invalidates(Stage::Colors) => {
                Some(self.renderer.recolor(loaded, before, tf)?)
            }
            _ if change.invalidates(Stage::Tables) => {
                Some(self.renderer.transfer(loaded, tf, self.forced)?)
            }
            // Later edits are compared with the function that the tables are for.
            _ => None,
        };
        if let Some(tables) = tables {
            work.table_ms = Some(tables.table_ms);
            work.classify_ms = change.invalidates(Stage::Tables).then_some(tables.classify_ms);
            self.transfer = Some((tf.clone(), tables));
        }
        if change.invalidates(Stage::Shadows) {
            self.shadows.clear();
        }
        Ok(Some(change))
    }

    /// Number of structures that [`Self::prepare`] would build for the picture of a scene.
    pub fn missing(&self, method: &dyn Method, scene: &Scene) -> usize {
        let missing = |source| self.shadows.missing(source, method, scene);
        self.source().map_or(scene.shining().len(), missing)
    }

    /// [`Change::View`] where maps of the method exist, but none covers the picture.
    pub fn change_of_view(&self, method: &dyn Method, scene: &Scene) -> Option<Change> {
        let is_outgrown = self.shadows.is_outgrown(self.source()?, method, scene);
        is_outgrown.then_some(Change::View)
    }

    /// Prepares a picture or a query: missing shadow structures are built.
    ///
    /// # Errors
    /// A structure that the adapter cannot hold, or no volume or tables.
    pub fn prepare(
        &mut self,
        method: &dyn Method,
        extent: (&Scene, MapCoverage),
        work: &mut Work,
    ) -> Result<Prepared<'_>> {
        let Self { renderer, loaded: Some(loaded), transfer: Some((_, transfer)), shadows, .. } = self else {
            return Err(Error::runtime("cannot draw", "renderer", "no volume is open"));
        };
        let source = MapSource { renderer, loaded, transfer };
        let shadows = shadows.prepare(source, method, extent, work)?;
        Ok(Prepared { renderer, loaded, transfer, shadows })
    }
}
