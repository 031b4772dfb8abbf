//! Threads that share the parts of one stage and wait for the next in a spin loop.
//!
//! A step of 5,000 cells takes 100 us and has three parallel stages; a fork-join of a thread pool that sleeps costs 25 us each. Every thread
//! takes the parts of its own share first, the same ones in every step, whose data lie in the cache of its core; whoever is done with them
//! takes from the shares of others, so that a thread that the system has stopped holds up one part and not a half. Every part writes what is
//! its own alone, and results come back in the order of the parts: no bit hangs on the number of threads.

use std::ops::Range;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// How long a thread without work spins before it sleeps: longer than the serial stages between two parallel ones, far shorter than what a
/// person or a battery would notice.
const SPIN: Duration = Duration::from_micros(200);

/// A stage under way, as its threads see it.
type Stage = dyn Fn(usize) + Sync;

/// The stage that workers are to join, with the number of its parts.
#[derive(Clone, Copy)]
struct Posted {
    stage: *const Stage,
    parts: usize,
}

// SAFETY: the pointer is used between `post` and `withdraw` only, while `Team::run` holds the closure, which is `Sync`.
unsafe impl Send for Posted {}

/// The next part of a thread's share. Alone on its lines of the cache: the other threads count, too.
#[derive(Default)]
#[repr(align(128))]
struct Next(AtomicUsize);

struct Shared {
    posted: Mutex<Option<Posted>>,
    /// Counts stages, so that a worker sees a new one without a lock.
    number: AtomicUsize,
    /// Of every thread, the caller first.
    next: Box<[Next]>,
    /// Workers that hold the stage.
    inside: AtomicUsize,
    panicked: AtomicBool,
    ended: AtomicBool,
}

/// The calling thread and its workers.
pub struct Team {
    shared: Arc<Shared>,
    workers: Vec<JoinHandle<()>>,
}

fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Team {
    /// A team of `threads` with the caller among them.
    pub fn new(threads: usize) -> Self {
        let shared = Arc::new(Shared {
            posted: Mutex::new(None),
            number: AtomicUsize::new(0),
            next: (0..threads.max(1)).map(|_| Next::default()).collect(),
            inside: AtomicUsize::new(0),
            panicked: AtomicBool::new(false),
            ended: AtomicBool::new(false),
        });
        let worker = |number: usize| {
            let shared = shared.clone();
            std::thread::Builder::new().name(format!("cells-{number}")).spawn(move || shared.work(number))
        };
        // A system that gives no more threads has a smaller team.
        let workers = (1..threads).map_while(|n| worker(n).ok()).collect();
        Team { shared, workers }
    }

    /// Threads with the caller among them.
    pub fn size(&self) -> usize {
        self.workers.len() + 1
    }

    /// Items of a part, where there are `items`: parts enough that a stopped thread holds up little, few enough that taking them is free.
    pub fn part(&self, items: usize) -> usize {
        const PARTS_PER_THREAD: usize = 6;
        items.div_ceil(PARTS_PER_THREAD * self.size()).max(1)
    }

    /// Calls `work` with every item and its number; results in the order of the items.
    pub fn map<T: Send, R: Send>(
        &self,
        items: impl IntoIterator<Item = T>,
        work: impl Fn(usize, T) -> R + Sync,
    ) -> Vec<R> {
        if self.workers.is_empty() {
            return items.into_iter().enumerate().map(|(i, item)| work(i, item)).collect();
        }
        enum Slot<T, R> {
            Open(T),
            Taken,
            Done(R),
        }
        let slots: Vec<Mutex<Slot<T, R>>> = items.into_iter().map(|item| Mutex::new(Slot::Open(item))).collect();
        self.run(slots.len(), &|i| {
            let taken = std::mem::replace(&mut *locked(&slots[i]), Slot::Taken);
            if let Slot::Open(item) = taken {
                let result = work(i, item);
                *locked(&slots[i]) = Slot::Done(result);
            }
        });
        let done = |slot: Mutex<Slot<T, R>>| match slot.into_inner().unwrap_or_else(PoisonError::into_inner) {
            Slot::Done(result) => Some(result),
            Slot::Open(_) | Slot::Taken => None,
        };
        slots.into_iter().filter_map(done).collect()
    }

    /// Calls `work` with `0..count`; results in that order.
    pub fn each<R: Send>(&self, count: usize, work: impl Fn(usize) -> R + Sync) -> Vec<R> {
        let part = self.part(count);
        let parts = (0..count).step_by(part).map(|first| first..(first + part).min(count));
        self.map(parts, |_, range| range.map(&work).collect::<Vec<R>>()).into_iter().flatten().collect()
    }

    /// Puts what `work` makes of every index in its place.
    pub fn fill<R: Send>(&self, all: &mut [R], work: impl Fn(usize) -> R + Sync) {
        let part = self.part(all.len());
        self.map(all.chunks_mut(part), |number, values| {
            for (i, value) in (number * part..).zip(values) {
                *value = work(i);
            }
        });
    }

    /// Runs the parts `0..parts` of a stage.
    fn run(&self, parts: usize, stage: &(dyn Fn(usize) + Sync)) {
        let shared = &*self.shared;
        // SAFETY: only the lifetime is dropped. `Withdraw` waits until no worker holds the stage, also where the caller's part panics.
        let stage_of_workers = unsafe { std::mem::transmute::<*const (dyn Fn(usize) + Sync), *const Stage>(stage) };
        for (thread, next) in shared.next.iter().enumerate() {
            next.0.store(shared.share(thread, parts).start, Ordering::Relaxed);
        }
        *locked(&shared.posted) = Some(Posted { stage: stage_of_workers, parts });
        shared.number.fetch_add(1, Ordering::Release);
        self.workers.iter().for_each(|w| w.thread().unpark());
        let withdraw = Withdraw(shared);
        shared.take_parts(0, parts, stage);
        drop(withdraw);
        if shared.panicked.swap(false, Ordering::AcqRel) {
            resume_unwind(Box::new("a part of a stage panicked in a worker"));
        }
    }
}

