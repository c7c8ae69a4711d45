//! Helpers of all tests and benches: graphics adapter, scans and other programs that a test needs, and the sizes of
//! slow tests.
//!
//! A test whose requirement is missing fails. `UMBRAVOX_NO_GPU=1` and the other variables of [`Requirement`] say that
//! it is not expected on this machine: such a test prints one line `skipped: TEST: REASON` and passes.
//! `scripts/test.sh` counts these lines.
#![allow(dead_code, reason = "each test program uses some of it")]

use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::{LazyLock, OnceLock};
use umbravox::gpu::Gpu;

/// Requirement that some tests have of the machine: adapter, scans, programs.
#[derive(Debug, Clone, Copy)]
pub enum Requirement {
    Gpu,
    Scans,
    Browser,
    Window,
    SpirvVal,
}

impl Requirement {
    /// Environment variable that marks this requirement as missing on the machine, and a hint where to get it.
    const fn variable_and_hint(self) -> (&'static str, &'static str) {
        match self {
            Self::Gpu => {
                ("UMBRAVOX_NO_GPU", "install a Vulkan driver: scripts/setup.sh, or mesa-vulkan-drivers")
            }
            Self::Scans => {
                ("UMBRAVOX_NO_SCANS", "set UMBRAVOX_DATA to the folder of the scans: data/README.md")
            }
            Self::Browser => ("UMBRAVOX_NO_BROWSER", "install chromium: scripts/setup.sh --tests"),
            Self::Window => {
                ("UMBRAVOX_NO_WINDOW", "install xvfb and X11's libraries: scripts/setup.sh --tests")
            }
            Self::SpirvVal => ("UMBRAVOX_NO_SPIRV_VAL", "install spirv-tools: scripts/setup.sh --tests"),
        }
    }

    /// Skips the current test with a printed line, since a requirement is missing.
    ///
    /// # Panics
    /// Unless the environment says that this machine lacks it.
    pub fn missing(self, reason: &str) {
        let (variable, hint) = self.variable_and_hint();
        assert!(
            std::env::var(variable).is_ok_and(|value| value == "1"),
            "{reason}\nhint: {hint}; {variable}=1 skips the tests that need it"
        );
        skip(reason);
    }
}

/// Prints that the current test does not apply to this machine.
pub fn skip(reason: &str) {
    let thread = std::thread::current();
    println!("skipped: {}: {reason}", thread.name().unwrap_or("a test"));
}

/// Opens the default adapter's device; `None` and a printed line if none is expected.
///
/// # Panics
/// An adapter that does not open; no adapter, unless `UMBRAVOX_NO_GPU=1`.
pub fn gpu() -> Option<Gpu> {
    match Gpu::open(None) {
        Ok(gpu) => Some(gpu),
        Err(e) if e.what == "no graphics adapter" => {
            Requirement::Gpu.missing(&e.to_string());
            None
        }
        Err(e) => panic!("the graphics adapter does not open: {e}"),
    }
}

/// Whether the program under test will find an adapter; see [`gpu`].
pub fn has_adapter() -> bool {
    static OPENED: OnceLock<bool> = OnceLock::new();
    // Without an adapter every test reports it itself.
    if OPENED.get() == Some(&true) {
        return true;
    }
    let found = gpu().is_some();
    OPENED.get_or_init(|| found);
    found
}

/// Folder of the real scans: `UMBRAVOX_DATA` or `../shared/data`.
fn scans() -> PathBuf {
    std::env::var_os("UMBRAVOX_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from)
}

/// File of a real scan if it is installed, for benches that otherwise use a phantom.
pub fn scan_if_present(name: &str) -> Option<PathBuf> {
    Some(scans().join(format!("{name}.nii.gz"))).filter(|path| path.exists())
}

/// File of a real scan; `None` and a printed line if none is expected.
///
/// # Panics
/// A missing scan, unless `UMBRAVOX_NO_SCANS=1`.
pub fn scan(name: &str) -> Option<PathBuf> {
    let path = scans().join(format!("{name}.nii.gz"));
    if !path.exists() {
        Requirement::Scans.missing(&format!("there is no {}", path.display()));
        return None;
    }
    Some(path)
}

/// Whether a program can be started.
pub fn starts(program: &str) -> bool {
    Command::new(program).arg("--version").output().is_ok()
}

/// Copies a file, or a folder with its contents.
pub fn copy(from: &Path, to: &Path) {
    if from.is_dir() {
        std::fs::create_dir_all(to).unwrap();
        for entry in std::fs::read_dir(from).unwrap() {
            let entry = entry.unwrap();
            copy(&entry.path(), &to.join(entry.file_name()));
        }
    } else {
        std::fs::copy(from, to).unwrap();
    }
}

/// Sizes of the slow tests.
pub struct Sizes {
    /// Number of scenes in the search for violations of the error bound of `dsm` and `rays`.
    pub bound_search_scenes: usize,
    /// Number of scenes for shadow methods without an error bound.
    pub unbounded_scenes: usize,
    /// Number of damaged copies of each file format's sample.
    pub damaged_files: usize,
    /// Number of window sizes in which the layout is inspected.
    pub window_sizes: usize,
    /// Number of resizes of the real window while a picture refines.
    pub window_resizes: u32,
    /// Scenes in which the bias of random estimators is measured.
    pub estimator_scenes: usize,
    /// Methods of the pages of a phantom and of a scan.
    pub page_methods: [usize; 2],
    /// Stride between tested shaders: one of so many is composed, validated and translated.
    pub shader_stride: usize,
}

/// Small test sizes, or full ones (`UMBRAVOX_TESTS=full`).
pub static SIZES: LazyLock<Sizes> = LazyLock::new(|| {
    let full = std::env::var("UMBRAVOX_TESTS").is_ok_and(|value| value == "full");
    if full {
        Sizes {
            bound_search_scenes: 2000,
            unbounded_scenes: 300,
            damaged_files: 300,
            window_sizes: 7,
            window_resizes: 50,
            estimator_scenes: 50,
            page_methods: [11, 4],
            shader_stride: 1,
        }
    } else {
        Sizes {
            bound_search_scenes: 200,
            unbounded_scenes: 40,
            damaged_files: 40,
            window_sizes: 2,
            window_resizes: 12,
            estimator_scenes: 10,
            page_methods: [4, 2],
            shader_stride: 8,
        }
    }
});
