//! Rendering session: a volume on the graphics device, with transfer-function tables and shadow maps that are reused
//! from one picture to the next.

use super::shadow_cache::{Building, MapCoverage, MapSource, ShadowCache, Work};
use crate::error::{Error, Result};
use crate::field::{DeferredPasses, LoadedVolume, PageStream, PageUsage};
use crate::render::{DeviceTransfer, DisabledOptimizations, Picture, Renderer};
use crate::scene::Scene;
use crate::shadow::{Method, ShadowMap, mapped_lights};
use crate::strands::VoxelisedStrands;
use crate::transfer::{TransferChange, TransferFunction};
use crate::volume::Volume;
use std::sync::Arc;

/// Rendering session on one graphics device: volume, transfer-function tables, and a cache of shadow maps.
pub struct CachedSession {
    /// Renderer of the session, which holds the graphics device and its compute pipelines.
    pub renderer: Arc<Renderer>,
    /// Volume on the graphics device; `None` before [`Self::load`].
    pub loaded: Option<LoadedVolume>,
    transfer: Option<(TransferFunction, DeviceTransfer)>,
    forced: DisabledOptimizations,
    shadows: ShadowCache,
}

/// Pages of a volume on the device, which change while a picture is drawn block by block.
pub struct DevicePages {
    usage: PageUsage,
    stream: Option<Arc<PageStream>>,
}

impl DevicePages {
    /// Returns which pages are resident now.
    pub fn resident(&self) -> ResidentPages {
        let Self { usage, stream } = self;
        let resident = stream.as_ref().map_or(usage.needed, |stream| stream.resident_pages());
        let blocks = stream.as_ref().map(|stream| stream.usage().blocks);
        ResidentPages { needed: usage.needed, resident, blocks }
    }
}

/// Numbers of pages of a volume on the device.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ResidentPages {
    /// Number of pages that the transfer function needs.
    pub needed: usize,
    /// Number of pages that are resident.
    pub resident: usize,
    /// Number of blocks of pages that became resident so far; `None` if all needed pages are resident.
    pub blocks: Option<u64>,
}

/// Intended duration of the submissions of [`Prepared::render_watched`], ms.
const WATCHED_SUBMISSION_MS: f64 = 200.0;

/// Everything on the device that a picture or a query for transmittance needs: volume, transfer-function tables, and
/// shadow maps of one method.
pub struct Prepared<'a> {
    /// Renderer with the graphics device and its compute pipelines.
    pub renderer: &'a Renderer,
    /// Volume on the graphics device.
    pub loaded: &'a LoadedVolume,
    /// Lookup tables of the transfer function on the graphics device.
    pub transfer: &'a DeviceTransfer,
    /// Shadow map (or other shadow data structure) of each light that is not black, in the order of the lights.
    pub shadows: Vec<&'a ShadowMap>,
}

impl Prepared<'_> {
    /// Renders a picture of a scene with the prepared shadow maps.
    ///
    /// # Errors
    /// See [`Renderer::render`].
    pub fn render(&self, scene: &Scene) -> Result<Picture> {
        self.renderer.render(self.loaded, self.transfer, self.shadows.clone(), scene)
    }

    /// Renders a picture like [`Self::render`], in several submissions if it has more than about 100,000 pixels. `watch`
    /// receives the share of the picture that is drawn, 0 to 1.
    ///
    /// # Errors
    /// See [`Renderer::render`].
    pub fn render_watched(&self, scene: &Scene, mut watch: impl FnMut(f32)) -> Result<Picture> {
        let go_on = |share| {
            watch(share);
            true
        };
        let (loaded, transfer, shadows) = (self.loaded, self.transfer, self.shadows.clone());
        let drawn =
            self.renderer.render_in_bands(loaded, transfer, shadows, scene, WATCHED_SUBMISSION_MS, go_on)?;
        drawn.ok_or_else(|| Error::runtime("cannot render", "picture", "it was left unfinished"))
    }
}

impl CachedSession {
    /// Creates a rendering session without a volume.
    pub fn new(renderer: Arc<Renderer>, forced: DisabledOptimizations, shadows: ShadowCache) -> Self {
        Self { renderer, loaded: None, transfer: None, forced, shadows }
    }

    /// Uploads a volume, and the strands that it was voxelised from, to the graphics device. On failure the previous
    /// volume stays.
    ///
    /// # Errors
    /// A volume that does not fit the memory or texture limits of the graphics adapter.
    pub fn load(&mut self, volume: Arc<Volume>, strands: Option<Arc<VoxelisedStrands>>) -> Result<()> {
        self.loaded = Some(self.renderer.load(volume)?.with_strands(strands));
        self.reset(self.forced);
        Ok(())
    }

    /// Removes the transfer-function tables and all shadow maps from the session. Later ones are made with the
    /// optimizations in `forced` disabled.
    pub fn reset(&mut self, forced: DisabledOptimizations) {
        self.forced = forced;
        self.transfer = None;
        self.shadows.clear();
    }

    /// Removes the volume, the transfer-function tables and all shadow maps from the session.
    pub fn unload(&mut self) {
        self.loaded = None;
        self.reset(self.forced);
    }

