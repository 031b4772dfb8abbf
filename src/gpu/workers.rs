//! Workers of the software adapter llvmpipe, one on each processor.
//!
//! A step is a handful of dispatches of some 100 us, and llvmpipe wakes its workers for each of them. Linux wakes a thread
//! where it last ran: where two workers have once shared a processor they go on sharing it, because the other one is never
//! idle for long enough (`sched_migration_cost_ns`, 0.5 ms) to take one over. Measured on two cores, 4,608 cells: traces show
//! both workers on one processor for thousands of dispatches; with one worker on each the main job takes 1.3 to 1.7 times
//! less time. Other drivers place their threads themselves.

/// Threads of this process, in the order of their start.
#[derive(Debug, Default)]
pub struct Threads {
    #[cfg(target_os = "linux")]
    ids: Vec<i32>,
}

#[cfg(target_os = "linux")]
mod linux {
    use nix::sched::{CpuSet, sched_getaffinity, sched_setaffinity};
    use nix::unistd::Pid;

    /// What llvmpipe calls the threads that fill triangles; those that run compute shaders have no name, are as many, and are
    /// started right after them (lp_screen.c, `llvmpipe_init_screen_late`; Mesa 22.3 and 25.0).
    const PAINTER: &str = "llvmpipe-";

    pub fn ids() -> Vec<i32> {
        let Ok(folder) = std::fs::read_dir("/proc/self/task") else {
            return Vec::new();
        };
        // The kernel lists them in the order of their start; numbers wrap round.
        folder.flatten().filter_map(|entry| entry.file_name().to_str().and_then(|name| name.parse().ok())).collect()
    }

    /// Place of the workers among `names` of threads in the order of their start: two pools, painters and computers.
    pub fn pools(names: &[String]) -> [std::ops::Range<usize>; 2] {
        let first = names.iter().position(|name| name.starts_with(PAINTER)).unwrap_or(names.len());
        let painters = names[first..].iter().take_while(|name| name.starts_with(PAINTER)).count();
        let middle = first + painters;
        [first..middle, middle..(middle + painters).min(names.len())]
    }

    pub fn spread(fresh: &[i32]) {
        let name = |id: &i32| std::fs::read_to_string(format!("/proc/self/task/{id}/comm")).unwrap_or_default();
        let names: Vec<String> = fresh.iter().map(name).collect();
        let Ok(allowed) = sched_getaffinity(Pid::from_raw(0)) else {
            return;
        };
        let processors: Vec<usize> = (0..CpuSet::count()).filter(|&c| allowed.is_set(c).unwrap_or(false)).collect();
        for pool in pools(&names) {
            for (worker, processor) in fresh[pool].iter().zip(processors.iter().cycle()) {
                let mut set = CpuSet::new();
                // A thread that cannot be placed works as well, only not as fast.
                if set.set(*processor).is_err() || sched_setaffinity(Pid::from_raw(*worker), &set).is_err() {
                    log::debug!("worker {worker} of llvmpipe could not be placed on processor {processor}");
                }
            }
        }
    }
}

impl Threads {
    /// Those that are there now.
    pub fn now() -> Self {
        Threads {
            #[cfg(target_os = "linux")]
            ids: linux::ids(),
        }
    }

    /// Places each worker that llvmpipe has started since `self` on a processor of its own, of those that the process may use.
    pub fn spread_new(&self) {
        #[cfg(target_os = "linux")]
        {
            let fresh: Vec<i32> = linux::ids().into_iter().filter(|id| !self.ids.contains(id)).collect();
            linux::spread(&fresh);
        }
    }
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::linux::pools;

    fn names(list: &[&str]) -> Vec<String> {
        list.iter().map(|&name| format!("{name}\n")).collect()
    }

    #[test]
    fn computers_stand_behind_the_painters() {
        let started = names(&["stylet", "llvmpipe-0", "llvmpipe-1", "stylet", "stylet", "disk$0", "stylet"]);
        assert_eq!(pools(&started), [1..3, 3..5]);
    }

    #[test]
    fn without_painters_nothing_is_moved() {
        assert_eq!(pools(&names(&["stylet", "swiftshader"])), [2..2, 2..2]);
        assert_eq!(pools(&[]), [0..0, 0..0]);
    }

    #[test]
    fn a_list_that_ends_early_is_no_error() {
        assert_eq!(pools(&names(&["llvmpipe-0", "llvmpipe-1", "stylet"])), [0..2, 2..3]);
    }
}
