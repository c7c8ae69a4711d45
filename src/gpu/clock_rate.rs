//! Clock rate of a graphics card, as the operating system reports it. Idle cards lower their clocks, so that a time
//! without the rate says little.

use std::path::{Path, PathBuf};
use std::process::Command;

/// PCI vendor number of NVIDIA.
const NVIDIA: u32 = 0x10de;

/// Source of the clock rate of a graphics card.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum ClockRate {
    /// NVIDIA's program `nvidia-smi`, with the PCI address of the card.
    NvidiaSmi {
        /// PCI address of the card, such as `0000:01:00.0`.
        address: String,
    },
    /// File of Linux's `amdgpu` driver: one line for each rate, and an asterisk behind the present one.
    Levels(PathBuf),
    /// File of Linux's `i915` or `xe` driver with the present rate in MHz.
    Rate(PathBuf),
}

impl ClockRate {
    /// Finds the source of the clock rate of a graphics adapter; `None` for software adapters, and where the system
    /// reports none.
    pub fn of(info: &wgpu::AdapterInfo) -> Option<Self> {
        let address = &info.device_pci_bus_id;
        if info.device_type == wgpu::DeviceType::Cpu || address.is_empty() {
            return None;
        }
        match info.vendor {
            NVIDIA => Some(Self::NvidiaSmi { address: address.clone() }),
            _ => Self::in_folder(&Path::new("/sys/bus/pci/devices").join(address)),
        }
    }

    /// Finds the file with the clock rate in Linux's folder of a PCI device.
    fn in_folder(device: &Path) -> Option<Self> {
        let levels = device.join("pp_dpm_sclk");
        if levels.is_file() {
            return Some(Self::Levels(levels));
        }
        let cards = std::fs::read_dir(device.join("drm")).ok()?.flatten();
        let files = ["gt_act_freq_mhz", "gt_cur_freq_mhz", "device/tile0/gt0/freq0/act_freq"];
        let mut found = cards.flat_map(|card| files.map(|file| card.path().join(file)));
        found.find(|file| file.is_file()).map(Self::Rate)
    }

    /// Reads the present clock rate, MHz; `None` if the system does not tell it.
    pub fn read_mhz(&self) -> Option<f64> {
        match self {
            Self::NvidiaSmi { address } => {
                let id = format!("--id={address}");
                let query = ["--query-gpu=clocks.sm", "--format=csv,noheader,nounits"];
                let output = Command::new("nvidia-smi").arg(id).args(query).output().ok()?;
                number(&String::from_utf8_lossy(&output.stdout))
            }
            Self::Levels(file) => present_level(&std::fs::read_to_string(file).ok()?),
            Self::Rate(file) => number(&std::fs::read_to_string(file).ok()?),
        }
    }
}

/// Parses the number at the start of a text; `None` for texts such as `[N/A]` and for rates that are not positive.
fn number(text: &str) -> Option<f64> {
    let digits = text.trim_start();
    let end = digits.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(digits.len());
    digits[..end].parse().ok().filter(|mhz| *mhz > 0.0)
}

/// Parses the present rate from lines such as `1: 2100Mhz *`.
fn present_level(text: &str) -> Option<f64> {
    let line = text.lines().find(|line| line.trim_end().ends_with('*'))?;
    number(line.split_once(':')?.1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_are_read_from_the_texts_of_systems() {
        assert_eq!(number("1980\n"), Some(1980.0));
        assert_eq!([number("[N/A]\n"), number(""), number("0\n")], [None; 3]);
        assert_eq!(present_level("0: 500Mhz \n1: 2100Mhz *\n2: 2500Mhz\n"), Some(2100.0));
        assert_eq!([present_level("0: 500Mhz\n"), present_level("*\n")], [None; 2]);
    }

    #[test]
    fn linux_drivers_have_files_of_their_own() {
        let folder = tempfile::tempdir().unwrap();
        let device = folder.path();
        assert_eq!(ClockRate::in_folder(device), None);
        let card = device.join("drm/card0");
        std::fs::create_dir_all(&card).unwrap();
        std::fs::write(card.join("gt_cur_freq_mhz"), "1300\n").unwrap();
        assert_eq!(ClockRate::in_folder(device).unwrap().read_mhz(), Some(1300.0));
        std::fs::write(device.join("pp_dpm_sclk"), "0: 500Mhz *\n1: 2100Mhz\n").unwrap();
        assert_eq!(ClockRate::in_folder(device).unwrap().read_mhz(), Some(500.0));
    }
}
