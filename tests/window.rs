//! The real window on a virtual display: real mouse and keys, pictures, closing in the middle.
//!
//! Needs `Xvfb` and `xdotool`; `REQUIRE_WINDOW=1` turns their absence into a failure.
#![cfg(feature = "window")]

use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use stylet::session::{SESSION, Session};

use crate::{common, debriefing, layout};

/// Two windows at once would share the cores, and keys and clicks would come before what they are meant for.
static ONE_AT_A_TIME: Mutex<()> = Mutex::new(());

/// A virtual display with its own number.
struct Display {
    _alone: MutexGuard<'static, ()>,
    server: Child,
    name: String,
    place: tempfile::TempDir,
}

impl Drop for Display {
    fn drop(&mut self) {
        let _ = self.server.kill();
        let _ = self.server.wait();
    }
}

fn has(program: &str) -> bool {
    let found = std::env::var_os("PATH").is_some_and(|p| std::env::split_paths(&p).any(|d| d.join(program).is_file()));
    let required = std::env::var("REQUIRE_WINDOW").is_ok_and(|v| v == "1");
    assert!(found || !required, "REQUIRE_WINDOW=1, and there is no {program}");
    found
}

impl Display {
    fn open() -> Option<Self> {
        if !has("Xvfb") || !has("xdotool") {
            println!("skipped: no Xvfb or xdotool");
            return None;
        }
        let alone = ONE_AT_A_TIME.lock().unwrap_or_else(PoisonError::into_inner);
        let place = tempfile::tempdir().unwrap();
        let numbers = place.path().join("number");
        // The server looks for a free number itself, and writes it once it takes connections.
        let file = std::fs::File::create(&numbers).unwrap();
        let server = Command::new("Xvfb")
            // A server begins anew when its last client goes, and meanwhile refuses others: here xdotool goes before the window has come.
            .args(["-displayfd", "1", "-screen", "0", "1280x800x24", "-nolisten", "tcp", "-noreset", "-fbdir"])
            .arg(place.path())
            .stdout(file)
            .stderr(Stdio::null())
            .spawn()
            .unwrap();
        let begin = Instant::now();
        let name = loop {
            let text = std::fs::read_to_string(&numbers).unwrap();
            if text.ends_with('\n') {
                break format!(":{}", text.trim());
            }
            assert!(begin.elapsed() < Duration::from_secs(30), "Xvfb gave no number");
            std::thread::sleep(Duration::from_millis(50));
        };
        Some(Display { _alone: alone, server, name, place })
    }

    fn path(&self, name: &str) -> PathBuf {
        self.place.path().join(name)
    }

    /// Keeps what the display shows as a PNG in the folder that the variable STYLET_PICTURES names, for people who look at the steps.
    fn keep_picture(&self, name: &str) {
        let Some(folder) = std::env::var_os("STYLET_PICTURES") else { return };
        // What came last has to be drawn.
        std::thread::sleep(Duration::from_millis(700));
        // The server keeps its picture as X window dump: a head of 32-bit numbers, a map of colours of 12 bytes each, lines of B, G, R, 0.
        let dump = std::fs::read(self.path("Xvfb_screen0")).unwrap();
        let number = |n: usize| u32::from_be_bytes(dump[4 * n..4 * n + 4].try_into().unwrap()) as usize;
        let (head, width, height, line, colours) = (number(0), number(4), number(5), number(12), number(19));
        let begin = head + 12 * colours;
        let mut pixels = Vec::with_capacity(4 * width * height);
        for row in dump[begin..].chunks_exact(line).take(height) {
            for pixel in row[..4 * width].chunks_exact(4) {
                pixels.extend([pixel[2], pixel[1], pixel[0], 255]);
            }
        }
        std::fs::create_dir_all(&folder).unwrap();
        let path = Path::new(&folder).join(format!("{name}.png"));
        stylet::render::write_png(&path, &pixels, width as u32, height as u32).unwrap();
    }

