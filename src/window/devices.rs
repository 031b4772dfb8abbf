//! What is connected beside mouse and keyboard: gamepad, OpenIGTLink, a sink of forces. One place says which of them leads.

use std::time::Instant;

use glam::DVec3;

use super::gamepad::{Gamepad, PadNotice, PadPort};
use super::hand::{Desk, InputDevice};
#[cfg(feature = "link")]
use super::link_device::Link;
#[cfg(feature = "link")]
use super::practice::Leader;
use super::practice::{Practice, State};
use super::theme::Tint;
#[cfg(not(feature = "link"))]
use crate::Error;
use crate::Result;
use crate::commands::view::ViewArgs;
use crate::haptic::{ForceLoop, ForceTable, LoopTiming};
use crate::needle::motion::HandPose;
use crate::words::say;

/// Devices that come and go.
#[derive(Default)]
pub struct Devices {
    pad: Option<Gamepad<Box<dyn PadPort>>>,
    #[cfg(feature = "link")]
    link: Option<Link>,
    forces: Option<ForceLoop>,
    /// Frames of which the forces have been given.
    felt: usize,
    /// What has happened to a device, for the trainee.
    notice: Option<String>,
}

impl Devices {
    /// Opens what the options ask for, and the gamepads where they are built in, whose speed [`Devices::tend`] gives.
    ///
    /// # Errors
    /// Those of the link's port and of the file of forces. Without gamepads one goes on with keys and mouse.
    pub fn open(options: &ViewArgs) -> Result<Self> {
        let mut devices = Devices::default();
        devices.open_link(options)?;
        devices.open_pads();
        if let Some(path) = &options.haptic_log {
            devices.forces = Some(ForceLoop::start(Box::new(ForceTable::create(path)?))?);
        }
        Ok(devices)
    }

    #[cfg(feature = "link")]
    fn open_link(&mut self, options: &ViewArgs) -> Result<()> {
        if options.link.on {
            let link = Link::start(&options.link)?;
            println!("OpenIGTLink at {}", link.address());
            self.link = Some(link);
        }
        Ok(())
    }

    #[cfg(not(feature = "link"))]
    fn open_link(&mut self, options: &ViewArgs) -> Result<()> {
        match options.link.on {
            false => Ok(()),
            true => Err(Error::input(
                "this stylet was built without OpenIGTLink",
                "build it with the link: cargo run --release --features window,link -- view --link",
            )),
        }
    }

    #[cfg(feature = "gamepad")]
    fn open_pads(&mut self) {
        match super::pads::Pads::open() {
            Ok(pads) => self.pad = Some(Gamepad::new(Box::new(pads), 0.0)),
            Err(error) => eprintln!("note: {error}"),
        }
    }

    #[cfg(not(feature = "gamepad"))]
    fn open_pads(&mut self) {}

    /// Once per picture: what has happened to the devices, and what they are to know.
    pub fn tend(&mut self, practice: &mut Practice, desk: &Desk) {
        if let Some(pad) = &mut self.pad {
            pad.speed = desk.speed;
            pad.seen_from(desk.view());
            for notice in pad.poll() {
                self.notice = heed(notice, practice).or(self.notice.take());
            }
            if practice.state != State::Running {
                pad.be_still();
            }
        }
        if let Some(forces) = &self.forces {
            forces.pause(practice.state != State::Running);
        }
        self.publish(practice);
    }

    /// After a frame: its forces to the sink, its state to the link.
    pub fn felt(&mut self, practice: &Practice) {
        let frames = practice.records.len();
        if let (Some(forces), Some(record)) = (&self.forces, practice.records.last())
            && frames != self.felt
        {
            forces.solved(record.time, record.force.axial, record.force.lateral);
        }
        self.felt = frames;
        self.publish(practice);
    }

    #[cfg(feature = "link")]
    fn publish(&mut self, practice: &Practice) {
        if let Some(link) = &mut self.link {
            link.tend(practice);
        }
    }

    #[cfg(not(feature = "link"))]
    fn publish(&mut self, _practice: &Practice) {}

