//! The OpenIGTLink server as clients meet it: plain sockets, good and bad, and a real peer in Python.
//!
//! The peer needs `python3` with the package `pyigtl`; `REQUIRE_PYIGTL=1` turns its absence into a failure.
#![cfg(feature = "link")]

use std::io::{ErrorKind, Read, Write};
use std::net::{Shutdown, TcpListener, TcpStream};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use glam::{DMat3, DVec3};
use stylet::link::message::{Content, HEADER, Kind, MILLIMETRE, NEWTON, Sensor, Status, Transform, Verb};
use stylet::link::read::{self, LARGEST_BODY, Received};
use stylet::link::{ANSWERS, CLIENTS, LinkOptions, LinkServer, LinkState, Pose, RunState, STATES, basis_along};

/// Longest time for anything that has to happen.
const PATIENCE: Duration = Duration::from_secs(60);

fn options() -> LinkOptions {
    LinkOptions { port: 0, ..Default::default() }
}

fn server(options: LinkOptions) -> LinkServer {
    LinkServer::start(options).unwrap()
}

fn state(time: f64) -> LinkState {
    let direction = DVec3::new(0.2, -0.1, -1.0).normalize();
    LinkState {
        time,
        pose: Pose { tip: DVec3::new(0.001, 0.002, -0.03), rotation: basis_along(direction) },
        axial_force: 0.8125,
        lateral_force: 0.0625,
        depth: 0.03125,
        run: RunState::Running,
        text: "muscle_biopsy".into(),
    }
}

