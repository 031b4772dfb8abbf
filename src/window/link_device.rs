//! Another program at the needle over OpenIGTLink: it sees every frame, and leads if it may (feature `link`).

use std::net::SocketAddr;

use super::hand::InputDevice;
use super::practice::{Practice, State};
use crate::commands::view::LinkArgs;
use crate::error::Result;
use crate::link::{LinkOptions, LinkServer, LinkState, Pose, RunState, WantedPose, basis_along};
use crate::needle::motion::HandPose;
use crate::words::say;

/// Cosine of the flattest direction that has a point of entry: 0.6 degrees above the surface.
const FLATTEST: f64 = 0.01;

/// The needle that a direction and a tip make; `None` for one that does not point into the tissue.
pub fn hand_pose(pose: &Pose) -> Option<HandPose> {
    let direction = pose.direction();
    if !(direction.z < -FLATTEST && pose.tip.is_finite()) {
        return None;
    }
    let depth = pose.tip.z / direction.z;
    Some(HandPose { entry: (pose.tip - direction * depth).with_z(0.0), direction, depth })
}

/// Poses that a client asked for, as something that a hand holds.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Wanted {
    /// The newest pose with a meaning, while its client is there.
    pose: Option<HandPose>,
    /// Number of the last pose that was looked at.
    number: u64,
    /// Poses that do not point into the tissue.
    pub refused: u64,
    fresh: Option<std::time::Instant>,
}

impl Wanted {
    /// Takes the newest wanted pose. Without its client the needle stands still where it is.
    pub fn take(&mut self, wanted: Option<WantedPose>) {
        let Some(wanted) = wanted else { return };
        if wanted.number != self.number {
            self.number = wanted.number;
            match hand_pose(&wanted.pose) {
                Some(pose) => {
                    self.pose = Some(pose);
                    self.fresh.get_or_insert(wanted.received);
                }
                None => self.refused += 1,
            }
        }
        if !wanted.connected {
            self.pose = None;
        }
    }

    /// True while a client leads.
    pub fn leads(&self) -> bool {
        self.pose.is_some()
    }

    /// What was asked before no longer counts: the needle begins anew.
    pub fn forget(&mut self) {
        self.pose = None;
    }
}

impl InputDevice for Wanted {
    fn name(&self) -> &str {
        "OpenIGTLink"
    }

    fn places_the_tip(&self) -> bool {
        true
    }

    fn pose(&mut self, now: &HandPose, _duration: f64) -> HandPose {
        self.pose.unwrap_or(*now)
    }

    fn fresh_input(&mut self) -> Option<std::time::Instant> {
        self.fresh.take()
    }
}

/// What a client sees of an insertion.
pub fn link_state(practice: &Practice) -> Option<LinkState> {
    let (tip, direction) = practice.tool_place()?;
    let last = practice.records.last();
    let (run, text) = match &practice.state {
        State::Running => (RunState::Running, String::new()),
        State::Paused => (RunState::Paused, String::new()),
        State::Ended => (RunState::Stopped, say("ended").to_string()),
        State::Stopped(reason) => (RunState::Stopped, reason.clone()),
    };
    Some(LinkState {
        time: last.map_or(0.0, |r| r.time),
        pose: Pose { tip, rotation: basis_along(direction.normalize()) },
        axial_force: last.map_or(0.0, |r| r.force.axial),
        lateral_force: last.map_or(0.0, |r| r.force.lateral.length()),
        depth: last.map_or(0.0, |r| r.depth),
        run,
        text,
    })
}

/// The server beside a window.
pub struct Link {
    server: LinkServer,
    pub wanted: Wanted,
    /// What was published last: frames and state.
    told: Option<(usize, State)>,
}

impl Link {
    /// # Errors
    /// As [`LinkServer::start`].
    pub fn start(choice: &LinkArgs) -> Result<Self> {
        let defaults = LinkOptions::default();
        let server = LinkServer::start(LinkOptions {
            address: choice.address.unwrap_or(defaults.address),
            port: choice.port.unwrap_or(defaults.port),
            allow_control: choice.allow_control,
            ..defaults
        })?;
        Ok(Link { server, wanted: Wanted::default(), told: None })
    }

    pub fn address(&self) -> SocketAddr {
        self.server.address()
    }

    /// Clients now.
    pub fn clients(&self) -> usize {
        self.server.counters().clients
    }

    /// Publishes what is new, and takes what is wanted.
    pub fn tend(&mut self, practice: &Practice) {
        self.wanted.take(self.server.wanted_pose());
        let now = (practice.records.len(), practice.state.clone());
        if self.told.as_ref() == Some(&now) {
            return;
        }
        if let Some(state) = link_state(practice) {
            self.server.publish(&state);
        }
        // An attempt that begins anew has nobody's old wish.
        if self.told.as_ref().is_some_and(|told| told.0 > now.0) {
            self.wanted.forget();
        }
        self.told = Some(now);
    }
}

#[cfg(test)]
mod tests {
    use std::time::Instant;

    use glam::DVec3;

    use super::*;

    fn wanted(number: u64, tip: DVec3, direction: DVec3, connected: bool) -> Option<WantedPose> {
        let pose = Pose { tip, rotation: basis_along(direction.normalize()) };
        Some(WantedPose { pose, number, received: Instant::now(), connected })
    }

    const NOW: HandPose = HandPose { entry: DVec3::ZERO, direction: DVec3::NEG_Z, depth: 0.0 };

    #[test]
    fn a_wanted_tip_becomes_entry_and_depth() {
        let direction = DVec3::new(0.6, 0.0, -0.8);
        let pose = Pose { tip: DVec3::new(4e-3, 1e-3, -4e-3), rotation: basis_along(direction) };
        let hand = hand_pose(&pose).unwrap();
        assert!((hand.depth - 5e-3).abs() < 1e-12 && hand.entry.z == 0.0);
        assert!((hand.entry - DVec3::new(1e-3, 1e-3, 0.0)).length() < 1e-12);
        assert!((hand.entry + hand.direction * hand.depth - pose.tip).length() < 1e-12);
        for flat in [DVec3::X, DVec3::Z, DVec3::new(1.0, 0.0, -0.005)] {
            assert!(hand_pose(&Pose { rotation: basis_along(flat.normalize()), ..pose }).is_none());
        }
    }

    #[test]
    fn the_newest_wish_leads_while_its_client_is_there() {
        let mut device = Wanted::default();
        device.take(None);
        assert_eq!((device.leads(), device.pose(&NOW, 0.1)), (false, NOW));
        device.take(wanted(1, DVec3::NEG_Z * 2e-3, DVec3::NEG_Z, true));
        device.take(wanted(2, DVec3::NEG_Z * 3e-3, DVec3::NEG_Z, true));
        assert!((device.pose(&NOW, 0.1).depth - 3e-3).abs() < 1e-12);
        assert!(device.fresh_input().is_some() && device.fresh_input().is_none());
        // Out of the tissue: refused, and the one before stays.
        device.take(wanted(3, DVec3::NEG_Z * 9e-3, DVec3::Z, true));
        device.take(wanted(3, DVec3::NEG_Z * 9e-3, DVec3::Z, true));
        assert_eq!(device.refused, 1);
        assert!((device.pose(&NOW, 0.1).depth - 3e-3).abs() < 1e-12);
        device.take(wanted(3, DVec3::NEG_Z * 9e-3, DVec3::Z, false));
        assert_eq!((device.leads(), device.pose(&NOW, 0.1)), (false, NOW));
    }
}
