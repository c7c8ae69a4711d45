//! What the host can hold: a volume that it cannot is refused before memory is taken.

/// Of the memory that is free, what a volume's voxels may take: the rest is for what is made of them.
const SHARE: f64 = 0.8;

/// Memory that programs can still take; `None` where the system does not say.
fn free_bytes() -> Option<u64> {
    said("MemAvailable:")
}

/// Memory that the machine has, which does not change while a program runs; `None` where the system does not say.
pub(crate) fn host_bytes() -> Option<u64> {
    said("MemTotal:")
}

fn said(name: &str) -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim().strip_suffix(" kB")?.trim().parse::<u64>().ok()?.checked_mul(1 << 10)
}

/// Refuses voxels of so many bytes, or of more than can be counted, where the host cannot hold them: the one place that says so.
///
/// # Errors
/// What they need and what there is, in words.
pub(crate) fn refuse_beyond_host(bytes: Option<u64>) -> Result<(), String> {
    beyond(bytes, free_bytes())
}

fn beyond(bytes: Option<u64>, free: Option<u64>) -> Result<(), String> {
    let bytes = bytes.ok_or("its header claims more voxels than can be counted")?;
    match free {
        Some(free) if bytes as f64 > SHARE * free as f64 => {
            let gib = |bytes: f64| bytes / f64::from(1 << 30);
            Err(format!(
                "its voxels need {:.1} GiB, and {:.1} GiB of memory are free for them",
                gib(bytes as f64),
                gib(SHARE * free as f64)
            ))
        }
        _ => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_needed_and_free_is_said_in_numbers() {
        assert_eq!(beyond(Some(8 << 30), Some(10 << 30)), Ok(()));
        let said = beyond(Some(9 << 30), Some(10 << 30)).unwrap_err();
        assert!(said.contains("need 9.0 GiB") && said.contains("8.0 GiB of memory are free"), "{said}");
        assert!(beyond(None, None).is_err() && beyond(Some(u64::MAX), None).is_ok());
    }
}