    /// A click at a place of the window [points, and pixels here].
    fn click(&self, at: egui::Pos2) {
        let [x, y] = [at.x, at.y].map(|x| format!("{x:.0}"));
        // The pointer rests first: a button is pressed where the pointer has been seen.
        self.xdotool(&["mousemove", &x, &y, "sleep", "0.3", "click", "1"]);
    }

    fn view(&self, arguments: &[&str]) -> Command {
        self.view_of("scenes/muscle_biopsy.toml", "tissue.cell_size_mm=1.0", arguments)
    }

    fn view_of(&self, scene: &str, change: &str, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_stylet"));
        command
            .current_dir(env!("CARGO_MANIFEST_DIR"))
            .env("DISPLAY", &self.name)
            .env_remove("WAYLAND_DISPLAY")
            .env("STYLET_SETTINGS", self.path("settings.toml"))
            .env("LANG", "C")
            .arg("view")
            .arg(scene)
            .args(["--set", change])
            .args(arguments);
        command
    }

    fn xdotool(&self, arguments: &[&str]) -> Output {
        Command::new("xdotool").env("DISPLAY", &self.name).args(arguments).output().unwrap()
    }

    /// Waits for the window of a program; without one the program's own words say why.
    fn wait(&self, program: &mut Child) {
        let begin = Instant::now();
        while !self.xdotool(&["search", "--name", "Stylet"]).status.success() {
            let ended = program.try_wait().unwrap();
            if ended.is_some() || begin.elapsed() > Duration::from_secs(120) {
                let _ = program.kill();
                let mut told = String::new();
                if let Some(out) = &mut program.stdout {
                    let _ = out.read_to_string(&mut told);
                }
                if let Some(errors) = &mut program.stderr {
                    let _ = errors.read_to_string(&mut told);
                }
                panic!("no window after {:?}, {ended:?}: {told}", begin.elapsed());
            }
            std::thread::sleep(Duration::from_millis(100));
        }
        self.focus();
    }

    /// Without a window manager nobody gives the window the keyboard.
    fn focus(&self) {
        self.xdotool(&["search", "--name", "Stylet", "windowfocus"]);
    }
}

/// Pixels of a PNG, RGBA, with its size.
fn picture(path: &Path) -> (Vec<[u8; 4]>, usize, usize) {
    let decoder = png::Decoder::new(std::io::BufReader::new(std::fs::File::open(path).unwrap()));
    let mut reader = decoder.read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    let pixels = bytes.chunks_exact(info.color_type.samples()).map(|p| [p[0], p[1], p[2], 255]).collect();
    (pixels, info.width as usize, info.height as usize)
}

#[test]
fn a_script_is_watched_and_a_picture_kept() {
    let Some(display) = Display::open() else { return };
    let shot = display.path("shot.png");
    let output =
        display.view(&["--script", "--frames", "60", "--screenshot", shot.to_str().unwrap()]).output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    assert!(told.contains("60 pictures"), "{told}");
    let (pixels, width, height) = picture(&shot);
    assert_eq!((width, height), (1280, 800));
    // The middle shows tissue in the colours of the scale, the rest is background: neither all nor nothing.
    let coloured = |p: &[u8; 4]| p[0].abs_diff(p[2]) > 25 || p[1].abs_diff(p[2]) > 25;
    let middle: Vec<[u8; 4]> =
        (200..600).flat_map(|y| (300..900).map(move |x| (x, y))).map(|(x, y)| pixels[y * width + x]).collect();
    let part = middle.iter().filter(|p| coloured(p)).count() as f64 / middle.len() as f64;
    assert!((0.2..1.0).contains(&part), "{part} of the middle is tissue");
}

