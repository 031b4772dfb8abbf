//! The server: takes clients, gives them every published state, keeps the newest pose that one of them asked for.
//!
//! One thread takes clients, two more belong to each of them. No lock is held while a byte is sent or awaited, so that
//! [`LinkServer::publish`] waits for nobody.

use std::io::{ErrorKind, Write};
use std::net::{Shutdown, SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};
use std::time::{Duration, SystemTime};

use super::client::{Client, Frame};
use super::conversation::serve;
use super::message::{Content, Status, timestamp};
use super::shared::{Counters, LinkOptions, Shared, worker};
use super::state::{LinkState, STYLET, WantedPose};
use crate::error::{Error, Result};

/// Most clients at once.
pub const CLIENTS: usize = 8;

/// Longest time until a new client is noticed.
const LOOK: Duration = Duration::from_millis(20);

/// Pause after a client was taken or turned away.
const BETWEEN: Duration = Duration::from_millis(2);

/// Pause after a failure to take a client, such as too many open files.
const PAUSE: Duration = Duration::from_secs(1);

/// What happened since the server was started.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct LinkCounters {
    /// Clients now.
    pub clients: usize,
    /// Clients turned away because there were [`CLIENTS`].
    pub refused_clients: u64,
    /// Connections closed for what the client sent, or did not take.
    pub closed: u64,
    /// States that slow clients lost, summed over them.
    pub lost_states: u64,
    /// States with numbers that are not finite, which were not sent.
    pub unsent_states: u64,
    /// TRANSFORMs refused because control is not allowed.
    pub denied: u64,
    /// Wanted poses that are none.
    pub wrong_poses: u64,
    /// Messages without meaning here.
    pub skipped: u64,
}

/// A running server. Dropping it closes every connection and the port, and waits for its threads.
pub struct LinkServer {
    shared: Arc<Shared>,
    address: SocketAddr,
    taking: Option<JoinHandle<()>>,
}

impl LinkServer {
    /// Listens and takes clients from now on.
    ///
    /// # Errors
    /// `Error::Input` where the port is taken or not allowed or the address is none of this machine, `Error::Device` where
    /// there is no thread.
    pub fn start(options: LinkOptions) -> Result<LinkServer> {
        let wanted = SocketAddr::new(options.address, options.port);
        let listener = TcpListener::bind(wanted).map_err(|reason| no_port(wanted, &reason))?;
        let address = listener.local_addr().map_err(|reason| no_port(wanted, &reason))?;
        listener.set_nonblocking(true).map_err(|reason| no_port(wanted, &reason))?;
        let shared = Arc::new(Shared {
            options,
            counters: Counters::default(),
            audience: Mutex::default(),
            wanted: Mutex::default(),
            stop: AtomicBool::new(false),
        });
        let known = shared.clone();
        let taking = worker("link")
            .spawn(move || take_clients(&known, listener))
            .map_err(|reason| Error::Device(format!("no thread for OpenIGTLink: {reason}")))?;
        log::info!("OpenIGTLink at {address}");
        if !address.ip().is_loopback() {
            log::warn!("OpenIGTLink is open to the network at {address}: whoever reaches it is let in");
        }
        Ok(LinkServer { shared, address, taking: Some(taking) })
    }

    /// Where it listens.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// Gives a state to all clients, and to later ones until there is a newer one. Waits for nobody. A state whose numbers are
    /// not finite is counted and not sent.
    pub fn publish(&self, state: &LinkState) {
        let counters = &self.shared.counters;
        if !state.is_finite() {
            if counters.unsent_states.fetch_add(1, Ordering::Relaxed) == 0 {
                log::warn!("OpenIGTLink: a state with numbers that are not finite is not sent");
            }
            return;
        }
        let mut audience = self.shared.audience();
        if audience.status.as_ref().is_none_or(|(run, text)| *run != state.run || *text != state.text) {
            audience.status = Some((state.run, state.text.clone()));
            audience.changes += 1;
        }
        let frame = Arc::new(Frame::new(state, audience.changes));
        audience.newest = Some(frame.clone());
        let lost: usize = audience.clients.iter().map(|client| client.push(&frame)).sum();
        counters.lost_states.fetch_add(lost as u64, Ordering::Relaxed);
    }

    /// The newest pose that a client asked for; `None` before the first, and always without [`LinkOptions::allow_control`].
    /// It stays when the client goes, see [`WantedPose::connected`]; the direction may be any, also out of the tissue.
    pub fn wanted_pose(&self) -> Option<WantedPose> {
        self.shared.wanted().as_ref().map(|wanted| WantedPose {
            pose: wanted.pose,
            number: wanted.number,
            received: wanted.received,
            connected: wanted.client.strong_count() > 0,
        })
    }

