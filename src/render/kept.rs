//! What stays between the pictures of a session that a person works in: tables and shadow maps are made anew only by a
//! change that reaches them.

use super::{DeviceTransfer, LoadedVolume, Renderer, needs_shadows};
use crate::error::Result;
use crate::scene::{Light, Scene};
use crate::shadow::{Method, NoShadows, ShadowMap};
use crate::transfer::{ControlPoint, TransferFunction};

/// What one transfer function changes of another, on a volume.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Change {
    /// No value that the volume has is given anything else.
    Nothing,
    /// Colours alone: shadows stay.
    Colors,
    /// Extinction: tables, bricks and shadow maps.
    Extinction,
}

impl Change {
    /// From one function to another over the values `[lo, hi]`.
    pub fn between(from: &TransferFunction, to: &TransferFunction, [lo, hi]: [f64; 2]) -> Self {
        let seen = |tf: &TransferFunction| {
            let end = |value: f64| ControlPoint { value, amount: tf.amount(value), color: tf.color(value) };
            let inside = tf.points.iter().filter(|p| p.value >= lo && p.value <= hi).copied();
            [end(lo), end(hi)].into_iter().chain(inside).collect::<Vec<_>>()
        };
        let (a, b) = (seen(from), seen(to));
        let same_scale = from.quantity == to.quantity && from.reference_length_mm == to.reference_length_mm;
        let same_amounts =
            a.len() == b.len() && a.iter().zip(&b).all(|(a, b)| a.value == b.value && a.amount == b.amount);
        match same_scale && same_amounts {
            false => Self::Extinction,
            true if a == b => Self::Nothing,
            true => Self::Colors,
        }
    }
}

/// What a picture's preparation cost, each `None` where nothing had to be done.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Work {
    pub table_ms: Option<f64>,
    pub classify_ms: Option<f64>,
    pub build_ms: Option<f64>,
}

/// Which map is meant.
#[derive(Debug, Clone, PartialEq)]
struct MapKey {
    /// The method as written, with every setting.
    method: String,
    light: Light,
    /// Which extinction it was built from.
    extinction: u64,
}

/// Shadow maps that are kept at once: two methods side by side, each coarse and whole.
const MOST_MAPS: usize = 4;

/// Tables and shadow maps of one volume.
#[derive(Default)]
pub struct Kept {
    transfer: Option<(TransferFunction, DeviceTransfer)>,
    /// Rises with every change of extinction.
    extinction: u64,
    /// The most lately used is last.
    maps: Vec<(MapKey, ShadowMap)>,
}

impl Kept {
    /// Makes the tables of `tf`, as far as it differs from the function before.
    ///
    /// # Errors
    /// A function that cannot be drawn, or a device out of memory; what was kept before stays.
    pub fn set_transfer(
        &mut self,
        renderer: &Renderer,
        loaded: &LoadedVolume,
        tf: &TransferFunction,
        work: &mut Work,
    ) -> Result<Change> {
        let change = self.transfer.as_ref().map_or(Change::Extinction, |(before, _)| {
            Change::between(before, tf, loaded.volume.value_range())
        });
        if change == Change::Nothing {
            return Ok(change);
        }
        let made = renderer.transfer(loaded, tf)?;
        work.table_ms = Some(made.table_ms);
        work.classify_ms = Some(made.classify_ms);
        self.transfer = Some((tf.clone(), made));
        if change == Change::Extinction {
            self.extinction += 1;
            let now = self.extinction;
            self.maps.retain(|(key, _)| key.extinction == now);
        }
        Ok(change)
    }

    /// The tables; `None` before the first [`Self::set_transfer`].
    pub fn transfer(&self) -> Option<&DeviceTransfer> {
        self.transfer.as_ref().map(|(_, made)| made)
    }

    /// Whether [`Self::shadow`] would have to build.
    pub fn has(&self, spec: &str, light: Light) -> bool {
        self.maps.iter().any(|(key, _)| *key == self.key(spec, light))
    }

    fn key(&self, spec: &str, light: Light) -> MapKey {
        MapKey { method: spec.into(), light, extinction: self.extinction }
    }

