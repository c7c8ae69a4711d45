//! Memory budget for the voxels of a volume: free host memory, and downsampling factors that make a volume fit.

use std::path::Path;

/// Memory and texture limits for the voxels of a volume.
#[derive(Debug, Clone, Copy)]
pub struct MemoryBudget {
    /// Downsampling factors along x, y and z that the user chose. If set, the memory and texture limits do not apply.
    pub fixed: Option<[usize; 3]>,
    /// Largest number of bytes for the voxels of a volume and the data stored beside each voxel.
    pub most_bytes: u64,
    /// Bytes of host memory for each voxel of a volume, in addition to the voxel value itself.
    pub bytes_beside: u64,
    /// Largest number of texels along one side of a 3-D texture.
    pub texture_side: usize,
    /// Function that returns whether a volume with given dimensions fits 3-D textures with a given largest side.
    pub fits_texture: fn([usize; 3], usize) -> bool,
}

/// Largest downsampling factor along one axis of a volume in the search for factors that fit the memory budget.
const MOST_FACTOR: usize = 64;

/// Dimensions of a volume after downsampling; an incomplete block at the end of an axis becomes one voxel.
pub fn reduced_dims(dims: [usize; 3], factors: [usize; 3]) -> [usize; 3] {
    std::array::from_fn(|a| dims[a].div_ceil(factors[a].max(1)))
}

impl MemoryBudget {
    /// Returns downsampling factors that make a volume fit the memory budget. The largest of the three factors is as
    /// small as possible, then their product, then the longest side of the result. Thus no axis is reduced far more
    /// than the others.
    ///
    /// # Errors
    /// No factors make the volume fit the memory budget.
    pub fn factors(&self, dims: [usize; 3], voxel_bytes: u64) -> Result<[usize; 3], String> {
        if let Some(fixed) = self.fixed {
            return Ok(std::array::from_fn(|a| fixed[a].clamp(1, dims[a].max(1))));
        }
        let fits = |factors: &[usize; 3]| {
            let dims = reduced_dims(dims, *factors);
            grid_bytes(dims, voxel_bytes + self.bytes_beside).is_some_and(|bytes| bytes <= self.most_bytes)
                && (self.fits_texture)(dims, self.texture_side)
        };
        let longest = |factors: &[usize; 3]| {
            let mut sides = reduced_dims(dims, *factors);
            sides.sort_unstable_by(|a, b| b.cmp(a));
            sides
        };
        for most in 1..=MOST_FACTOR {
            let along = |a: usize| 1..=most.min(dims[a]);
            let all = along(0).flat_map(|x| along(1).map(move |y| [x, y]));
            let all = all.flat_map(|[x, y]| along(2).map(move |z| [x, y, z]));
            let fitting = all.filter(|factors| factors.contains(&most)).filter(fits);
            if let Some(best) = fitting.min_by_key(|f| (f.iter().product::<usize>(), longest(f))) {
                return Ok(best);
            }
        }
        let [x, y, z] = dims;
        Err(format!("{x} x {y} x {z} voxels cannot be reduced to fit {} bytes", self.most_bytes))
    }
}

/// Returns the size of a grid of voxels in bytes; `None` on overflow.
pub fn grid_bytes(dims: [usize; 3], voxel_bytes: u64) -> Option<u64> {
    dims.iter().try_fold(voxel_bytes, |bytes, n| bytes.checked_mul(*n as u64))
}

/// Fraction of the free host memory that the voxels of a volume may use. Data structures built from the voxels need
/// the rest.
const SHARE: f64 = 0.8;

/// Free memory of this process in bytes, limited by the machine and by Linux control groups. Returns `None` where the
/// system does not report it (only Linux is supported).
pub fn free_bytes() -> Option<u64> {
    let free = memory_info("MemAvailable:")?;
    let membership = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    let in_group = group_free_bytes(Path::new("/sys/fs/cgroup"), &membership);
    Some(in_group.map_or(free, |bytes| bytes.min(free)))
}

