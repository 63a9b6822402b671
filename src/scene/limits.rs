//! Limits of grids and meshes, and memory that is free, as the system tells it (Linux does).

use std::path::Path;

/// Maximum number of nodes with 32-bit indices: the largest array has 64 numbers per node.
pub const MOST_NODES: u32 = u32::MAX / 64;

/// Largest ratio of the edges of a cell, or of a tetrahedron's longest edge and least height: the condition of the system grows with its
/// square, and beyond 10⁴ the solvers no longer reach a tolerance of 10⁻⁹ in f64 (a patch of one strain, pulled over layers 10³ to 10⁹ times
/// as thick as cells are wide).
pub(super) const LONGEST: f64 = 1e4;

/// Bytes that the process may still take: the machine's, the control group's, and those of its limit of address space (`ulimit -v`).
pub fn free() -> Option<u64> {
    let group = std::fs::read_to_string("/proc/self/cgroup").unwrap_or_default();
    [of_machine(), of_address_space(), of_group(&group)].into_iter().flatten().min()
}

/// Number of a line `name value`, in its unit.
fn number(text: &str, name: &str) -> Option<u64> {
    let line = text.lines().find_map(|line| line.strip_prefix(name))?;
    line.trim_start_matches(':').split_whitespace().next()?.parse().ok()
}

fn of_machine() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    Some(1024 * (number(&text, "MemAvailable")? + number(&text, "SwapFree").unwrap_or(0)))
}

fn of_address_space() -> Option<u64> {
    let limits = std::fs::read_to_string("/proc/self/limits").ok()?;
    let taken = std::fs::read_to_string("/proc/self/status").ok()?;
    // "unlimited" is no number
    Some(number(&limits, "Max address space")?.saturating_sub(1024 * number(&taken, "VmSize")?))
}

/// Least of the groups that the process is in, of either version; caches of files count as free.
fn of_group(text: &str) -> Option<u64> {
    let left = |folder: &Path, [most, taken, cache]: [&str; 3]| {
        let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap_or_default();
        let most: u64 = read(most).trim().parse().ok()?;
        let taken: u64 = read(taken).trim().parse().ok()?;
        Some(most.saturating_sub(taken) + number(&read("memory.stat"), cache).unwrap_or(0))
    };
    let of_line = |line: &str| {
        let mut parts = line.splitn(3, ':');
        let (kind, path) = (parts.nth(1)?, parts.next()?);
        let (root, names) = match kind {
            "" => ("/sys/fs/cgroup", ["memory.max", "memory.current", "inactive_file"]),
            "memory" => {
                ("/sys/fs/cgroup/memory", ["memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file"])
            }
            _ => return None,
        };
        let own = Path::new(root).join(path.trim_start_matches('/'));
        own.ancestors().take_while(|folder| folder.starts_with(root)).filter_map(|folder| left(folder, names)).min()
    };
    text.lines().filter_map(of_line).min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_the_system_says_is_read() {
        assert_eq!(number("MemTotal:  9 kB\nMemAvailable:   123 kB\n", "MemAvailable"), Some(123));
        assert_eq!(
            number("Max address space         unlimited            unlimited  bytes\n", "Max address space"),
            None
        );
        assert_eq!(number("Max address space         4096  unlimited  bytes\n", "Max address space"), Some(4096));
        if cfg!(target_os = "linux") {
            let free = free().expect("Linux tells");
            assert!((1 << 20..1 << 60).contains(&free), "{free}");
        }
    }
}
