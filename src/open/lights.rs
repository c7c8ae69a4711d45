//! The lights of a scene as a user gives them: how many there may be, and how a scene file holds them.

use super::settings::SceneSettings;
use crate::error::{Error, Result};
use crate::scene::{LightSource, Scene};
use serde::{Serialize, Serializer};

impl SceneSettings {
    /// Refuses several lights, for what is a question about one.
    ///
    /// # Errors
    /// There is more than one.
    pub fn one_light(&self, command: &str) -> Result<()> {
        match self.light.as_ref().map_or(0, Vec::len) {
            0 | 1 => Ok(()),
            count => {
                let why = format!("there are {count}, and `{command}` is of one");
                Err(Error::input("too many lights", "--light", why))
            }
        }
    }

    /// The lights, where any is given.
    pub(super) fn lights(&self) -> Result<Option<Vec<LightSource>>> {
        let count = self.light.as_ref().map_or(0, Vec::len);
        if count > Scene::MOST_LIGHTS {
            let why = format!("there are {count}, and at most {} are drawn", Scene::MOST_LIGHTS);
            return Err(Error::input("too many lights", "--light", why));
        }
        Ok(self.light.clone().filter(|_| count > 0))
    }
}

/// One light is a text, as before there could be several; several are a list.
pub(super) fn one_or_list<S: Serializer>(
    lights: &Option<Vec<LightSource>>,
    serializer: S,
) -> std::result::Result<S::Ok, S::Error> {
    match lights.as_deref() {
        Some([one]) => one.serialize(serializer),
        lights => lights.serialize(serializer),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Light;
    use glam::DVec3;

    #[test]
    fn one_light_is_a_text_and_several_are_a_list() {
        let read = |text: &str| SceneSettings::from_toml(text).unwrap();
        let one = read("light = 'point:1,2,-3.5'");
        assert_eq!(one.to_toml().unwrap(), "light = \"point:1.0,2.0,-3.5\"\n");
        assert_eq!(read("light = ['point:1,2,-3.5']"), one);
        let two = read("light = ['point:1,2,-3.5', 'dir:0,0,1,color=#ff8000,intensity=0.30000000000000004']");
        assert_eq!(read(&two.to_toml().unwrap()), two, "to the last bit");
        let lights = two.lights().unwrap().unwrap();
        let place = Light::Directional { toward: DVec3::Z };
        assert_eq!((lights[1].light, lights[1].intensity), (place, 0.1 + 0.2));
        // Flags win over all of them.
        assert_eq!(one.over(&two).unwrap(), one);
        assert!(one.one_light("probe").is_ok() && two.one_light("probe").is_err());
        let many = SceneSettings { light: Some(vec![lights[0]; 17]), ..SceneSettings::default() };
        assert!(many.lights().unwrap_err().why.contains("17"));
    }
}
