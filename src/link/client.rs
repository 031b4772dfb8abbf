//! One client: what waits for it, the thread that sends it, and the reading of what it sends.

use std::collections::VecDeque;
use std::io::{self, Read, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::atomic::Ordering;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use super::message::{Content, Header, Kind, Meaning, Status, Verb, timestamp};
use super::read::{self, Received};
use super::server::{Shared, worker};
use super::state::{LinkState, NEEDLE_CONTROL, Pose, STYLET};

/// States that wait for a client at most; one that is so far behind loses all but the newest.
pub const STATES: usize = 8;

/// Answers that wait for a client at most; one that asks on without reading gets no more.
pub const ANSWERS: usize = 16;

/// Send buffer that is asked for [byte]. Systems take megabytes where nobody asks, and a slow client would see states that are
/// minutes old.
const SEND_BUFFER: usize = 16 << 10;

/// What a client may send [byte/s], and at once [byte]; a message counts as its bytes and [`MESSAGE`] more. A hand that leads at
/// 1 kHz sends a tenth of it. Whoever sends more is read more slowly and has to wait: reading and checking what nobody needs would
/// take the processor from the tissue.
const RATE: f64 = (2 << 20) as f64;
const AT_ONCE: f64 = (1 << 20) as f64;
const MESSAGE: usize = 512;

/// Longest pause without a look whether the connection is ended.
const PAUSE: Duration = Duration::from_millis(50);

/// The messages of one state.
pub(super) struct Frame {
    /// Per kind of [`Kind::ALL`].
    messages: [Vec<u8>; 5],
    /// Counts the changes of the STATUS.
    status: u64,
}

impl Frame {
    pub(super) fn new(state: &LinkState, status: u64) -> Self {
        let time = timestamp(SystemTime::now());
        let encode =
            |kind| state.contents(kind).iter().flat_map(|(device, content)| content.encode(device, time)).collect();
        Frame { messages: Kind::ALL.map(encode), status }
    }

    fn of(&self, kind: Kind) -> &[u8] {
        &self.messages[kind as usize]
    }
}

/// What waits for a client, and what it wants.
struct Outgoing {
    states: VecDeque<Arc<Frame>>,
    answers: VecDeque<Vec<u8>>,
    /// Kinds of messages that it gets of each state, in the order of [`Kind::ALL`].
    streams: [bool; 5],
    /// The [`Frame::status`] that it was told last.
    status: Option<u64>,
    closed: bool,
}

/// A client as the server knows it.
pub(super) struct Client {
    address: SocketAddr,
    stream: TcpStream,
    outgoing: Mutex<Outgoing>,
    changed: Condvar,
}

impl Client {
    /// # Errors
    /// Where the connection cannot be set up.
    pub(super) fn new(stream: TcpStream, address: SocketAddr, sensors: bool, stall: Duration) -> io::Result<Self> {
        // Some systems hand the listener's mode on.
        stream.set_nonblocking(false)?;
        stream.set_nodelay(true)?;
        stream.set_write_timeout(Some(stall))?;
        socket2::SockRef::from(&stream).set_send_buffer_size(SEND_BUFFER)?;
        let streams = Kind::ALL.map(|kind| match kind {
            Kind::Transform | Kind::Text => true,
            Kind::Position | Kind::Sensor => sensors,
            // Sent when it changes.
            Kind::Status => false,
        });
        let outgoing =
            Outgoing { states: VecDeque::new(), answers: VecDeque::new(), streams, status: None, closed: false };
        Ok(Client { address, stream, outgoing: Mutex::new(outgoing), changed: Condvar::new() })
    }

    fn outgoing(&self) -> MutexGuard<'_, Outgoing> {
        self.outgoing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Gives it a state to send; returns how many older ones are lost.
    pub(super) fn push(&self, frame: &Arc<Frame>) -> usize {
        let mut outgoing = self.outgoing();
        let mut lost = 0;
        if outgoing.states.len() == STATES {
            lost = STATES;
            outgoing.states.clear();
        }
        outgoing.states.push_back(frame.clone());
        self.changed.notify_one();
        lost
    }

    fn answer(&self, message: Vec<u8>) {
        let mut outgoing = self.outgoing();
        if outgoing.answers.len() < ANSWERS {
            outgoing.answers.push_back(message);
            self.changed.notify_one();
        }
    }

    fn is_closed(&self) -> bool {
        self.outgoing().closed
    }

    /// Ends the connection, and with it both threads; false where it was ended before.
    pub(super) fn close(&self) -> bool {
        let mut outgoing = self.outgoing();
        let first = !outgoing.closed;
        outgoing.closed = true;
        self.changed.notify_one();
        // It may have gone by itself.
        let _ = self.stream.shutdown(Shutdown::Both);
        first
    }

    /// The bytes to send next; waits for them. `None` once the connection is ended.
    fn next(&self) -> Option<Vec<u8>> {
        let mut outgoing = self.outgoing();
        loop {
            if outgoing.closed {
                return None;
            }
            if let Some(answer) = outgoing.answers.pop_front() {
                return Some(answer);
            }
            if let Some(frame) = outgoing.states.pop_front() {
                let mut bytes = Vec::new();
                if outgoing.status != Some(frame.status) {
                    outgoing.status = Some(frame.status);
                    bytes.extend(frame.of(Kind::Status));
                }
                for kind in Kind::ALL {
                    if outgoing.streams[kind as usize] {
                        bytes.extend(frame.of(kind));
                    }
                }
                return Some(bytes);
            }
            outgoing = self.changed.wait(outgoing).unwrap_or_else(PoisonError::into_inner);
        }
    }

    /// Sends what waits until the connection ends.
    fn send(&self) -> io::Result<()> {
        while let Some(bytes) = self.next() {
            let mut rest = &bytes[..];
            while !rest.is_empty() {
                // Each call waits anew: only a client that takes nothing at all for the whole time runs into the limit.
                match (&self.stream).write(rest) {
                    Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
                    Ok(count) => rest = &rest[count..],
                    Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(())
    }
}

/// Serves a client until it goes, sends what is wrong, takes nothing for too long, or the server ends.
pub(super) fn serve(shared: &Shared, client: &Arc<Client>) {
    let address = client.address;
    thread::scope(|scope| {
        let sender = worker("link sender").spawn_scoped(scope, || {
            let Err(error) = client.send() else { return };
            if client.close() {
                match error.kind() {
                    io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut => {
                        shared.counters.closed.fetch_add(1, Ordering::Relaxed);
                        log::warn!("OpenIGTLink client {address} takes nothing any more; connection closed");
                    }
                    _ => log::info!("OpenIGTLink client {address} left"),
                }
            }
        });
        if let Err(error) = sender {
            client.close();
            log::warn!("OpenIGTLink client {address}: no thread for it ({error}); connection closed");
            return;
        }
        let ended = receive(shared, client);
        if client.close() {
            match ended {
                Ok(()) => log::info!("OpenIGTLink client {address} left"),
                Err(error) => {
                    shared.counters.closed.fetch_add(1, Ordering::Relaxed);
                    log::warn!("OpenIGTLink client {address}: connection closed: {error}");
                }
            }
        }
    });
}

/// Reads what the client sends until it goes.
fn receive(shared: &Shared, client: &Arc<Client>) -> crate::Result<()> {
    let wanted = |meaning| matches!(meaning, Meaning::Data(Kind::Transform) | Meaning::Request(..));
    let (mut told_denied, mut told_wrong) = (false, false);
    let mut allowance = Allowance::default();
    loop {
        let time = shared.options.message_timeout;
        let mut source = Timed { client, allowance: &mut allowance, time, end: None };
        let Some(Received { header, content }) = read::message(&mut source, wanted, true)? else { return Ok(()) };
        match content {
            Some(Content::Request(verb, kind)) => request(shared, client, verb, kind),
            Some(Content::Transform(_)) if !shared.options.allow_control => {
                shared.counters.denied.fetch_add(1, Ordering::Relaxed);
                // Once is enough: it may send sixty of them a second.
                if !std::mem::replace(&mut told_denied, true) {
                    log::warn!("OpenIGTLink client {} may not move the needle", client.address);
                    let text = "this Stylet takes no poses: control is not allowed";
                    refuse(client, Status::ACCESS_DENIED, "access denied", text);
                }
            }
            Some(Content::Transform(transform)) if header.device == NEEDLE_CONTROL => match Pose::of(&transform) {
                Ok(pose) => shared.want(pose, client),
                Err(reason) => {
                    shared.counters.wrong_poses.fetch_add(1, Ordering::Relaxed);
                    if !std::mem::replace(&mut told_wrong, true) {
                        log::warn!("OpenIGTLink client {}: a pose is refused: {reason}", client.address);
                        refuse(client, Status::ILLEGAL_INSTRUCTION, "pose refused", &format!("pose refused: {reason}"));
                    }
                }
            },
            _ => skipped(shared, &header),
        }
    }
}

fn skipped(shared: &Shared, header: &Header) {
    shared.counters.skipped.fetch_add(1, Ordering::Relaxed);
    log::debug!("OpenIGTLink: {} of {:?} is skipped", header.type_name, header.device);
}

fn refuse(client: &Client, code: u16, name: &str, text: &str) {
    let status = Status { code, subcode: 0, name: name.into(), text: text.into() };
    client.answer(Content::Status(status).encode(STYLET, timestamp(SystemTime::now())));
}

/// Does what a client asks for.
fn request(shared: &Shared, client: &Client, verb: Verb, kind: Kind) {
    let granted = |yes| client.answer(Content::Answer(kind, yes).encode(STYLET, timestamp(SystemTime::now())));
    match verb {
        Verb::Get => match shared.newest() {
            Some(frame) => client.answer(frame.of(kind).to_vec()),
            None if kind == Kind::Status => refuse(client, Status::NOT_READY, "not ready", "no state yet"),
            None => granted(false),
        },
        // The specification has neither for a STATUS, which is sent when it changes.
        Verb::Start | Verb::Stop if kind == Kind::Status => granted(false),
        Verb::Start | Verb::Stop => {
            client.outgoing().streams[kind as usize] = verb == Verb::Start;
            granted(true);
        }
    }
}

/// What a client may still send at once [byte]; it grows with time.
struct Allowance {
    bytes: f64,
    at: Instant,
}

impl Default for Allowance {
    fn default() -> Self {
        Allowance { bytes: AT_ONCE, at: Instant::now() }
    }
}

impl Allowance {
    /// Takes bytes that came; how long to wait before more are read.
    fn take(&mut self, count: usize) -> Duration {
        let now = Instant::now();
        self.bytes = (self.bytes + RATE * now.duration_since(self.at).as_secs_f64()).min(AT_ONCE) - count as f64;
        self.at = now;
        Duration::from_secs_f64((-self.bytes / RATE).max(0.0))
    }
}

/// A stream that waits for a message as long as it takes, and then for the rest of it no longer than `time`; what the server makes a
/// client wait does not count.
struct Timed<'a> {
    client: &'a Client,
    allowance: &'a mut Allowance,
    time: Duration,
    /// When the whole message must be there; `None` before its first byte.
    end: Option<Instant>,
}

impl Read for Timed<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let left = self.end.map(|end| end.saturating_duration_since(Instant::now()));
        if left == Some(Duration::ZERO) {
            return Err(io::ErrorKind::TimedOut.into());
        }
        self.client.stream.set_read_timeout(left)?;
        let count = (&self.client.stream).read(bytes)?;
        let begins = self.end.is_none();
        let end = self.end.get_or_insert_with(|| Instant::now() + self.time);
        let mut wait = self.allowance.take(if begins { count + MESSAGE } else { count });
        *end += wait;
        while !wait.is_zero() && !self.client.is_closed() {
            let pause = wait.min(PAUSE);
            thread::sleep(pause);
            wait -= pause;
        }
        Ok(count)
    }
}
