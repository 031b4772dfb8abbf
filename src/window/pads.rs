//! Gamepads of this machine, through gilrs (feature `gamepad`; on Linux it needs libudev).

use gilrs::ff::{BaseEffect, BaseEffectType, Effect, EffectBuilder, Repeat, Replay, Ticks};
use gilrs::{Axis, Button, EventType, GamepadId, Gilrs, GilrsBuilder};
use glam::DVec2;

use super::gamepad::{PadEvent, PadPort};
use crate::error::{Error, Result};

/// Length of the effect that is repeated while the pad rumbles [ms].
const RUMBLE_MS: u32 = 200;

/// The pads of this machine; the first one that is found is in use until it goes.
pub struct Pads {
    gilrs: Gilrs,
    in_use: Option<GamepadId>,
    rumble: Option<Effect>,
    /// The first poll tells of a pad that was there before.
    looked: bool,
}

impl Pads {
    /// # Errors
    /// `Error::Input` where the system shows no pads to programs.
    pub fn open() -> Result<Self> {
        // The dead zone is ours: one of the library on top would be twice as wide.
        let gilrs = GilrsBuilder::new().with_default_filters(false).build().map_err(|reason| {
            Error::input(
                format!("no gamepads here: {reason}"),
                "give yourself the right to read /dev/input (on Linux: the group `input`), or go on with keys and mouse",
            )
        })?;
        Ok(Pads { gilrs, in_use: None, rumble: None, looked: false })
    }

    fn take(&mut self, id: GamepadId) -> PadEvent {
        self.in_use = Some(id);
        let pad = self.gilrs.gamepad(id);
        let name = pad.name().to_string();
        if pad.is_ff_supported() {
            let effect = BaseEffect {
                kind: BaseEffectType::Strong { magnitude: u16::MAX },
                scheduling: Replay { play_for: Ticks::from_ms(RUMBLE_MS), ..Default::default() },
                envelope: Default::default(),
            };
            let built = EffectBuilder::new()
                .add_effect(effect)
                .gamepads(&[id])
                .repeat(Repeat::Infinitely)
                .gain(0.0)
                .finish(&mut self.gilrs);
            self.rumble = built.inspect_err(|reason| log::warn!("{name} does not rumble: {reason}")).ok();
        }
        PadEvent::Here(name)
    }

    /// A pad that is there while none is in use.
    fn look(&mut self) -> Option<PadEvent> {
        let found = self.gilrs.gamepads().next().map(|(id, _)| id)?;
        self.in_use.is_none().then(|| self.take(found))
    }
}

impl PadPort for Pads {
    fn poll(&mut self) -> Vec<PadEvent> {
        let mut events = Vec::new();
        if !self.looked {
            self.looked = true;
            events.extend(self.look());
        }
        while let Some(event) = self.gilrs.next_event() {
            let mine = self.in_use == Some(event.id);
            match event.event {
                EventType::Connected if self.in_use.is_none() => events.push(self.take(event.id)),
                EventType::Disconnected if mine => {
                    (self.in_use, self.rumble) = (None, None);
                    events.push(PadEvent::Gone);
                    events.extend(self.look());
                }
                EventType::AxisChanged(..) if mine => {
                    let pad = self.gilrs.gamepad(event.id);
                    let stick = |x, y| DVec2::new(pad.value(x).into(), pad.value(y).into());
                    events.push(PadEvent::Left(stick(Axis::LeftStickX, Axis::LeftStickY)));
                    events.push(PadEvent::Right(stick(Axis::RightStickX, Axis::RightStickY)));
                }
                EventType::ButtonPressed(Button::Start | Button::South, _) if mine => events.push(PadEvent::Pause),
                _ => {}
            }
        }
        events
    }

    fn rumble(&mut self, strength: f32) {
        let Some(effect) = &self.rumble else { return };
        let done = match strength > 0.0 {
            true => effect.set_gain(strength).and_then(|()| effect.play()),
            false => effect.stop(),
        };
        if let Err(reason) = done {
            log::warn!("the gamepad no longer rumbles: {reason}");
            self.rumble = None;
        }
    }
}