    /// Whether the loaded volume was voxelised from strands.
    pub fn has_strands(&self) -> bool {
        self.loaded.as_ref().is_some_and(|loaded| loaded.strands.is_some())
    }

    /// Volume and transfer-function tables, from which shadow maps are built; `None` before [`Self::set_transfer`].
    pub fn source(&self) -> Option<MapSource<'_>> {
        let (loaded, (_, transfer)) = self.loaded.as_ref().zip(self.transfer.as_ref())?;
        Some(MapSource { renderer: &self.renderer, loaded, transfer })
    }

    /// Whether the pages that the transfer function needs exceed the device memory, and pictures are drawn block by block.
    pub fn streams(&self) -> bool {
        self.transfer.as_ref().is_some_and(|(_, transfer)| transfer.stream().is_some())
    }

    /// Returns the pages of the volume on the device; `None` if it is one texture.
    pub fn pages(&self) -> Option<DevicePages> {
        let (_, transfer) = self.transfer.as_ref()?;
        Some(DevicePages { usage: transfer.pages?, stream: transfer.stream().cloned() })
    }

    /// Sets the session's transfer function, updates its lookup tables, and removes shadow maps that are no longer
    /// valid. Returns the effect of the edit on the volume.
    ///
    /// # Errors
    /// A transfer function that cannot be rendered, or a device out of memory. The previous tables stay.
    pub fn set_transfer(&mut self, tf: &TransferFunction, work: &mut Work) -> Result<TransferChange> {
        let Some(loaded) = &self.loaded else { return Ok(TransferChange::Nothing) };
        let change = match &self.transfer {
            Some((before, _)) if before == tf => return Ok(TransferChange::Nothing),
            Some((before, tables)) => {
                // Integrals are linear inside a table's bin: an edit affects values one bin away.
                let bin = tables.value_bin();
                let occurs =
                    |[low, high]: [f64; 2]| loaded.volume.bricks().have_values(low - bin, high + bin);
                TransferChange::between(before, tf, occurs)
            }
            None => TransferChange::Extinction,
        };
        let tables = match (&self.transfer, change) {
            // Keeps the old function: later edits are compared with the function of the tables.
            (_, TransferChange::Nothing) => None,
            (Some((_, before)), TransferChange::Color) => Some(self.renderer.recolor(loaded, before, tf)?),
            _ => Some(self.renderer.transfer(loaded, tf, self.forced)?),
        };
        let is_new_extinction = change == TransferChange::Extinction;
        if let Some(tables) = tables {
            work.table_ms = Some(tables.table_ms);
            work.classify_ms = is_new_extinction.then_some(tables.classify_ms);
            self.transfer = Some((tf.clone(), tables));
        }
        if is_new_extinction {
            self.shadows.clear();
        }
        Ok(change)
    }

    /// Number of shadow maps that [`Self::prepare`] would have to build for a picture of a scene, because the cache
    /// lacks them.
    pub fn missing(&self, method: &dyn Method, scene: &Scene) -> usize {
        let missing = |source| self.shadows.missing(source, method, scene);
        self.source().map_or_else(|| mapped_lights(method, scene).len(), missing)
    }

    /// Prepares a picture or a query for transmittance: builds the shadow maps that are not in the cache.
    ///
    /// # Errors
    /// A shadow map that the adapter cannot hold, or no volume or transfer function is set.
    pub fn prepare(
        &mut self,
        method: &dyn Method,
        extent: (&Scene, MapCoverage),
        work: &mut Work,
    ) -> Result<Prepared<'_>> {
        self.prepare_with(method, extent, work, Building::default())
    }

    /// Prepares a picture like [`Self::prepare`]. With `building.deferred`, build passes wait there for the submission
    /// of the picture ([`LightMaps::after`](crate::render::LightMaps::after)), and [`Self::complete`] has to follow.
    ///
    /// # Errors
    /// See [`Self::prepare`].
    pub fn prepare_with(
        &mut self,
        method: &dyn Method,
        extent: (&Scene, MapCoverage),
        work: &mut Work,
        building: Building<'_>,
    ) -> Result<Prepared<'_>> {
        let Self { renderer, loaded: Some(loaded), transfer: Some((_, transfer)), shadows, .. } = self else {
            return Err(Error::runtime("cannot draw", "renderer", "no volume is open"));
        };
        let source = MapSource { renderer, loaded, transfer };
        let shadows = shadows.prepare(source, method, extent, work, building)?;
        Ok(Prepared { renderer, loaded, transfer, shadows })
    }

    /// Completes the shadow maps whose passes were deferred, once the picture is drawn. Returns `false` if one of them
    /// is incomplete: the picture is invalid, and has to be prepared and drawn again.
    ///
    /// # Errors
    /// The device could not build a map.
    pub fn complete(
        &mut self,
        method: &dyn Method,
        deferred: DeferredPasses,
        work: &mut Work,
    ) -> Result<bool> {
        let Self { renderer, loaded: Some(loaded), transfer: Some((_, transfer)), shadows, .. } = self else {
            return Ok(false);
        };
        shadows.complete(MapSource { renderer, loaded, transfer }, method, deferred, work)
    }
}