impl Drop for Team {
    fn drop(&mut self) {
        self.shared.ended.store(true, Ordering::Release);
        for worker in self.workers.drain(..) {
            worker.thread().unpark();
            // What it panicked with was told where it happened.
            let _ = worker.join();
        }
    }
}

/// Takes a stage back and waits for those who hold it.
struct Withdraw<'a>(&'a Shared);

impl Drop for Withdraw<'_> {
    fn drop(&mut self) {
        *locked(&self.0.posted) = None;
        let mut turns = 0u32;
        while self.0.inside.load(Ordering::Acquire) > 0 {
            turns += 1;
            // A worker that the system has stopped needs the core.
            if turns.is_multiple_of(1024) { std::thread::yield_now() } else { std::hint::spin_loop() }
        }
    }
}

impl Shared {
    /// The parts of a stage that are a thread's own.
    fn share(&self, thread: usize, parts: usize) -> Range<usize> {
        let threads = self.next.len();
        thread * parts / threads..(thread + 1) * parts / threads
    }

    /// Takes the parts of a thread's own share, then those that are left of the others'.
    fn take_parts(&self, thread: usize, parts: usize, stage: &(dyn Fn(usize) + Sync)) {
        let threads = self.next.len();
        for owner in (thread..thread + threads).map(|t| t % threads) {
            let end = self.share(owner, parts).end;
            loop {
                let part = self.next[owner].0.fetch_add(1, Ordering::Relaxed);
                if part >= end {
                    break;
                }
                stage(part);
            }
        }
    }

    /// The life of a worker.
    fn work(&self, thread: usize) {
        let mut seen = 0;
        loop {
            let mut waiting: Option<Instant> = None;
            let mut turns = 0u32;
            loop {
                if self.ended.load(Ordering::Acquire) {
                    return;
                }
                let number = self.number.load(Ordering::Acquire);
                if number != seen {
                    seen = number;
                    break;
                }
                turns += 1;
                std::hint::spin_loop();
                if turns.is_multiple_of(64) {
                    let since = *waiting.get_or_insert_with(Instant::now);
                    if since.elapsed() > SPIN {
                        // `run` unparks: a stage that comes between the look above and here ends this at once.
                        std::thread::park();
                    }
                }
            }
            let posted = {
                let posted = locked(&self.posted);
                if posted.is_some() {
                    self.inside.fetch_add(1, Ordering::AcqRel);
                }
                *posted
            };
            if let Some(Posted { stage, parts }) = posted {
                // SAFETY: `inside` was raised under the lock under which the stage stood there; `Withdraw` waits for it.
                let stage = unsafe { &*stage };
                if catch_unwind(AssertUnwindSafe(|| self.take_parts(thread, parts, stage))).is_err() {
                    self.panicked.store(true, Ordering::Release);
                }
                self.inside.fetch_sub(1, Ordering::AcqRel);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_part_is_done_once_and_results_keep_their_order() {
        for threads in [1, 2, 5] {
            let team = Team::new(threads);
            for round in 0..2000usize {
                let mut values = vec![0usize; 37];
                let sums = team.map(values.chunks_mut(5), |part, chunk| {
                    chunk.iter_mut().for_each(|v| *v += part + round);
                    chunk.len() * part
                });
                assert_eq!(sums, [0, 5, 10, 15, 20, 25, 30, 14]);
                assert!(values.iter().enumerate().all(|(i, v)| *v == i / 5 + round));
            }
        }
    }

    #[test]
    fn a_part_that_panics_ends_the_stage_and_not_the_team() {
        let team = Team::new(3);
        let panics = |bad: usize| {
            catch_unwind(AssertUnwindSafe(|| {
                team.map(0..50usize, |_, item| {
                    std::thread::sleep(Duration::from_micros(50));
                    assert_ne!(item, bad);
                })
            }))
        };
        for bad in 0..50 {
            assert!(panics(bad).is_err(), "{bad}");
            assert_eq!(panics(50).map(|r| r.len()).unwrap(), 50);
        }
    }
}