fn until(what: &str, mut happens: impl FnMut() -> bool) {
    let begin = Instant::now();
    while !happens() {
        assert!(begin.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// A client without any library.
struct Peer(TcpStream);

impl Peer {
    fn connect(server: &LinkServer) -> Peer {
        let stream = TcpStream::connect(server.address()).unwrap();
        stream.set_read_timeout(Some(PATIENCE)).unwrap();
        Peer(stream)
    }

    /// Connected, and known to the server.
    fn known(server: &LinkServer) -> Peer {
        let before = server.counters().clients;
        let peer = Peer::connect(server);
        until("a client is taken", || server.counters().clients > before);
        peer
    }

    fn send(&mut self, bytes: &[u8]) {
        self.0.write_all(bytes).unwrap();
    }

    /// The next message: device and content.
    fn next(&mut self) -> (String, Content) {
        let Received { header, content } = read::message(&mut self.0, |_| true, true).unwrap().expect("a message");
        (header.device, content.expect("a known type"))
    }

    /// The next message of a device.
    fn next_of(&mut self, device: &str) -> Content {
        loop {
            let (found, content) = self.next();
            if found == device {
                return content;
            }
        }
    }

    fn next_status(&mut self) -> Status {
        match self.next_of("Stylet") {
            Content::Status(status) => status,
            other => panic!("{other:?}"),
        }
    }

    /// Time of the next state [s].
    fn next_time(&mut self) -> f64 {
        let Content::Text(text) = self.next_of("NeedleState") else { panic!("no STRING") };
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        json["time_s"].as_f64().unwrap()
    }

    /// Waits for the end of the connection.
    fn is_closed(&mut self) {
        let mut bytes = [0; 4096];
        loop {
            match self.0.read(&mut bytes) {
                Ok(0) => return,
                Ok(_) => {}
                // The server had not read all that was sent.
                Err(error) if error.kind() == ErrorKind::ConnectionReset => return,
                Err(error) => panic!("the connection stays open: {error}"),
            }
        }
    }
}

fn request(verb: Verb, kind: Kind) -> Vec<u8> {
    Content::Request(verb, kind).encode("", 0)
}

fn control(tip_mm: DVec3) -> Vec<u8> {
    let rotation = basis_along(DVec3::NEG_Z);
    Content::Transform(Transform { rotation, translation: tip_mm }).encode("NeedleControl", 0)
}

/// A message of any type with any body.
fn message(type_name: &str, body: &[u8]) -> Vec<u8> {
    let mut bytes = Content::Request(Verb::Get, Kind::Status).encode("device", 0);
    bytes[2..14].fill(0);
    bytes[2..2 + type_name.len()].copy_from_slice(type_name.as_bytes());
    bytes[42..50].copy_from_slice(&(body.len() as u64).to_be_bytes());
    bytes[50..58].copy_from_slice(&stylet::link::crc::crc64(body).to_be_bytes());
    bytes.extend(body);
    bytes
}

#[test]
fn states_reach_every_client() {
    let server = server(options());
    let mut first = Peer::known(&server);
    server.publish(&state(0.5));
    // This one comes later and is told the newest state all the same.
    let mut second = Peer::known(&server);
    for peer in [&mut first, &mut second] {
        let status = peer.next_status();
        assert_eq!((status.code, status.name.as_str(), status.text.as_str()), (Status::OK, "running", "muscle_biopsy"));
    }
    server.publish(&state(1.0));
    for peer in [&mut first, &mut second] {
        let Content::Transform(transform) = peer.next_of("Needle") else { panic!() };
        // f32 on the way.
        assert!((transform.translation - DVec3::new(1.0, 2.0, -30.0)).length() < 1e-5);
        assert!((transform.rotation.z_axis - DVec3::new(0.2, -0.1, -1.0).normalize()).length() < 1e-6);
        let Content::Text(text) = peer.next_of("NeedleState") else { panic!() };
        let json: serde_json::Value = serde_json::from_str(&text).unwrap();
        let number = |key: &str| json[key].as_f64().unwrap();
        assert_eq!((number("axial_force_n"), number("lateral_force_n")), (0.8125, 0.0625));
        assert_eq!((number("depth_mm"), number("time_s")), (31.25, 0.5));
        // The STATUS did not change: it is not sent again.
        assert_eq!(peer.next().0, "Needle");
        assert_eq!(peer.next_time(), 1.0);
    }
    server.publish(&LinkState { run: RunState::Stopped, text: "inverted element".into(), ..state(1.5) });
    for peer in [&mut first, &mut second] {
        let status = peer.next_status();
        assert_eq!((status.code, status.text.as_str()), (Status::DISABLED, "inverted element"));
        assert_eq!(peer.next_time(), 1.5);
    }
    // What is no number is not sent.
    server.publish(&LinkState { axial_force: f64::NAN, ..state(2.0) });
    server.publish(&state(2.5));
    assert_eq!(first.next_time(), 2.5);
    assert_eq!(server.counters().unsent_states, 1);
}

#[test]
fn sensors_reach_who_asks_for_them() {
    let server = server(options());
    let mut peer = Peer::known(&server);
    let mut other = Peer::known(&server);
    peer.send(&request(Verb::Get, Kind::Status));
    assert_eq!(peer.next_status().code, Status::NOT_READY);
    peer.send(&request(Verb::Get, Kind::Sensor));
    assert_eq!(peer.next().1, Content::Answer(Kind::Sensor, false));
    peer.send(&request(Verb::Start, Kind::Sensor));
    assert_eq!(peer.next().1, Content::Answer(Kind::Sensor, true));
    peer.send(&request(Verb::Start, Kind::Position));
    assert_eq!(peer.next().1, Content::Answer(Kind::Position, true));
    peer.send(&request(Verb::Stop, Kind::Transform));
    assert_eq!(peer.next().1, Content::Answer(Kind::Transform, true));
    peer.send(&request(Verb::Start, Kind::Status));
    assert_eq!(peer.next().1, Content::Answer(Kind::Status, false));
    server.publish(&state(0.5));
    let devices: Vec<String> = (0..5).map(|_| peer.next().0).collect();
    assert_eq!(devices, ["Stylet", "NeedlePosition", "NeedleForce", "NeedleDepth", "NeedleState"]);
    peer.send(&request(Verb::Stop, Kind::Sensor));
    assert_eq!(peer.next().1, Content::Answer(Kind::Sensor, true));
    // Asked for once.
    peer.send(&request(Verb::Get, Kind::Sensor));
    assert_eq!(peer.next().1, Content::Sensor(Sensor { unit: NEWTON, values: vec![0.8125, 0.0625] }));
    assert_eq!(peer.next().1, Content::Sensor(Sensor { unit: MILLIMETRE, values: vec![31.25] }));
    peer.send(&request(Verb::Get, Kind::Status));
    assert_eq!(peer.next_status().code, Status::OK);
    // Nobody else gets them.
    let devices: Vec<String> = (0..3).map(|_| other.next().0).collect();
    assert_eq!(devices, ["Stylet", "Needle", "NeedleState"]);
    server.publish(&state(1.0));
    assert_eq!(other.next().0, "Needle");
}

#[test]
fn sensors_may_be_sent_to_everybody() {
    let server = server(LinkOptions { sensors: true, ..options() });
    let mut peer = Peer::known(&server);
    server.publish(&state(0.5));
    let Content::Position(position, orientation) = peer.next_of("NeedlePosition") else { panic!() };
    assert!((position - DVec3::new(1.0, 2.0, -30.0)).length() < 1e-5);
    // f32 on the way.
    assert!((orientation * DVec3::Z - state(0.0).pose.direction()).length() < 1e-6);
    let force = peer.next_of("NeedleForce");
    assert_eq!(force, Content::Sensor(Sensor { unit: NEWTON, values: vec![0.8125, 0.0625] }));
}

#[test]
fn what_is_no_message_ends_its_connection_only() {
    let server = server(LinkOptions { allow_control: true, ..options() });
    let mut good = Peer::known(&server);
    let whole = control(DVec3::NEG_Z);
    let changed = |at: usize, value: u8| {
        let mut bytes = whole.clone();
        bytes[at] = value;
        bytes
    };
    let mut huge = message("IMAGE", b"");
    huge[42..50].copy_from_slice(&(LARGEST_BODY + 1).to_be_bytes());
    let mut boundless = message("TRANSFORM", b"");
    boundless[42..50].fill(0xff);
    let garbage: Vec<u8> = (0..1_000_000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8).collect();
    let bad = [
        ("version 0", changed(1, 0)),
        ("version 3", changed(1, 3)),
        ("checksum", changed(HEADER, 0x40)),
        ("checksum of a skipped message", {
            let mut bytes = message("IMAGE", b"abc");
            *bytes.last_mut().unwrap() = b'd';
            bytes
        }),
        ("size", message("TRANSFORM", &[0; 47])),
        ("size of a request", message("GET_STATUS", &[0; 100])),
        ("name of the type", changed(2, b'\n')),
        ("huge", huge),
        ("boundless", boundless),
        ("another protocol", format!("GET / HTTP/1.1\r\nHost: {:100}\r\n\r\n", "stylet").into_bytes()),
        ("garbage", garbage),
        ("zeros", vec![0; 100_000]),
    ];
    for (n, (what, bytes)) in bad.iter().enumerate() {
        let mut peer = Peer::connect(&server);
        // The server may end the connection before all is written.
        let _ = peer.0.write_all(bytes);
        peer.is_closed();
        until(what, || server.counters().closed == n as u64 + 1);
        server.publish(&state(n as f64));
        assert_eq!(good.next_time(), n as f64, "{what}");
    }
    assert!(server.wanted_pose().is_none());
    // Half a message and gone.
    for end in [1, 57, 58, 100] {
        let before = server.counters().closed;
        let mut peer = Peer::connect(&server);
        peer.send(&whole[..end]);
        peer.0.shutdown(Shutdown::Write).unwrap();
        peer.is_closed();
        until("half a message", || server.counters().closed == before + 1);
    }
    until("they are gone", || server.counters().clients == 1);
}

#[test]
fn unknown_types_are_skipped() {
    let server = server(LinkOptions { allow_control: true, ..options() });
    let mut peer = Peer::known(&server);
    peer.send(&message("IMAGE", &vec![7; LARGEST_BODY as usize]));
    peer.send(&message("X", b""));
    // Known, but of no use here; pyigtl's POSITION is larger than the specification's.
    peer.send(&message("POSITION", &[0; 172]));
    peer.send(&Content::Text("text".into()).encode("x", 0));
    peer.send(&request(Verb::Get, Kind::Status));
    assert_eq!(peer.next_status().code, Status::NOT_READY);
    assert_eq!((server.counters().skipped, server.counters().closed), (4, 0));
}

#[test]
fn a_begun_message_must_be_ended() {
    let server = server(LinkOptions { message_timeout: Duration::from_millis(300), ..options() });
    let mut idle = Peer::known(&server);
    let mut half = Peer::known(&server);
    half.send(&control(DVec3::NEG_Z)[..70]);
    half.is_closed();
    until("half a message is gone", || server.counters().clients == 1);
    // Every byte comes in time, the message does not.
    let mut dripping = Peer::known(&server);
    let begin = Instant::now();
    let drips = message("IMAGE", &[0; 100_000]);
    let mut drips = drips.iter();
    while let Some(byte) = drips.next()
        && dripping.0.write_all(&[*byte]).is_ok()
    {
        assert!(begin.elapsed() < PATIENCE, "the server is patient");
        std::thread::sleep(Duration::from_millis(2));
    }
    dripping.is_closed();
    assert!(drips.next().is_some(), "the whole message was taken");
    until("both are closed", || server.counters().closed == 2);
    // Who says nothing at all stays.
    server.publish(&state(0.5));
    assert_eq!(idle.next_time(), 0.5);
}

/// Four clients that send as fast as they can are read no faster than is needed, and a fifth one is served meanwhile.
#[test]
fn a_flood_is_not_read_as_fast_as_it_comes() {
    let server = server(options());
    let mut quiet = Peer::known(&server);
    let stop = std::sync::atomic::AtomicBool::new(false);
    let body = message("IMAGE", &vec![7; LARGEST_BODY as usize]);
    let small = message("X", b"").repeat(1000);
    let (begin, mut states) = (Instant::now(), 0);
    let sent: Vec<usize> = std::thread::scope(|scope| {
        let flood = |bytes: &'static [u8]| {
            let peer = Peer::known(&server);
            peer.0.set_write_timeout(Some(Duration::from_millis(100))).unwrap();
            let stop = &stop;
            scope.spawn(move || {
                let mut sent = 0;
                while !stop.load(std::sync::atomic::Ordering::Relaxed) {
                    for piece in bytes.chunks(4096) {
                        // Messages are cut nowhere: a piece that does not go is tried again.
                        let mut rest = piece;
                        while !rest.is_empty() && !stop.load(std::sync::atomic::Ordering::Relaxed) {
                            match (&peer.0).write(rest) {
                                Ok(count) => (sent, rest) = (sent + count, &rest[count..]),
                                Err(error) => assert!(
                                    matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut),
                                    "the flood is ended: {error}"
                                ),
                            }
                        }
                    }
                }
                sent
            })
        };
        let (body, small): (&'static [u8], &'static [u8]) = (body.leak(), small.leak());
        let floods = [flood(body), flood(body), flood(small), flood(small)];
        while begin.elapsed() < Duration::from_secs(3) {
            states += 1;
            server.publish(&state(f64::from(states)));
            assert_eq!(quiet.next_time(), f64::from(states));
            std::thread::sleep(Duration::from_millis(10));
        }
        // The floods end in the middle of a message, which ends their connections.
        assert_eq!(server.counters().closed, 0);
        stop.store(true, std::sync::atomic::Ordering::Relaxed);
        floods.map(|flood| flood.join().unwrap()).to_vec()
    });
    assert!(states > 50, "{states} states in 3 s");
    // 2 MiB a second and 1 MiB at once, and what waits in the buffers of the system.
    for (sent, most) in sent.iter().zip([24 << 20, 24 << 20, 16 << 20, 16 << 20]) {
        assert!(*sent < most, "{sent:?} bytes of {most} in 3 s");
    }
}

#[test]
fn the_ninth_client_is_turned_away() {
    let server = server(options());
    let mut peers: Vec<Peer> = (0..CLIENTS).map(|_| Peer::known(&server)).collect();
    let mut ninth = Peer::connect(&server);
    let status = ninth.next_status();
    assert_eq!(status.code, Status::BUSY);
    assert!(status.text.contains("8 clients"));
    ninth.is_closed();
    assert_eq!(server.counters().refused_clients, 1);
    server.publish(&state(0.5));
    for peer in &mut peers {
        assert_eq!(peer.next_time(), 0.5);
    }
    // One goes, another may come.
    peers.pop();
    until("a place is free", || server.counters().clients < CLIENTS);
    let mut late = Peer::known(&server);
    assert_eq!(late.next_time(), 0.5);
}

#[test]
fn a_slow_client_loses_old_states() {
    let server = server(options());
    let mut slow = Peer::known(&server);
    let mut quick = Peer::known(&server);
    let mut time = 0.0;
    while server.counters().lost_states < 100 * STATES as u64 {
        time += 1.0;
        server.publish(&state(time));
        // This one reads along and loses nothing.
        assert_eq!(quick.next_time(), time);
        assert!(time < 1e6, "nothing is ever lost");
    }
    server.publish(&state(time + 1.0));
    let (mut last, mut count) = (0.0, 0);
    while last < time + 1.0 {
        let next = slow.next_time();
        assert!(next > last, "{next} after {last}");
        (last, count) = (next, count + 1);
    }
    println!("{time} states, {count} of them reached a client that did not read");
    assert!(f64::from(count) < time - 700.0);
    assert_eq!(server.counters().clients, 2);
    // Nobody reads now: publishing goes on as before.
    let begin = Instant::now();
    (0..1000).for_each(|n| server.publish(&state(time + 2.0 + f64::from(n))));
    println!("{:.1} us per state", begin.elapsed().as_secs_f64() * 1e3);
}

#[test]
fn a_client_that_takes_nothing_is_given_up() {
    let server = server(LinkOptions { stall_timeout: Duration::from_millis(200), ..options() });
    let peer = Peer::known(&server);
    let mut time = 0.0;
    until("it is given up", || {
        time += 1.0;
        server.publish(&state(time));
        server.counters().clients == 0
    });
    until("it is counted", || server.counters().closed == 1);
    drop(peer);
}

/// Answers that nobody reads do not pile up.
#[test]
fn who_asks_without_reading_gets_few_answers() {
    let server = server(options());
    let mut peer = Peer::known(&server);
    server.publish(&LinkState { text: "x".repeat(1000), ..state(0.5) });
    let many = request(Verb::Get, Kind::Status).repeat(20_000);
    peer.send(&many);
    // Behind them all: an unknown type, so that it is seen when they are read.
    peer.send(&message("X", b""));
    until("all are read", || server.counters().skipped == 1);
    server.publish(&state(1.0));
    let mut answers = 0;
    loop {
        match peer.next() {
            (device, Content::Status(_)) if device == "Stylet" => answers += 1,
            (device, Content::Text(text)) if device == "NeedleState" && text.contains("1.0") => break,
            _ => {}
        }
    }
    println!("{answers} answers to 20000 requests");
    assert!((ANSWERS..20_000).contains(&answers));
}

#[test]
fn nobody_moves_the_needle_without_leave() {
    let server = server(options());
    let mut peer = Peer::known(&server);
    for _ in 0..3 {
        peer.send(&control(DVec3::new(1.0, 2.0, -3.0)));
    }
    peer.send(&request(Verb::Get, Kind::Status));
    let status = peer.next_status();
    assert_eq!((status.code, status.name.as_str()), (Status::ACCESS_DENIED, "access denied"));
    // Told once, counted every time.
    assert_eq!(peer.next_status().code, Status::NOT_READY);
    assert_eq!(server.counters().denied, 3);
    assert!(server.wanted_pose().is_none());
    // It is told, not thrown out.
    server.publish(&state(0.5));
    assert_eq!(peer.next_time(), 0.5);
}

#[test]
fn a_client_with_leave_moves_the_needle() {
    let server = server(LinkOptions { allow_control: true, ..options() });
    let mut peer = Peer::known(&server);
    assert!(server.wanted_pose().is_none());
    peer.send(&control(DVec3::new(1.0, 2.0, -3.0)));
    until("a pose", || server.wanted_pose().is_some());
    let wanted = server.wanted_pose().unwrap();
    assert!((wanted.pose.tip - DVec3::new(0.001, 0.002, -0.003)).length() < 1e-9);
    assert_eq!((wanted.pose.direction(), wanted.number, wanted.connected), (DVec3::NEG_Z, 1, true));
    // Another device is not meant.
    let rotation = basis_along(DVec3::NEG_Z);
    peer.send(&Content::Transform(Transform { rotation, translation: DVec3::ZERO }).encode("Probe", 0));
    // Poses that are none are told once and counted every time.
    for wrong in [
        Transform { rotation, translation: DVec3::new(f64::NAN, 0.0, 0.0) },
        Transform { rotation: rotation * 2.0, translation: DVec3::ZERO },
        Transform { rotation: DMat3::from_diagonal(DVec3::new(1.0, 1.0, -1.0)), translation: DVec3::ZERO },
        Transform { rotation, translation: DVec3::new(0.0, 0.0, -5000.0) },
    ] {
        peer.send(&Content::Transform(wrong).encode("NeedleControl", 0));
    }
    peer.send(&request(Verb::Get, Kind::Status));
    let status = peer.next_status();
    assert_eq!(status.code, Status::ILLEGAL_INSTRUCTION);
    assert!(status.text.contains("finite"), "{}", status.text);
    assert_eq!(peer.next_status().code, Status::NOT_READY);
    let counters = server.counters();
    assert_eq!((counters.wrong_poses, counters.skipped), (4, 1));
    assert_eq!(server.wanted_pose().unwrap().number, 1);
    // The newest counts, whoever sends it.
    let mut other = Peer::known(&server);
    other.send(&control(DVec3::new(0.0, 0.0, -9.0)));
    until("a newer pose", || server.wanted_pose().unwrap().number == 2);
    assert!((server.wanted_pose().unwrap().pose.tip.z + 0.009).abs() < 1e-9);
    drop(peer);
    until("one is gone", || server.counters().clients == 1);
    assert!(server.wanted_pose().unwrap().connected);
    drop(other);
    until("both are gone", || !server.wanted_pose().unwrap().connected);
    assert_eq!(server.wanted_pose().unwrap().number, 2);
}

#[test]
fn the_end_closes_everything() {
    let server = server(options());
    let address = server.address();
    assert!(address.ip().is_loopback());
    let mut peers: Vec<Peer> = (0..3).map(|_| Peer::known(&server)).collect();
    // One of them in the midst of a message, one that does not read, so that its sender waits.
    peers[0].send(&control(DVec3::NEG_Z)[..30]);
    let mut time = 0.0;
    while server.counters().lost_states == 0 {
        time += 1.0;
        server.publish(&state(time));
    }
    let begin = Instant::now();
    drop(server);
    assert!(begin.elapsed() < PATIENCE / 2, "{:?}", begin.elapsed());
    peers.iter_mut().for_each(Peer::is_closed);
    drop(peers);
    drop(TcpListener::bind(address).expect("the port is free"));
    let again = LinkServer::start(LinkOptions { port: address.port(), ..options() }).unwrap();
    assert_eq!(again.address(), address);
}

#[test]
fn a_place_that_cannot_be_had_is_told() {
    let taken = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = taken.local_addr().unwrap().port();
    let refused = |options| {
        let error = LinkServer::start(options).err().expect("an error");
        assert_eq!(error.exit_code(), 2);
        error.to_string()
    };
    let text = refused(LinkOptions { port, ..options() });
    assert!(text.contains(&port.to_string()) && text.contains("way out") && text.contains("--link-port"), "{text}");
    // An address for documentation only (RFC 5737).
    let text = refused(LinkOptions { address: "192.0.2.1".parse().unwrap(), ..options() });
    assert!(text.contains("192.0.2.1") && text.contains("--link-address"), "{text}");
    let usual = LinkOptions::default();
    assert!(usual.address.is_loopback() && usual.port == 18944 && !usual.allow_control);
}

fn has_pyigtl() -> bool {
    let import = Command::new("python3").args(["-c", "import pyigtl"]).stderr(Stdio::null()).status();
    let found = import.is_ok_and(|status| status.success());
    let required = std::env::var("REQUIRE_PYIGTL").is_ok_and(|v| v == "1");
    assert!(found || !required, "REQUIRE_PYIGTL=1, and python3 cannot import pyigtl");
    found
}

/// A 4x4 matrix as rows, lengths in mm.
fn matrix(pose: &Pose) -> serde_json::Value {
    let (r, t) = (pose.rotation, pose.tip * 1e3);
    serde_json::json!([
        [r.x_axis.x, r.y_axis.x, r.z_axis.x, t.x],
        [r.x_axis.y, r.y_axis.y, r.z_axis.y, t.y],
        [r.x_axis.z, r.y_axis.z, r.z_axis.z, t.z],
        [0.0, 0.0, 0.0, 1.0]
    ])
}

#[test]
fn pyigtl_reads_the_needle_and_moves_it() {
    if !has_pyigtl() {
        println!("skipped: python3 cannot import pyigtl");
        return;
    }
    // SENSOR and POSITION, which pyigtl does not read, must not disturb it.
    let server = server(LinkOptions { allow_control: true, sensors: true, ..options() });
    let mut now = state(0.0);
    let direction = DVec3::new(-0.3, 0.1, -0.9).normalize();
    let wanted = Pose { tip: DVec3::new(-0.004, 0.005, -0.012), rotation: basis_along(direction) };
    let expected = serde_json::json!({
        "matrix": matrix(&now.pose),
        "axial_force_n": now.axial_force,
        "lateral_force_n": now.lateral_force,
        "depth_mm": now.depth * 1e3,
        "wanted": matrix(&wanted),
    });
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/link/peer.py");
    let mut peer = Command::new("python3")
        .args([script, &server.address().port().to_string(), &expected.to_string()])
        .spawn()
        .expect("python3 starts");
    let begin = Instant::now();
    let status = loop {
        if let Some(status) = peer.try_wait().unwrap() {
            break status;
        }
        if begin.elapsed() > 4 * PATIENCE {
            let _ = peer.kill();
            panic!("the peer does not end");
        }
        now.time += 1.0 / 60.0;
        if let Some(asked) = server.wanted_pose() {
            now.pose = asked.pose;
        }
        server.publish(&now);
        std::thread::sleep(Duration::from_millis(16));
    };
    assert!(status.success(), "the peer failed, see above");
    let asked = server.wanted_pose().expect("a pose");
    assert!((asked.pose.tip - wanted.tip).length() < 1e-8);
    assert!((asked.pose.direction() - direction).length() < 1e-6);
    let counters = server.counters();
    assert_eq!((counters.closed, counters.wrong_poses, counters.skipped), (0, 0, 0));
}