    /// True while mouse, keyboard, a pad or a client of the link asks something of the needle.
    pub fn asks(&self, desk: &Desk) -> bool {
        #[cfg(feature = "link")]
        let linked = self.link.as_ref().is_some_and(|link| link.wanted.leads());
        #[cfg(not(feature = "link"))]
        let linked = false;
        linked || desk.asks() || self.pad.as_ref().is_some_and(Gamepad::asks)
    }

    /// Everything that leads the needle by hand, as one device.
    pub fn with<'a>(&'a mut self, desk: &'a mut Desk) -> Together<'a> {
        Together { desk, devices: self }
    }

    /// Notices and the state of the link, for the panel on the left.
    pub fn show(&mut self, ui: &mut egui::Ui, practice: &Practice) {
        if let Some(notice) = &self.notice {
            let gone = ui.colored_label(Tint::Caution.of(ui), notice).clicked();
            if gone || ui.small_button(say("close-notice")).clicked() {
                self.notice = None;
            }
        }
        #[cfg(feature = "link")]
        if let Some(link) = &self.link {
            let refused = link.wanted.refused;
            ui.small(format!("{} {}, {} {}", say("link-at"), link.address(), link.clients(), say("link-clients")));
            if link.wanted.leads() && practice.leader == Leader::Hand {
                ui.small(say("link-leads"));
            }
            if refused > 0 {
                ui.small(format!("{}: {refused}", say("link-refused")));
            }
        }
        #[cfg(not(feature = "link"))]
        let _ = practice;
    }

    /// How well the loop of the forces keeps its time.
    pub fn timing(&self) -> Option<LoopTiming> {
        self.forces.as_ref().map(ForceLoop::timing)
    }

    /// Ends the loop of the forces, at zero.
    ///
    /// # Errors
    /// Those of the sink.
    pub fn finish(&mut self) -> Result<Option<LoopTiming>> {
        self.forces.take().map(ForceLoop::finish).transpose()
    }
}

/// What a notice of a pad does to the run; the text for the trainee.
fn heed(notice: PadNotice, practice: &mut Practice) -> Option<String> {
    let running = practice.state == State::Running;
    match notice {
        PadNotice::Here(name) => Some(format!("{name}: {}", say("pad-here"))),
        PadNotice::Gone => {
            if running {
                practice.state = State::Paused;
            }
            Some(say("pad-gone").to_string())
        }
        PadNotice::Pause => {
            practice.state = match practice.state {
                State::Running => State::Paused,
                State::Paused => State::Running,
                ref other => other.clone(),
            };
            None
        }
    }
}

/// Mouse, keyboard, gamepad and link at once. A client of the link leads alone, as its poses are places; the others add up.
pub struct Together<'a> {
    desk: &'a mut Desk,
    devices: &'a mut Devices,
}

impl InputDevice for Together<'_> {
    fn name(&self) -> &str {
        self.devices.pad.as_ref().map_or(self.desk.name(), |pad| pad.name())
    }

    fn pose(&mut self, now: &HandPose, duration: f64) -> HandPose {
        let desk = self.desk.pose(now, duration);
        #[cfg(feature = "link")]
        if let Some(link) = self.devices.link.as_mut().filter(|link| link.wanted.leads()) {
            return link.wanted.pose(now, duration);
        }
        match &mut self.devices.pad {
            Some(pad) => pad.pose(&desk, duration),
            None => desk,
        }
    }

    fn fresh_input(&mut self) -> Option<Instant> {
        let pad = self.devices.pad.as_mut().and_then(InputDevice::fresh_input);
        #[cfg(feature = "link")]
        let pad = pad.into_iter().chain(self.devices.link.as_mut().and_then(|link| link.wanted.fresh_input())).min();
        self.desk.fresh_input().into_iter().chain(pad).min()
    }

    fn feel(&mut self, axial: f64, lateral: DVec3) {
        if let Some(pad) = &mut self.devices.pad {
            pad.feel(axial, lateral);
        }
    }
}
