//! What all threads of a server know.

use std::net::{IpAddr, Ipv4Addr};
use std::sync::atomic::{AtomicBool, AtomicU64};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use super::client::{Client, Frame};
use super::state::{Pose, RunState};

/// Stack of a thread that serves a client [byte].
pub const STACK: usize = 256 << 10;

/// How to serve.
#[derive(Debug, Clone)]
pub struct LinkOptions {
    /// Address to listen at. Every other than the default opens the simulation to the network.
    pub address: IpAddr,
    /// 0 takes a free one, see [`super::LinkServer::address`].
    pub port: u16,
    /// Whether clients may say where the needle shall be.
    pub allow_control: bool,
    /// SENSOR and POSITION to every client from the beginning, not only to those who ask.
    pub sensors: bool,
    /// Longest time from the first to the last byte of a message.
    pub message_timeout: Duration,
    /// A client that takes nothing for this long while something waits for it is given up.
    pub stall_timeout: Duration,
}

impl Default for LinkOptions {
    /// This machine only, the usual port, no control.
    fn default() -> Self {
        LinkOptions {
            address: IpAddr::V4(Ipv4Addr::LOCALHOST),
            port: super::PORT,
            allow_control: false,
            sensors: false,
            message_timeout: Duration::from_secs(10),
            // 3D Slicer takes nothing while it loads a large scene.
            stall_timeout: Duration::from_secs(60),
        }
    }
}

#[derive(Default)]
pub(super) struct Counters {
    pub(super) refused_clients: AtomicU64,
    pub(super) closed: AtomicU64,
    pub(super) lost_states: AtomicU64,
    pub(super) unsent_states: AtomicU64,
    pub(super) denied: AtomicU64,
    pub(super) wrong_poses: AtomicU64,
    pub(super) skipped: AtomicU64,
}

/// Who listens, and what they hear first.
#[derive(Default)]
pub(super) struct Audience {
    pub(super) clients: Vec<Arc<Client>>,
    pub(super) newest: Option<Arc<Frame>>,
    /// The last state of the run and its text, and how often they changed.
    pub(super) status: Option<(RunState, String)>,
    pub(super) changes: u64,
}

/// The newest pose and who asked for it.
pub(super) struct Wanted {
    pub(super) pose: Pose,
    pub(super) number: u64,
    pub(super) received: Instant,
    pub(super) client: Weak<Client>,
}

/// What all threads know.
pub(super) struct Shared {
    pub(super) options: LinkOptions,
    pub(super) counters: Counters,
    pub(super) audience: Mutex<Audience>,
    pub(super) wanted: Mutex<Option<Wanted>>,
    pub(super) stop: AtomicBool,
}

impl Shared {
    pub(super) fn audience(&self) -> MutexGuard<'_, Audience> {
        self.audience.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn wanted(&self) -> MutexGuard<'_, Option<Wanted>> {
        self.wanted.lock().unwrap_or_else(PoisonError::into_inner)
    }

    pub(super) fn newest(&self) -> Option<Arc<Frame>> {
        self.audience().newest.clone()
    }

    pub(super) fn want(&self, pose: Pose, client: &Arc<Client>) {
        let mut wanted = self.wanted();
        let number = wanted.as_ref().map_or(0, |w| w.number) + 1;
        *wanted = Some(Wanted { pose, number, received: Instant::now(), client: Arc::downgrade(client) });
    }
}

/// A thread of this module before it starts.
pub(super) fn worker(name: &str) -> thread::Builder {
    thread::Builder::new().name(name.into()).stack_size(STACK)
}
