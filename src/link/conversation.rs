//! What a client sends, and what it is answered.

use std::io::{self, Read};
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread;
use std::time::{Duration, Instant, SystemTime};

use super::client::Client;
use super::message::{Content, Header, Kind, Meaning, Status, Verb, timestamp};
use super::read::{self, Received};
use super::shared::{Shared, worker};
use super::state::{NEEDLE_CONTROL, Pose, STYLET};

/// What a client may send [byte/s], and at once [byte]; a message counts as its bytes and [`MESSAGE`] more. A hand that leads at
/// 1 kHz sends a tenth of it. Whoever sends more is read more slowly and has to wait: reading and checking what nobody needs would
/// take the processor from the tissue.
const RATE: f64 = (2 << 20) as f64;
const AT_ONCE: f64 = (1 << 20) as f64;
const MESSAGE: usize = 512;

/// Longest pause without a look whether the connection is ended.
const PAUSE: Duration = Duration::from_millis(50);

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
