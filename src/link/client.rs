//! One client: what waits for it, and how that is sent.

use std::collections::VecDeque;
use std::io::{self, Write};
use std::net::{Shutdown, SocketAddr, TcpStream};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime};

use super::message::{Kind, timestamp};
use super::state::LinkState;

/// States that wait for a client at most; one that is so far behind loses all but the newest.
pub const STATES: usize = 8;

/// Answers that wait for a client at most; one that asks on without reading gets no more.
pub const ANSWERS: usize = 16;

/// Send buffer that is asked for [byte]. Systems take megabytes where nobody asks, and a slow client would see states that are
/// minutes old.
const SEND_BUFFER: usize = 16 << 10;

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

    pub(super) fn of(&self, kind: Kind) -> &[u8] {
        &self.messages[kind as usize]
    }
}

/// What waits for a client, and what it wants.
pub(super) struct Outgoing {
    states: VecDeque<Arc<Frame>>,
    answers: VecDeque<Vec<u8>>,
    /// Kinds of messages that it gets of each state, in the order of [`Kind::ALL`].
    pub(super) streams: [bool; 5],
    /// The [`Frame::status`] that it was told last.
    status: Option<u64>,
    closed: bool,
}

/// A client as the server knows it.
pub(super) struct Client {
    pub(super) address: SocketAddr,
    pub(super) stream: TcpStream,
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

    pub(super) fn outgoing(&self) -> MutexGuard<'_, Outgoing> {
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

    pub(super) fn answer(&self, message: Vec<u8>) {
        let mut outgoing = self.outgoing();
        if outgoing.answers.len() < ANSWERS {
            outgoing.answers.push_back(message);
            self.changed.notify_one();
        }
    }

    pub(super) fn is_closed(&self) -> bool {
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
    pub(super) fn send(&self) -> io::Result<()> {
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