    /// What happened so far.
    pub fn counters(&self) -> LinkCounters {
        let counters = &self.shared.counters;
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        LinkCounters {
            clients: self.shared.audience().clients.len(),
            refused_clients: read(&counters.refused_clients),
            closed: read(&counters.closed),
            lost_states: read(&counters.lost_states),
            unsent_states: read(&counters.unsent_states),
            denied: read(&counters.denied),
            wrong_poses: read(&counters.wrong_poses),
            skipped: read(&counters.skipped),
        }
    }
}

impl Drop for LinkServer {
    fn drop(&mut self) {
        self.shared.stop.store(true, Ordering::Release);
        if let Some(taking) = self.taking.take() {
            taking.thread().unpark();
            // A panic in it was reported when it happened.
            let _ = taking.join();
        }
    }
}

/// Takes clients until the server stops; then ends all of them.
fn take_clients(shared: &Arc<Shared>, listener: TcpListener) {
    let mut threads: Vec<JoinHandle<()>> = Vec::new();
    while !shared.stop.load(Ordering::Acquire) {
        match listener.accept() {
            Ok((stream, address)) => {
                threads.extend(take(shared, stream, address));
                // Somebody who comes and goes without end takes no more of the processor than this.
                thread::park_timeout(BETWEEN);
            }
            Err(error) if error.kind() == ErrorKind::WouldBlock => thread::park_timeout(LOOK),
            Err(error) => {
                log::warn!("OpenIGTLink: a client could not be taken: {error}");
                thread::park_timeout(PAUSE);
            }
        }
        for ended in threads.extract_if(.., |thread| thread.is_finished()) {
            let _ = ended.join();
        }
    }
    drop(listener);
    for client in &shared.audience().clients {
        client.close();
    }
    for thread in threads {
        let _ = thread.join();
    }
}

/// Takes one client, or turns it away.
fn take(shared: &Arc<Shared>, stream: TcpStream, address: SocketAddr) -> Option<JoinHandle<()>> {
    // Only this thread adds clients: there cannot be more of them later on.
    if shared.audience().clients.len() >= CLIENTS {
        shared.counters.refused_clients.fetch_add(1, Ordering::Relaxed);
        log::warn!("OpenIGTLink client {address} is turned away: there are {CLIENTS} already");
        turn_away(&stream);
        return None;
    }
    let options = &shared.options;
    let client = match Client::new(stream, address, options.sensors, options.stall_timeout) {
        Ok(client) => Arc::new(client),
        Err(error) => {
            log::warn!("OpenIGTLink client {address} was lost at once: {error}");
            return None;
        }
    };
    {
        let mut audience = shared.audience();
        if let Some(newest) = &audience.newest {
            client.push(newest);
        }
        audience.clients.push(client.clone());
    }
    log::info!("OpenIGTLink client {address} is connected");
    let (known, served) = (shared.clone(), client.clone());
    let thread = worker("link client").spawn(move || {
        serve(&known, &served);
        known.audience().clients.retain(|other| !Arc::ptr_eq(other, &served));
    });
    thread
        .inspect_err(|error| {
            log::warn!("OpenIGTLink client {address}: no thread for it ({error}); connection closed");
            client.close();
            shared.audience().clients.retain(|other| !Arc::ptr_eq(other, &client));
        })
        .ok()
}

/// Tells a client that there is no place for it. The message fits into the empty buffer of the connection: nothing is waited for.
fn turn_away(mut stream: &TcpStream) {
    let status = Status {
        code: Status::BUSY,
        subcode: CLIENTS as i64,
        name: "busy".into(),
        text: format!("{CLIENTS} clients are connected already"),
    };
    let message = Content::Status(status).encode(STYLET, timestamp(SystemTime::now()));
    // It may be gone; then it needs no answer.
    let _ = stream.set_nonblocking(true).and_then(|()| stream.write_all(&message));
    let _ = stream.shutdown(Shutdown::Both);
}

fn no_port(wanted: SocketAddr, reason: &std::io::Error) -> Error {
    let (address, port) = (wanted.ip(), wanted.port());
    match reason.kind() {
        ErrorKind::AddrInUse => Error::input(
            format!("OpenIGTLink: another program listens at port {port} of {address}"),
            "end it, or choose another port with --link-port",
        ),
        ErrorKind::PermissionDenied => Error::input(
            format!("OpenIGTLink: this user may not listen at port {port}"),
            "choose a port of 1024 or more with --link-port",
        ),
        ErrorKind::AddrNotAvailable => Error::input(
            format!("OpenIGTLink: {address} is no address of this machine"),
            "give one of its own with --link-address, or leave it out for 127.0.0.1",
        ),
        _ => Error::input(
            format!("OpenIGTLink: cannot listen at {wanted}: {reason}"),
            "choose another port with --link-port or another address with --link-address",
        ),
    }
}
