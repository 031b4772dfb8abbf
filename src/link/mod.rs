//! Needle and forces for other programs, over OpenIGTLink: 3D Slicer, Perk Tutor, PLUS, pyigtl.
//!
//! Reading order: [`message`] (bytes, with their checksum in [`crc`]) -> [`read`] (bytes that anybody may have sent) -> [`state`]
//! (what is sent and what is asked for) -> [`server`] (clients come and go), its `client` (what waits for one of them) and
//! the `conversation` with it.
//!
//! # What is sent
//! Devices, for every published state unless another time is given:
//!
//! | device | type | content |
//! |---|---|---|
//! | `Needle` | TRANSFORM | pose of the needle: third column = direction of the insertion, translation = tip \[mm\] |
//! | `NeedleState` | STRING | JSON: `time_s`, `state`, `axial_force_n`, `lateral_force_n`, `depth_mm` |
//! | `Stylet` | STATUS | at the beginning and when it changes: running, paused, stopped, and a text |
//! | `NeedleForce` | SENSOR | axial and lateral force \[N\]; to clients that ask, see below |
//! | `NeedleDepth` | SENSOR | depth of the tip \[mm\]; with the former |
//! | `NeedlePosition` | POSITION | pose as position \[mm\] and quaternion; to clients that ask |
//!
//! pyigtl 0.3.4 reads neither SENSOR nor STATUS, and its POSITION has another layout than the specification's: forces reach it as
//! STRING. 3D Slicer reads TRANSFORM, STRING and STATUS, and logs an error for each message of a type that it does not know (so
//! says the source of its OpenIGTLinkIO; not tried here): so SENSOR and POSITION go to clients that ask for them with
//! `STT_SENSOR` and `STT_POSITION`, or to all with [`LinkOptions::sensors`].
//!
//! # What is understood
//! `GET_` TRANSFORM, POSITION, SENSOR, STRING, STATUS: the newest one, now. `STT_` and `STP_` TRANSFORM, POSITION, SENSOR: for
//! every state from now on, and no more; both are answered by `RTS_`. TRANSFORM of the device `NeedleControl`: where the needle
//! shall be, with [`LinkOptions::allow_control`] only. Every other type is skipped.
//!
//! # Frame of reference
//! That of a scene: z up, the surface of the tissue at rest is z = 0, its middle the origin; a needle that goes in has a direction
//! with z < 0. Lengths are millimetres in messages, metres everywhere else. There is no patient: 3D Slicer takes these axes for
//! its own (right, anterior, superior).
//!
//! # Bounds
//! At most [`CLIENTS`] clients. Each takes one body of at most [`read::LARGEST_KEPT`] bytes, [`STATES`] states and [`ANSWERS`]
//! answers of less than 4 KiB each that wait for it, and two threads with stacks of [`STACK`] bytes: less than 8 MiB for all,
//! whatever they send or do not take; the system is asked for send buffers of 16 KiB.
//!
//! The protocol knows no passwords. Whoever reaches the port sees the needle, and moves it if control is allowed.
//!
//! Source of the format: [Tokuda2009], and the documents of its reference library (OpenIGTLink/Documents/Protocol, protocol 3;
//! header.md, transform.md, position.md, status.md, sensordata.md, unit.md, string.md, timestamp.md), cited as [OpenIGTLink].

mod client;
mod conversation;
pub mod crc;
pub mod message;
pub mod read;
pub mod server;
mod shared;
pub mod state;

pub use client::{ANSWERS, STATES};
pub use server::{CLIENTS, LinkCounters, LinkServer};
pub use shared::{LinkOptions, STACK};
pub use state::{LinkState, Pose, RunState, WantedPose, basis_along};

/// Port that OpenIGTLink is registered for.
pub const PORT: u16 = 18944;
