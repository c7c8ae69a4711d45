//! Checks of the lights and of the shading in a scene's settings.

use super::SceneSettings;
use crate::error::{Error, Result};
use crate::scene::{LightSource, Scene, Shading};
use clap::ValueEnum as _;

impl SceneSettings {
    /// Sets the shading model to a phase function if only that is given. It is called for each layer of settings, so that a
    /// flag wins over either key of a scene file.
    ///
    /// # Errors
    /// Both a phase function and another shading model are given.
    pub(super) fn with_phase_function(mut self) -> Result<Self> {
        match (self.shading, self.phase) {
            (None, Some(_)) => self.shading = Some(Shading::Phase),
            (Some(shading), Some(_)) if shading != Shading::Phase => {
                let name = shading.to_possible_value().map_or(String::new(), |value| value.get_name().into());
                let why = format!("a phase function scatters light, and --shading {name} shades otherwise");
                return Err(Error::input("cannot use phase function", "--phase", why));
            }
            _ => {}
        }
        Ok(self)
    }

    /// Returns an error if the scene has more lights than the renderer supports.
    pub(super) fn check_lights(&self) -> Result<()> {
        self.check_light_count(Scene::MOST_LIGHTS, &format!("at most {} are drawn", Scene::MOST_LIGHTS))?;
        let most = Scene::MOST_SHADOW_MAPS;
        match self.light.iter().flatten().filter(|l| l.shines()).map(LightSource::sample_count).sum::<usize>()
        {
            count if count > most => {
                let why = format!("they have {count} samples together, and at most {most} are drawn");
                Err(Error::input("too many lights", "--light", why).hint("give fewer samples=N"))
            }
            _ => Ok(()),
        }
    }

    /// Returns an error if the scene has ambient occlusion and opaque objects.
    pub(super) fn check_occlusion(&self) -> Result<()> {
        match self.ambient_occlusion.is_some()
            && (self.opaque.mesh.is_some() || self.opaque.strands.is_some())
        {
            true => {
                let why = "the occlusion by opaque objects (--mesh, --strands) is not computed";
                Err(Error::input("cannot occlude ambient light", "--ambient-occlusion", why))
            }
            false => Ok(()),
        }
    }

    /// Returns an error if the scene has ambient occlusion, for a command that does not support it.
    ///
    /// # Errors
    /// The scene has ambient occlusion.
    pub fn open_ambient(&self, command: &str) -> Result<()> {
        match self.ambient_occlusion {
            Some(_) => {
                let why = format!("`{command}` has no ambient occlusion");
                Err(Error::input("bad scene", "--ambient-occlusion", why))
            }
            None => Ok(()),
        }
    }

    /// Returns an error if the scene has several lights, for a command that supports only one light.
    ///
    /// # Errors
    /// The scene has more than one light.
    pub fn one_light(&self, command: &str) -> Result<()> {
        self.check_light_count(1, &format!("`{command}` takes one"))
    }

    /// Returns an error if a light of the scene has a size, for a command that supports only lights without one.
    ///
    /// # Errors
    /// A light of the scene has a size.
    pub fn hard_lights(&self, command: &str) -> Result<()> {
        match self.light.iter().flatten().find(|source| source.is_soft()) {
            Some(source) => {
                let why = format!("`{command}` takes lights without a size (dir:x,y,z or point:x,y,z)");
                Err(Error::input("bad light", source.text(), why))
            }
            None => Ok(()),
        }
    }

    fn check_light_count(&self, most: usize, why: &str) -> Result<()> {
        match self.light.iter().flatten().count() {
            count if count > most => {
                Err(Error::input("too many lights", "--light", format!("there are {count}, and {why}")))
            }
            _ => Ok(()),
        }
    }
}