#[test]
fn a_hand_leads_the_needle_and_its_session_is_kept() {
    let Some(display) = Display::open() else { return };
    let out = display.path("attempt");
    let mut child =
        display.view(&["--out", out.to_str().unwrap()]).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    display.wait(&mut child);
    // Play, two seconds of the tissue with "advance" held, the wheel, a drag that turns the view, pause, close. A slow machine gets
    // the time that it needs, and the first key again where the window was not ready for it.
    let rows = || std::fs::read_to_string(out.join("force.csv")).map_or(0, |t| t.lines().count().saturating_sub(1));
    let reached = |count: usize, patience: u64| {
        let begin = Instant::now();
        while rows() < count && begin.elapsed() < Duration::from_secs(patience) {
            std::thread::sleep(Duration::from_millis(50));
        }
        rows() >= count
    };
    let plays = (0..6).any(|_| {
        display.xdotool(&["key", "space"]);
        reached(1, 5)
    });
    assert!(plays, "the key did not start the tissue");
    display.xdotool(&["keydown", "Down"]);
    assert!(reached(120, 90), "{} frames", rows());
    display.xdotool(&["keyup", "Down"]);
    display.xdotool(&["mousemove", "620", "400", "click", "--repeat", "4", "5"]);
    display.xdotool(&["mousedown", "1", "mousemove_relative", "--", "60", "20", "mouseup", "1"]);
    std::thread::sleep(Duration::from_millis(1500));
    display.xdotool(&["search", "--name", "Stylet", "windowsize", "1000", "600"]);
    std::thread::sleep(Duration::from_millis(500));
    display.xdotool(&["key", "space"]);
    std::thread::sleep(Duration::from_millis(300));
    display.xdotool(&["key", "ctrl+q"]);
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        if begin.elapsed() > Duration::from_secs(20) {
            let _ = child.kill();
            break;
        }
        std::thread::sleep(Duration::from_millis(50));
    }
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{told}");
    // What was written is computed again from the session alone.
    let poses = Session::read(&out.join(SESSION)).unwrap().poses;
    let deepest = poses.iter().map(|p| p.depth).fold(0.0, f64::max);
    assert!(poses.len() > 30 && deepest > 1.5e-3, "{} poses, {deepest} m", poses.len());
    let again = display.path("again");
    let replayed = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["replay".as_ref(), out.as_os_str(), "--out".as_ref(), again.as_os_str()])
        .output()
        .unwrap();
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
    let table = |folder: &Path| std::fs::read_to_string(folder.join("force.csv")).unwrap();
    assert_eq!(table(&out), table(&again));
}

#[test]
fn without_a_display_there_is_a_message() {
    let output = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env_remove("DISPLAY")
        .env_remove("WAYLAND_DISPLAY")
        .arg("view")
        .output()
        .unwrap();
    let told = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(2), "{told}");
    assert!(told.contains("way out") && told.contains("stylet run"), "{told}");
    assert!(!told.contains("panicked") && !told.contains(".rs:"), "a place in a source: {told}");
}

#[test]
fn the_mouse_pushes_and_tilts_a_needle_on_a_free_path() {
    let Some(display) = Display::open() else { return };
    let out = display.path("attempt");
    let arguments = ["--frames", "100000", "--out", out.to_str().unwrap()];
    let mut child = display
        .view_of("scenes/free_hand/change_of_direction.toml", "tissue.cell_size_mm=1.3", &arguments)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    display.wait(&mut child);
    let frames = || std::fs::read_to_string(out.join("force.csv")).map_or(0, |t| t.lines().count());
    let later = |count: usize| {
        let (begin, first) = (Instant::now(), frames());
        while frames() < first + count {
            assert!(begin.elapsed() < Duration::from_secs(90), "{} frames", frames());
            std::thread::sleep(Duration::from_millis(50));
        }
    };
    later(5);
    // Pushed with Shift wherever the pointer is, then tilted with Alt to the right.
    for (key, [x, y]) in [("shift", ["0", "12"]), ("alt", ["12", "0"])] {
        display.xdotool(&["mousemove", "600", "420", "keydown", key, "mousedown", "1"]);
        for _ in 0..8 {
            display.xdotool(&["mousemove_relative", "--", x, y]);
            std::thread::sleep(Duration::from_millis(200));
        }
        display.xdotool(&["mouseup", "1", "keyup", key]);
        later(30);
    }
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        display.xdotool(&["key", "ctrl+q"]);
        assert!(begin.elapsed() < Duration::from_secs(30), "the window does not close");
        std::thread::sleep(Duration::from_millis(500));
    }
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let last = *Session::read(&out.join(SESSION)).unwrap().poses.last().unwrap();
    // 96 points down on the screen, and 96 to the right: the hub leans there, which is +x and a little +y in this view.
    assert!(last.depth > 1e-3, "{last:?}");
    assert!(last.direction.x < -0.05 && last.direction.z < -0.9, "{last:?}");
    assert!(last.entry.x.abs() < 1e-9, "{last:?}");
}

