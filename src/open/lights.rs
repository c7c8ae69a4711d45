//! The lights of a scene as a user gives them: how many there may be, and how a scene file holds them.

use crate::error::{Error, Result};
use crate::scene::{LightSource, Scene};
use serde::{Serialize, Serializer};

/// Refuses several lights, for what is a question about one.
pub(super) fn only_one(lights: Option<&[LightSource]>, command: &str) -> Result<()> {
    match lights.map_or(0, <[_]>::len) {
        0 | 1 => Ok(()),
        count => {
            let why = format!("there are {count}, and `{command}` is of one");
            Err(Error::input("too many lights", "--light", why))
        }
    }
}

/// The lights, where any is given; no more than can be drawn.
pub(super) fn checked(lights: Option<&[LightSource]>) -> Result<Option<Vec<LightSource>>> {
    let lights = lights.unwrap_or_default();
    if lights.len() > Scene::MOST_LIGHTS {
        let why = format!("there are {}, and at most {} are drawn", lights.len(), Scene::MOST_LIGHTS);
        return Err(Error::input("too many lights", "--light", why));
    }
    Ok((!lights.is_empty()).then(|| lights.to_vec()))
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
    use super::super::SceneSettings;
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
        let lights = two.light.clone().unwrap();
        let place = Light::Directional { toward: DVec3::Z };
        assert_eq!((lights[1].light, lights[1].intensity), (place, 0.1 + 0.2));
        // Flags win over all of them.
        assert_eq!(one.over(&two).unwrap(), one);
        assert!(one.one_light("probe").is_ok() && two.one_light("probe").is_err());
        assert!(checked(Some(&[lights[0]; 17])).unwrap_err().why.contains("17"));
        assert_eq!(checked(Some(&[lights[0]; 16])).unwrap().unwrap().len(), 16);
        assert_eq!(checked(Some(&[])).unwrap(), None);
    }
}