/// Free memory under the Linux control groups of a process, bytes: the minimum over its own group and all parent
/// groups.
///
/// `membership` is the text of `/proc/self/cgroup`, `root` the folder where the groups are mounted. Cached file
/// pages that the kernel can drop count as free.
fn group_free_bytes(root: &Path, membership: &str) -> Option<u64> {
    let groups = membership.lines().filter_map(|line| {
        // Version 2 writes `0::/GROUP`, version 1 `NUMBER:CONTROLLERS:/GROUP`.
        let (_, line) = line.split_once(':')?;
        let (controllers, group) = line.split_once(':')?;
        let (mount, files) = match controllers {
            "" => (root.to_owned(), ["memory.max", "memory.current", "inactive_file"]),
            _ if controllers.split(',').any(|name| name == "memory") => {
                let files = ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"];
                (root.join("memory"), files)
            }
            _ => return None,
        };
        // A container sees its own group at the mount point, so that folders of its path may be missing.
        let group = mount.join(group.trim_start_matches('/'));
        let above = group.ancestors().take_while(|folder| folder.starts_with(&mount));
        above.filter_map(|folder| free_of_group(folder, files)).min()
    });
    groups.min()
}

/// Free memory of one Linux control group, bytes; `None` if the group has no limit.
fn free_of_group(folder: &Path, [limit, usage, dropped]: [&str; 3]) -> Option<u64> {
    let number = |file: &str| std::fs::read_to_string(folder.join(file)).ok()?.trim().parse::<u64>().ok();
    let (limit, usage) = (number(limit)?, number(usage)?);
    let dropped = number_after(&folder.join("memory.stat"), &format!("{dropped} ")).unwrap_or(0);
    Some(limit.saturating_sub(usage.saturating_sub(dropped)))
}

/// Total memory of the machine in bytes; `None` where the system does not report it.
pub fn host_bytes() -> Option<u64> {
    memory_info("MemTotal:")
}

/// Largest memory of this process so far, bytes; `None` where the system does not report it (only Linux is supported).
pub fn peak_bytes() -> Option<u64> {
    number_after(Path::new("/proc/self/status"), "VmHWM:")?.checked_mul(1 << 10)
}

fn memory_info(name: &str) -> Option<u64> {
    number_after(Path::new("/proc/meminfo"), name)?.checked_mul(1 << 10)
}

/// Number that follows a name at the start of a line, in a text file such as `/proc/meminfo`.
fn number_after(path: &Path, name: &str) -> Option<u64> {
    let text = std::fs::read_to_string(path).ok()?;
    let rest = text.lines().find_map(|line| line.strip_prefix(name))?;
    rest.split_whitespace().next()?.parse().ok()
}

/// Returns an error if voxels of `bytes` bytes in total do not fit the free host memory. `None` means that the number
/// of bytes overflows 64 bits.
///
/// # Errors
/// The message states the needed and the free memory.
pub fn refuse_beyond_host(bytes: Option<u64>) -> Result<(), String> {
    refuse_beyond(bytes, free_bytes())
}

fn refuse_beyond(bytes: Option<u64>, free: Option<u64>) -> Result<(), String> {
    let bytes = bytes.ok_or("its header claims more voxels than can be counted")?;
    match free.map(|free| SHARE * free as f64) {
        Some(free) if bytes as f64 > free => {
            let [bytes, free] = [bytes as f64, free].map(|bytes| bytes / f64::from(1 << 30));
            Err(format!(
                "its voxels need {bytes:.1} GiB, and {free:.1} GiB of memory are free for them (--downsample reduces them, --host-memory reads most formats in parts)"
            ))
        }
        _ => Ok(()),
    }
}