/// Another program over OpenIGTLink leads the needle of a real window, and the forces of the hand are written at 1 kHz.
#[cfg(feature = "link")]
#[test]
fn another_program_leads_the_needle_and_sees_it() {
    use std::io::{BufRead, BufReader, Write};

    use glam::DVec3;
    use stylet::link::basis_along;
    use stylet::link::message::{Content, Transform};
    use stylet::link::read::{self, Received};

    let Some(display) = Display::open() else { return };
    let forces = display.path("forces.csv");
    let mut child = display
        .view(&["--link", "--link-port", "0", "--allow-control", "--frames", "100000"])
        .args(["--haptic-log".as_ref(), forces.as_os_str()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut told = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    told.read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("OpenIGTLink at ").unwrap_or_else(|| panic!("{line}")).to_string();
    let mut peer = std::net::TcpStream::connect(&address).unwrap();
    peer.set_read_timeout(Some(Duration::from_secs(60))).unwrap();
    let wanted = Transform { rotation: basis_along(DVec3::NEG_Z), translation: DVec3::new(0.0, 0.0, -2.0) };
    peer.write_all(&Content::Transform(wanted).encode("NeedleControl", 0)).unwrap();
    // The depth of a state whose needle has come as far as it was asked to.
    let begin = Instant::now();
    let depth = loop {
        assert!(begin.elapsed() < Duration::from_secs(120), "the needle does not follow");
        let Received { content, .. } = read::message(&mut peer, |_| true, true).unwrap().expect("a message");
        let Some(Content::Text(text)) = content else { continue };
        let state: serde_json::Value = serde_json::from_str(&text).unwrap();
        let depth = state["depth_mm"].as_f64().unwrap();
        if depth > 1.999 {
            assert_eq!(state["state"], "running");
            assert!(state["axial_force_n"].as_f64().unwrap() > 0.01, "{state}");
            break depth;
        }
    };
    assert!(depth < 2.001, "{depth}");
    drop(peer);
    display.wait(&mut child);
    std::thread::sleep(Duration::from_millis(500));
    let begin = Instant::now();
    while child.try_wait().unwrap().is_none() {
        display.xdotool(&["key", "ctrl+q"]);
        assert!(begin.elapsed() < Duration::from_secs(30), "the window does not close");
        std::thread::sleep(Duration::from_millis(500));
    }
    let output = child.wait_with_output().unwrap();
    let mut rest = String::new();
    told.read_to_string(&mut rest).unwrap();
    assert!(output.status.success(), "{rest}{}", String::from_utf8_lossy(&output.stderr));
    println!("{rest}");
    assert!(rest.contains("haptic: ") && rest.contains("2.00 mm"), "{rest}");
    let table = std::fs::read_to_string(&forces).unwrap();
    let axial: Vec<f64> = table.lines().skip(1).map(|row| row.split(',').nth(1).unwrap().parse().unwrap()).collect();
    assert!(axial.len() > 200 && axial.iter().any(|f| *f > 1e-4), "{} forces", axial.len());
    assert!(axial.last().unwrap().abs() < 0.5, "the hand is let go");
}

/// Depth of the tip in the last row [m], 0 where there is none.
fn depth(out: &Path) -> f64 {
    let text = std::fs::read_to_string(out.join("force.csv")).unwrap_or_default();
    let last = text.lines().skip(1).last().and_then(|row| row.split(',').nth(1)?.parse().ok());
    last.unwrap_or(0.0)
}

fn until(patience: u64, mut done: impl FnMut() -> bool) -> bool {
    let begin = Instant::now();
    while begin.elapsed() < Duration::from_secs(patience) {
        if done() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(30));
    }
    false
}

fn scene(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes").join(name)
}

/// From the briefing to the scores with keys and mouse; the window is resized, hidden and shown again on the way.
#[test]
fn a_task_is_done_from_briefing_to_debriefing() {
    let Some(display) = Display::open() else { return };
    let (out, history) = (display.path("attempt"), display.path("history"));
    let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .env("STYLET_SETTINGS", display.path("settings.toml"))
        .arg("view")
        .arg(scene("training/hit_target.toml"))
        .args(["--set", "tissue.cell_size_mm=1.2", "--set", "target.0.position_mm=[0, 0, -4.6]"])
        .args(["--trainee", "ada", "--history", history.to_str().unwrap(), "--out", out.to_str().unwrap()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    display.wait(&mut child);
    let started = until(30, || {
        if depth(&out) == 0.0 {
            display.xdotool(&["key", "space"]);
            display.xdotool(&["keydown", "Down"]);
        }
        // The space bar pauses as well: it is pressed again only where it seems to have been lost.
        until(6, || depth(&out) > 0.0)
    });
    assert!(started, "the keys did not lead the needle");
    display.xdotool(&["search", "--name", "Stylet", "windowsize", "900", "620"]);
    // Whoever resizes a window may take the keyboard from it: then the key is pressed again.
    let push_to = |wanted: f64| {
        let mut last = (depth(&out), Instant::now());
        until(90, || {
            let now = depth(&out);
            if now > last.0 {
                last = (now, Instant::now());
            } else if last.1.elapsed() > Duration::from_secs(4) {
                display.focus();
                display.xdotool(&["keyup", "Down"]);
                display.xdotool(&["keydown", "Down"]);
                last.1 = Instant::now();
            }
            now > wanted
        })
    };
    assert!(push_to(2e-3), "stuck at {} m", depth(&out));
    // Nothing to draw on for a while; the keyboard is gone with it.
    display.xdotool(&["search", "--name", "Stylet", "windowunmap"]);
    std::thread::sleep(Duration::from_millis(700));
    display.xdotool(&["search", "--name", "Stylet", "windowmap"]);
    display.xdotool(&["search", "--name", "Stylet", "windowsize", "1280", "800"]);
    display.focus();
    display.xdotool(&["keyup", "Down"]);
    display.xdotool(&["keydown", "Down"]);
    assert!(push_to(4.75e-3), "stuck at {} m", depth(&out));
    display.xdotool(&["keyup", "Down"]);
    std::thread::sleep(Duration::from_millis(500));
    let scored = until(30, || {
        display.xdotool(&["key", "F6"]);
        std::thread::sleep(Duration::from_millis(700));
        out.join("score.json").is_file()
    });
    assert!(scored, "no scores");
    display.xdotool(&["key", "ctrl+q"]);
    let ended = until(20, || child.try_wait().unwrap().is_some());
    if !ended {
        let _ = child.kill();
    }
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(ended && output.status.success(), "{told}");
    assert!(told.contains("force after 1 frame(s)"), "input to force: {told}");
    assert!(told.contains("Passed"), "{told}");
    assert!(std::fs::read_dir(&history).unwrap().count() > 0, "the history of the trainee");
}

/// What a person does who has never seen the program, by keys alone: a trainee, the first task that is passed, a second one.
#[test]
fn the_first_ten_minutes_from_the_start_screen_to_a_second_task() {
    let Some(display) = Display::open() else { return };
    let (out, history, settings) = (display.path("attempt"), display.path("history"), display.path("settings.toml"));
    std::fs::write(&settings, "version = 1\nlanguage = \"en\"\n").unwrap();
    let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(display.place.path())
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .args(["view", "--settings", "settings.toml", "--out", "attempt"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    display.wait(&mut child);
    let titled = |title: &str| {
        let name = format!("^{title}");
        until(90, || display.xdotool(&["search", "--name", &name]).status.success())
    };
    // The second stop of the Tab key is the button that makes a trainee: before it is the list of them.
    let kept = || std::fs::read_to_string(&settings).unwrap_or_default();
    let made = until(60, || {
        display.focus();
        display.xdotool(&["key", "--delay", "250", "Escape", "Tab", "Tab", "Return"]);
        std::thread::sleep(Duration::from_millis(500));
        display.xdotool(&["type", "--delay", "60", "Ada 1"]);
        std::thread::sleep(Duration::from_millis(300));
        display.xdotool(&["key", "Return"]);
        until(3, || kept().contains("Ada 1"))
    });
    assert!(made, "no trainee: {}", kept());
    // Help is opened and closed on the way.
    display.xdotool(&["key", "Escape", "F1"]);
    std::thread::sleep(Duration::from_millis(400));
    display.xdotool(&["key", "Escape"]);
    std::thread::sleep(Duration::from_millis(300));
    display.xdotool(&["key", "2"]);
    assert!(titled("Stylet - Training: hit a lesion"), "the task does not open");
    // The first key begins the run: nobody presses Play.
    let lead_to = |out: &Path, wanted: f64| {
        let mut last = (0.0, Instant::now() - Duration::from_secs(10));
        let there = until(150, || {
            let now = depth(out);
            if now > last.0 {
                last = (now, Instant::now());
            } else if last.1.elapsed() > Duration::from_secs(4) {
                display.focus();
                display.xdotool(&["keyup", "Down"]);
                display.xdotool(&["keydown", "Down"]);
                last.1 = Instant::now();
            }
            now > wanted
        });
        display.xdotool(&["keyup", "Down"]);
        assert!(there, "stuck at {} m", depth(out));
    };
    let finish = |out: &Path| {
        assert!(
            until(40, || {
                display.xdotool(&["key", "F6"]);
                std::thread::sleep(Duration::from_millis(700));
                out.join("score.json").is_file()
            }),
            "no scores in {}",
            out.display()
        );
    };
    lead_to(&out, 9.3e-3);
    std::thread::sleep(Duration::from_millis(500));
    finish(&out);
    let back = until(30, || {
        display.xdotool(&["key", "F8"]);
        until(3, || display.xdotool(&["search", "--name", "^Stylet$"]).status.success())
    });
    assert!(back, "no way back to the start screen");
    std::thread::sleep(Duration::from_millis(500));
    display.xdotool(&["key", "1"]);
    assert!(titled("Stylet - Training: a core biopsy"), "the second task does not open");
    let second = display.path("attempt_2");
    lead_to(&second, 1e-3);
    finish(&second);
    display.xdotool(&["key", "ctrl+q"]);
    let ended = until(20, || child.try_wait().unwrap().is_some());
    if !ended {
        let _ = child.kill();
    }
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(ended && output.status.success(), "{told}");
    assert!(told.contains("Passed"), "{told}");
    let attempts = stylet::training::history::History::new(&history).attempts("Ada 1").unwrap().attempts;
    let passed: Vec<(String, Option<bool>)> = attempts.iter().map(|a| (a.task.clone(), a.score.passed())).collect();
    assert_eq!(passed.len(), 2, "{passed:?}");
    assert!(passed.iter().any(|(_, passed)| *passed == Some(true)), "{passed:?}");
    assert!(kept().contains("hit_target.toml") && kept().contains("core_biopsy.toml"), "recent files: {}", kept());
}

/// The same person with a mouse alone: no key is pressed before the end. Places to click on are those of the same panels, drawn without a window.
#[test]
fn the_first_ten_minutes_by_mouse_alone() {
    let Some(display) = Display::open() else { return };
    let Some(gpu) = common::gpu() else { return };
    let english = layout::english();
    let (out, history, settings) = (display.path("attempt"), display.path("history"), display.path("settings.toml"));
    std::fs::write(&settings, "version = 1\nlanguage = \"en\"\n").unwrap();
    let start = layout::StartPlaces::of(&history);
    let (finish, drags) = layout::places_of_a_task("scenes/training/hit_target.toml", &gpu);
    let next_task = debriefing::place_of_next_task();
    drop(english);
    let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(display.place.path())
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .args(["view", "--settings", "settings.toml", "--out", "attempt"])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    display.wait(&mut child);
    let titled = |title: &str| {
        let name = format!("^{title}");
        until(90, || display.xdotool(&["search", "--name", &name]).status.success())
    };
    // A trainee with the name that is suggested.
    let kept = || std::fs::read_to_string(&settings).unwrap_or_default();
    let mut pictured = false;
    let made = until(60, || {
        display.click(start.new_trainee);
        std::thread::sleep(Duration::from_millis(600));
        if !std::mem::replace(&mut pictured, true) {
            display.keep_picture("1_trainee");
        }
        display.click(start.create);
        until(3, || kept().contains("Trainee 1"))
    });
    assert!(made, "no trainee: {}", kept());
    display.keep_picture("2_start");
    assert!(
        until(30, || {
            display.click(start.hit_a_lesion);
            until(5, || display.xdotool(&["search", "--name", "^Stylet - Training: hit a lesion"]).status.success())
        }),
        "the card does not open the task"
    );
    let wheel = |out: &Path, button: &str, wanted: &dyn Fn(f64) -> bool| {
        display.xdotool(&["mousemove", "600", "620"]);
        let there = until(150, || {
            let before = depth(out);
            display.xdotool(&["click", button]);
            // Two notches of 0.25 mm: winit tells press and release of a wheel that is a button only. The next waits until they are done.
            until(2, || (depth(out) - before).abs() > 4.5e-4);
            wanted(depth(out))
        });
        assert!(there, "stuck at {} m", depth(out));
    };
    // The wheel begins the run. A needle 3 mm deep is tilted by a drag, and back.
    wheel(&out, "5", &|depth| depth > 3e-3);
    display.keep_picture("3_led");
    // None while a line of the session is being written.
    let leans = || Session::read(&out.join(SESSION)).ok()?.poses.last().map(|pose| pose.direction.x);
    let drag = |x: &str, step: [&str; 2]| {
        display.xdotool(&["mousemove", x, "160", "sleep", "0.2", "mousedown", "1"]);
        for _ in 0..8 {
            display.xdotool(&["mousemove_relative", "--", step[0], step[1]]);
            std::thread::sleep(Duration::from_millis(100));
        }
        display.xdotool(&["mouseup", "1"]);
    };
    display.click(drags.tilts);
    drag("610", ["4", "0"]);
    assert!(until(20, || leans().is_some_and(|x| x < -0.02)), "the drag does not tilt: {:?}", leans());
    display.keep_picture("4_tilted");
    // The hub stands a little aside by now.
    drag("616", ["-4", "0"]);
    assert!(until(20, || leans().is_some_and(|x| x.abs() < 0.02)), "the drag does not tilt back: {:?}", leans());
    // The rest of the way: a drag of the needle, then the wheel.
    display.click(drags.pushes);
    let before = depth(&out);
    drag("610", ["0", "4"]);
    assert!(until(20, || depth(&out) > before + 0.7e-3), "the drag does not push: {}", depth(&out));
    wheel(&out, "5", &|depth| depth > 9.3e-3);
    display.keep_picture("5_there");
    let scored = until(40, || {
        display.click(finish);
        until(3, || out.join("score.json").is_file())
    });
    assert!(scored, "no scores");
    display.keep_picture("6_debriefing");
    assert!(
        until(30, || {
            display.click(next_task);
            until(5, || display.xdotool(&["search", "--name", "^Stylet - Training: stop in a thin"]).status.success())
        }),
        "the next task does not open"
    );
    assert!(titled("Stylet - Training: stop in a thin layer"));
    let second = display.path("attempt_2");
    wheel(&second, "5", &|depth| depth > 1e-3);
    display.keep_picture("7_second_task");
    // A wheel turned the other way draws it back.
    let deep = depth(&second);
    wheel(&second, "4", &|depth| depth < deep - 4e-4);
    // The button that closes a window is the window manager's, and there is none.
    display.xdotool(&["key", "ctrl+q"]);
    let ended = until(20, || child.try_wait().unwrap().is_some());
    if !ended {
        let _ = child.kill();
    }
    let output = child.wait_with_output().unwrap();
    let told = String::from_utf8_lossy(&output.stdout).into_owned() + &String::from_utf8_lossy(&output.stderr);
    assert!(ended && output.status.success(), "{told}");
    assert!(told.contains("Passed"), "{told}");
    let attempts = stylet::training::history::History::new(&history).attempts("Trainee 1").unwrap().attempts;
    assert_eq!(attempts.len(), 1, "kept for the trainee");
    assert_eq!(attempts[0].score.passed(), Some(true));
}

/// A scene that is edited while its window is open: broken text is told and changes nothing, good text begins anew.
#[test]
fn an_edited_scene_is_read_anew() {
    let Some(display) = Display::open() else { return };
    let file = display.path("mine.toml");
    let text = std::fs::read_to_string(scene("training/hit_target.toml")).unwrap();
    let text = text.replace("cell_size_mm = 0.65", "cell_size_mm = 1.2");
    std::fs::write(&file, &text).unwrap();
    let out = display.path("run");
    let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .env("STYLET_SETTINGS", display.path("settings.toml"))
        .args(["view", file.to_str().unwrap(), "--script", "--out", out.to_str().unwrap()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    display.wait(&mut child);
    assert!(until(60, || depth(&out) > 2e-4), "the script does not run");
    let save = |text: &str, later: u64| {
        std::fs::write(&file, text).unwrap();
        let at = std::time::SystemTime::now() + Duration::from_secs(later);
        std::fs::File::options().write(true).open(&file).unwrap().set_modified(at).unwrap();
    };
    save("[tissue", 10);
    std::thread::sleep(Duration::from_millis(1500));
    let before = depth(&out);
    assert!(until(60, || depth(&out) > before + 2e-4), "a broken file stopped the run");
    save(&text.replace("coefficient = 0.3", "coefficient = 0.5"), 20);
    let second = display.path("run_2");
    assert!(until(60, || depth(&second) > 1e-4), "the edited scene did not begin anew");
    display.xdotool(&["search", "--name", "Stylet", "windowfocus"]);
    display.xdotool(&["key", "ctrl+q"]);
    if !until(20, || child.try_wait().unwrap().is_some()) {
        let _ = child.kill();
    }
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// The display goes down in the middle of an attempt: what the hand did so far is computed again.
#[test]
fn a_lost_display_takes_nothing_with_it() {
    let Some(mut display) = Display::open() else { return };
    let out = display.path("attempt");
    let mut child = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .env("DISPLAY", &display.name)
        .env_remove("WAYLAND_DISPLAY")
        .env("STYLET_SETTINGS", display.path("settings.toml"))
        .args(["view", "scenes/training/hit_target.toml", "--set", "tissue.cell_size_mm=1.2", "--out"])
        .arg(&out)
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    display.wait(&mut child);
    let led = until(60, || {
        if depth(&out) == 0.0 {
            display.xdotool(&["key", "space"]);
            display.xdotool(&["keydown", "Down"]);
        }
        until(6, || depth(&out) > 0.5e-3)
    });
    display.server.kill().unwrap();
    let ended = until(20, || child.try_wait().unwrap().is_some());
    let _ = child.kill();
    let told = String::from_utf8_lossy(&child.wait_with_output().unwrap().stderr).into_owned();
    assert!(led && ended, "led {led}, ended {ended}");
    assert!(told.contains("the display is gone") && told.contains("stylet replay"), "{told}");
    let rows = |folder: &Path| -> Vec<String> {
        std::fs::read_to_string(folder.join("force.csv")).unwrap().lines().map(String::from).collect()
    };
    let kept = rows(&out);
    let poses = Session::read(&out.join(SESSION)).unwrap().poses.len();
    // The head of the table has a line too; the frame under way may have a pose and no row.
    assert!(kept.len() > 10 && poses + 1 >= kept.len(), "{poses} poses, {} lines", kept.len());
    let again = display.path("again");
    let replayed = Command::new(env!("CARGO_BIN_EXE_stylet"))
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .args(["replay".as_ref(), out.as_os_str(), "--out".as_ref(), again.as_os_str()])
        .output()
        .unwrap();
    assert!(replayed.status.success(), "{}", String::from_utf8_lossy(&replayed.stderr));
    assert_eq!(rows(&again)[..kept.len()], kept);
}
