//! What the operating system tells about this process; `None` where it does not.

/// Processor time of all threads since the start [s]; resolution 10 ms.
pub fn cpu_seconds() -> Option<f64> {
    let text = std::fs::read_to_string("/proc/self/stat").ok()?;
    // The second field is the program name in parentheses and may hold spaces.
    let mut fields = text.rsplit_once(')')?.1.split_whitespace().skip(11);
    let user: f64 = fields.next()?.parse().ok()?;
    let system: f64 = fields.next()?.parse().ok()?;
    // Linux counts in USER_HZ, which is 100 on every platform that Rust supports.
    Some((user + system) / 100.0)
}

/// Largest resident memory so far [bytes].
pub fn peak_bytes() -> Option<u64> {
    status_kilobytes("/proc/self/status", "VmHWM:")
}

/// Memory that new allocations can take [bytes].
pub fn available_bytes() -> Option<u64> {
    status_kilobytes("/proc/meminfo", "MemAvailable:")
}

fn status_kilobytes(file: &str, key: &str) -> Option<u64> {
    let text = std::fs::read_to_string(file).ok()?;
    let line = text.lines().find_map(|l| l.strip_prefix(key))?;
    line.trim().strip_suffix("kB")?.trim().parse::<u64>().ok().map(|kb| kb * 1024)
}

/// From here on the threads of this process, and those that they start, use only processor time that no other process wants (Linux:
/// `SCHED_IDLE`). Elsewhere, and where it is not allowed, nothing changes.
pub fn idle() {
    #[cfg(target_os = "linux")]
    {
        use nix::libc::{SCHED_IDLE, sched_param, sched_setscheduler};
        let none = sched_param { sched_priority: 0 };
        let Ok(threads) = std::fs::read_dir("/proc/self/task") else { return };
        for id in threads.flatten().filter_map(|entry| entry.file_name().to_str()?.parse().ok()) {
            // SAFETY: the call reads the structure that lives here and changes nothing but the scheduling of a thread.
            if unsafe { sched_setscheduler(id, SCHED_IDLE, &none) } != 0 {
                log::debug!("thread {id} has no idle priority: {}", std::io::Error::last_os_error());
            }
        }
    }
}