/// Returns an error if a voxel grid of these dimensions does not fit the free host memory.
///
/// # Errors
/// The message states the needed and the free memory.
pub fn check_grid(dims: [usize; 3], voxel_bytes: u64) -> Result<(), String> {
    refuse_beyond_host(grid_bytes(dims, voxel_bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn budget(most_bytes: u64, texture_side: usize) -> MemoryBudget {
        let fits_texture = |dims: [usize; 3], side: usize| dims.iter().all(|n| *n <= side);
        MemoryBudget { fixed: None, most_bytes, bytes_beside: 0, texture_side, fits_texture }
    }

    #[test]
    fn the_least_factors_that_fit_are_taken() {
        let of = |dims, bytes, side| budget(bytes, side).factors(dims, 2).unwrap();
        assert_eq!(of([512, 512, 300], 1 << 30, 2048), [1, 1, 1]);
        // Half as many: of the longest axis.
        assert_eq!(of([512, 512, 2380], 512 * 512 * 1190 * 2, 4096), [1, 1, 2]);
        assert_eq!(of([512, 512, 512], 256 * 256 * 256 * 2, 4096), [2, 2, 2]);
        assert_eq!(of([3000, 40, 40], 1 << 40, 1000), [3, 1, 1]);
        // Not 1x1x5, which reduces one axis far more than the others.
        assert_eq!(of([50, 37, 25], 20_000, 100), [2, 2, 2]);
        // Incomplete blocks count.
        assert_eq!(of([3, 1, 1], 4, 100), [2, 1, 1]);
        assert!(budget(1, 100).factors([9, 9, 9], 2).unwrap_err().contains("9 x 9 x 9"));
        let fixed = MemoryBudget { fixed: Some([4, 1, 2]), ..budget(1, 1) };
        assert_eq!(fixed.factors([100, 100, 1], 8), Ok([4, 1, 1]));
    }

    #[test]
    fn too_many_voxels_are_refused_with_both_sizes() {
        if free_bytes().is_some() {
            let why = check_grid([1 << 20, 1 << 20, 1 << 10], 8).unwrap_err();
            assert!(why.contains("need 8388608.0 GiB") && why.contains("--downsample"), "{why}");
        }
        assert_eq!(check_grid([10, 10, 10], 8), Ok(()));
        assert_eq!(refuse_beyond(Some(8 << 30), Some(10 << 30)), Ok(()));
        let why = refuse_beyond(Some(9 << 30), Some(10 << 30)).unwrap_err();
        assert!(why.contains("need 9.0 GiB") && why.contains("8.0 GiB of memory are free"), "{why}");
        assert!(refuse_beyond(None, None).is_err() && refuse_beyond(Some(u64::MAX), None).is_ok());
    }

    #[test]
    fn the_tightest_control_group_above_the_process_counts() {
        let root = tempfile::tempdir().unwrap();
        let write = |group: &str, files: &[(&str, &str)]| {
            let folder = root.path().join(group);
            std::fs::create_dir_all(&folder).unwrap();
            files.iter().for_each(|(name, text)| std::fs::write(folder.join(name), text).unwrap());
        };
        let free = |membership: &str| group_free_bytes(root.path(), membership);
        // Version 2: the limit is two levels above the process, as Slurm sets it.
        write("slurm", &[("memory.max", "max\n"), ("memory.current", "900\n")]);
        write("slurm/job_7", &[("memory.max", "1000\n"), ("memory.current", "300\n")]);
        write("slurm/job_7/step_0/task_0", &[("memory.max", "max\n"), ("memory.current", "200\n")]);
        assert_eq!(free("0::/slurm/job_7/step_0/task_0\n"), Some(700));
        write("slurm/job_7", &[("memory.stat", "anon 60\ninactive_file 240\n")]);
        assert_eq!(free("0::/slurm/job_7/step_0/task_0\n"), Some(940), "cached file pages can be dropped");
        write("slurm/job_7/step_0", &[("memory.max", "250\n"), ("memory.current", "260\n")]);
        assert_eq!(free("0::/slurm/job_7/step_0/task_0\n"), Some(0), "a tighter group below wins");
        // Version 1, beside other controllers, and a container that does not see the folders of its path.
        let limits = [("memory.limit_in_bytes", "5000\n"), ("memory.usage_in_bytes", "1000\n")];
        write("memory/slurm/uid_1", &limits);
        write(
            "memory",
            &[("memory.limit_in_bytes", "9223372036854771712\n"), ("memory.usage_in_bytes", "7\n")],
        );
        assert_eq!(free("4:cpu,cpuacct:/slurm/uid_1\n9:memory,hugetlb:/slurm/uid_1/step\n"), Some(4000));
        write("memory", &limits);
        assert_eq!(free("9:memory:/docker/0123/other\n"), Some(4000));
        // Neither: no limit is known.
        assert_eq!(free("0::/user.slice\n"), None);
        assert_eq!(free("4:cpu:/slurm\nno group"), None);
    }
}