    /// Builds the shadow structure of a method, which `spec` names, unless it is kept; no map at all where no light can
    /// be kept from a sample.
    ///
    /// # Errors
    /// A structure that the adapter cannot hold.
    pub fn prepare(
        &mut self,
        renderer: &Renderer,
        loaded: &LoadedVolume,
        (spec, method): (&str, &dyn Method),
        scene: &Scene,
        work: &mut Work,
    ) -> Result<()> {
        let key = self.key(spec, scene.light);
        let Some((_, transfer)) = &self.transfer else { return Ok(()) };
        if let Some(found) = self.maps.iter().position(|(k, _)| *k == key) {
            let found = self.maps.remove(found);
            self.maps.push(found);
            return Ok(());
        }
        let needed = needs_shadows(scene, transfer).is_ok();
        let method = if needed { method } else { &NoShadows };
        // A map that no shadows were needed for must not stand for the method's own later on.
        let key = if needed { key } else { MapKey { method: unneeded(spec), ..key } };
        let map = renderer.shadow(loaded, transfer, method, scene.light)?;
        *work.build_ms.get_or_insert(0.0) += map.report.build_ms();
        self.maps.retain(|(k, _)| *k != key);
        self.maps.push((key, map));
        if self.maps.len() > MOST_MAPS {
            self.maps.remove(0);
        }
        Ok(())
    }

    /// What [`Self::prepare`] has made for these.
    pub fn shadow(&self, spec: &str, light: Light) -> Option<&ShadowMap> {
        let keys = [self.key(spec, light), self.key(&unneeded(spec), light)];
        keys.iter().find_map(|wanted| self.maps.iter().find(|(key, _)| key == wanted).map(|(_, map)| map))
    }
}

fn unneeded(spec: &str) -> String {
    format!("{spec}, unneeded")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::transfer::Quantity;

    fn tf(points: &[(f64, f64, f64)]) -> TransferFunction {
        let point =
            |&(value, amount, red): &(f64, f64, f64)| ControlPoint { value, amount, color: [red, 0.0, 0.0] };
        TransferFunction {
            name: String::new(),
            units: String::new(),
            reference_length_mm: 1.0,
            quantity: Quantity::Opacity,
            points: points.iter().map(point).collect(),
        }
    }

    #[test]
    fn a_change_is_what_the_volume_can_see_of_it() {
        let before = tf(&[(0.0, 0.0, 0.5), (100.0, 0.5, 0.5), (200.0, 0.5, 1.0)]);
        let change = |after: &[(f64, f64, f64)], range| Change::between(&before, &tf(after), range);
        let all = [-10.0, 300.0];
        assert_eq!(change(&[(0.0, 0.0, 0.5), (100.0, 0.5, 0.5), (200.0, 0.5, 1.0)], all), Change::Nothing);
        assert_eq!(change(&[(0.0, 0.0, 0.5), (100.0, 0.5, 0.6), (200.0, 0.5, 1.0)], all), Change::Colors);
        assert_eq!(change(&[(0.0, 0.0, 0.5), (100.0, 0.4, 0.5), (200.0, 0.5, 1.0)], all), Change::Extinction);
        // Beyond the largest value nothing can be seen, at it something can.
        let moved = [(0.0, 0.0, 0.5), (100.0, 0.5, 0.5), (200.0, 0.9, 1.0)];
        assert_eq!(change(&moved, [-10.0, 100.0]), Change::Nothing);
        assert_eq!(change(&moved, [-10.0, 101.0]), Change::Extinction);
        // A jump exactly at the largest value.
        let jump = [(0.0, 0.0, 0.5), (100.0, 0.5, 0.5), (100.0, 0.7, 0.5), (200.0, 0.5, 1.0)];
        assert_eq!(change(&jump, [-10.0, 100.0]), Change::Extinction);
        let mut longer = before.clone();
        longer.reference_length_mm = 2.0;
        assert_eq!(Change::between(&before, &longer, all), Change::Extinction);
    }
}
