//! How much room there is for voxels, and by which whole factors they are to be reduced to fit.

/// What voxels are to fit into.
#[derive(Debug, Clone, Copy)]
pub struct Room {
    /// These factors along x, y and z, whatever there is room for.
    pub fixed: Option<[usize; 3]>,
    /// Bytes for all that is kept of the voxels.
    pub most_bytes: u64,
    /// Bytes a voxel that are needed beside its own.
    pub bytes_beside: u64,
    /// What the next one is asked about.
    pub texture_side: usize,
    /// Whether a grid can be laid into a 3-D texture of such a side.
    pub lies_in: fn([usize; 3], usize) -> bool,
}

/// Factor beyond which nothing is tried any more.
const MOST_FACTOR: usize = 64;

/// Voxels along each axis once blocks of so many became one; incomplete ones at the end count.
pub fn reduced_dims(dims: [usize; 3], factors: [usize; 3]) -> [usize; 3] {
    std::array::from_fn(|a| dims[a].div_ceil(factors[a].max(1)))
}

impl Room {
    /// The factors that reduce a grid, of voxels of so many bytes each, to what there is room for: those whose largest is
    /// least, so that no axis pays for the others; of these the ones of the smallest blocks; of these the ones that leave
    /// the longest axis shortest.
    ///
    /// # Errors
    /// None do, in words.
    pub fn factors(&self, dims: [usize; 3], voxel_bytes: u64) -> Result<[usize; 3], String> {
        if let Some(fixed) = self.fixed {
            return Ok(std::array::from_fn(|a| fixed[a].clamp(1, dims[a].max(1))));
        }
        let fits = |factors: &[usize; 3]| {
            let dims = reduced_dims(dims, *factors);
            let each = voxel_bytes + self.bytes_beside;
            let bytes = dims.iter().try_fold(each, |bytes, n| bytes.checked_mul(*n as u64));
            bytes.is_some_and(|bytes| bytes <= self.most_bytes) && (self.lies_in)(dims, self.texture_side)
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

/// Of the memory that is free, what a volume's voxels may take: the rest is for what is made of them.
const SHARE: f64 = 0.8;

/// Bytes that the machine, or the group of processes that this one may not outgrow, has free; `None` where the system does
/// not say (it is asked on Linux alone).
pub fn free_bytes() -> Option<u64> {
    let free = said("MemAvailable:")?;
    let number = |path: &str| std::fs::read_to_string(path).ok()?.trim().parse::<u64>().ok();
    let of_group = number("/sys/fs/cgroup/memory.max").zip(number("/sys/fs/cgroup/memory.current"));
    let of_group = of_group.map(|(most, now)| most.saturating_sub(now));
    Some(of_group.map_or(free, |group| group.min(free)))
}

/// Bytes that the machine has, which do not change while a program runs; `None` where the system does not say.
pub fn host_bytes() -> Option<u64> {
    said("MemTotal:")
}

fn said(name: &str) -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok()?.checked_mul(1 << 10)
}

/// Refuses voxels of so many bytes, or of more than can be counted, where the machine has no memory for them: the one place
/// that says so.
///
/// # Errors
/// What they need and what there is, in words.
pub fn refuse_beyond_host(bytes: Option<u64>) -> Result<(), String> {
    beyond(bytes, free_bytes())
}

fn beyond(bytes: Option<u64>, free: Option<u64>) -> Result<(), String> {
    let bytes = bytes.ok_or("its header claims more voxels than can be counted")?;
    match free {
        Some(free) if bytes as f64 > SHARE * free as f64 => {
            let gib = |bytes: f64| bytes / f64::from(1 << 30);
            Err(format!(
                "its voxels need {:.1} GiB, and {:.1} GiB of memory are free for them (--downsample reduces them)",
                gib(bytes as f64),
                gib(SHARE * free as f64)
            ))
        }
        _ => Ok(()),
    }
}

/// As [`refuse_beyond_host`], of a grid of voxels of so many bytes each.
///
/// # Errors
/// As there.
pub fn check(dims: [usize; 3], voxel_bytes: u64) -> Result<(), String> {
    refuse_beyond_host(dims.iter().try_fold(voxel_bytes, |bytes, n| bytes.checked_mul(*n as u64)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room(most_bytes: u64, texture_side: usize) -> Room {
        let lies_in = |dims: [usize; 3], side: usize| dims.iter().all(|n| *n <= side);
        Room { fixed: None, most_bytes, bytes_beside: 0, texture_side, lies_in }
    }

    #[test]
    fn the_least_factors_that_fit_are_taken() {
        let of = |dims, bytes, side| room(bytes, side).factors(dims, 2).unwrap();
        assert_eq!(of([512, 512, 300], 1 << 30, 2048), [1, 1, 1]);
        // Half as many: of the longest axis.
        assert_eq!(of([512, 512, 2380], 512 * 512 * 1190 * 2, 4096), [1, 1, 2]);
        assert_eq!(of([512, 512, 512], 256 * 256 * 256 * 2, 4096), [2, 2, 2]);
        assert_eq!(of([3000, 40, 40], 1 << 40, 1000), [3, 1, 1]);
        // No axis pays for the others: not 1x1x5.
        assert_eq!(of([50, 37, 25], 20_000, 100), [2, 2, 2]);
        // Incomplete blocks count.
        assert_eq!(of([3, 1, 1], 4, 100), [2, 1, 1]);
        assert!(room(1, 100).factors([9, 9, 9], 2).unwrap_err().contains("9 x 9 x 9"));
        let fixed = Room { fixed: Some([4, 1, 2]), ..room(1, 1) };
        assert_eq!(fixed.factors([100, 100, 1], 8), Ok([4, 1, 1]));
    }

    #[test]
    fn what_cannot_be_held_is_refused_in_numbers() {
        if free_bytes().is_some() {
            let why = check([1 << 20, 1 << 20, 1 << 10], 8).unwrap_err();
            assert!(why.contains("need 8388608.0 GiB") && why.contains("--downsample"), "{why}");
        }
        assert_eq!(check([10, 10, 10], 8), Ok(()));
        assert_eq!(beyond(Some(8 << 30), Some(10 << 30)), Ok(()));
        let said = beyond(Some(9 << 30), Some(10 << 30)).unwrap_err();
        assert!(said.contains("need 9.0 GiB") && said.contains("8.0 GiB of memory are free"), "{said}");
        assert!(beyond(None, None).is_err() && beyond(Some(u64::MAX), None).is_ok());
    }
}
