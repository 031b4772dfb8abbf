//! Where the work on the tissue goes. What engines deliver per frame, the account since t = 0, how the one becomes the other and the
//! columns of `energy.csv` follow from one table: a new energy is one line of it, beside the engines.

#![warn(missing_docs)]

use std::ops::{AddAssign, Sub};

use serde::{Deserialize, Serialize};

use crate::effects::own::LARGEST_COUNT;

/// One addend of the energy account.
#[derive(Debug, Clone, Copy)]
pub struct EnergyPart {
    /// Column of `energy.csv`.
    pub column: &'static str,
    /// What it is, in words of a table.
    pub meaning: &'static str,
    /// Its value [J].
    pub of: fn(&EnergyAccount) -> f64,
    /// 1 where external work turns into it, -1 where it was put in.
    pub sign: f64,
}

/// `name: sign, meaning, end X, sum Y Z;`: the part `name` of the account, column `name_j`, is X at the end of the frame plus Y + Z
/// since t = 0. A part with neither is booked by the recorder itself.
macro_rules! energies {
    ($($name:ident: $sign:literal, $meaning:literal $(, end $end:ident)? $(, sum $($sum:ident)+)?;)+) => {
        /// Energies of one frame as an engine delivers them [J]: what is stored at its end, and what its steps took.
        #[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
        pub struct FrameEnergies {
            $($(
                #[doc = concat!("At the end of the frame: ", $meaning, ".")]
                pub $end: f64,
            )?
            $($(
                #[doc = concat!("Sum over its steps: ", $meaning, ".")]
                pub $sum: f64,
            )+)?)+
            /// Sum over its steps: supplied by effects of the program's own, in the order of the scene.
            pub own: [f64; LARGEST_COUNT],
        }

        impl AddAssign for FrameEnergies {
            fn add_assign(&mut self, other: Self) {
                $($(self.$end += other.$end;)? $($(self.$sum += other.$sum;)+)?)+
                self.own.iter_mut().zip(other.own).for_each(|(sum, part)| *sum += part);
            }
        }

        impl Sub for FrameEnergies {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                let own = std::array::from_fn(|place| self.own[place] - other.own[place]);
                Self { $($($end: self.$end - other.$end,)? $($($sum: self.$sum - other.$sum,)+)?)+ own }
            }
        }

        /// Energies [J] at the end of a frame. Work and dissipation are totals since t = 0.
        #[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
        pub struct EnergyAccount {
            /// Work of tool, moved faces, tractions and gravity.
            pub external: f64,
            $(
                #[doc = concat!("It is ", $meaning, ".")]
                pub $name: f64,
            )+
            /// Supplied by effects of the program's own, in the order of the scene: they put it in.
            pub own: [f64; LARGEST_COUNT],
            /// Largest magnitude of [`EnergyAccount::put_in`] so far, the scale of the imbalance.
            pub external_max: f64,
        }

        impl EnergyAccount {
            /// Where external work goes, in the order of the columns of `energy.csv`.
            pub const PARTS: [EnergyPart; [$($sign),+].len()] = [$(
                EnergyPart {
                    column: concat!(stringify!($name), "_j"),
                    meaning: $meaning,
                    of: |account| account.$name,
                    sign: $sign,
                },
            )+];

            /// Books the energies of a frame; `taken` keeps the sums of parts that hold something, too.
            pub(crate) fn book(&mut self, taken: &mut FrameEnergies, frame: &FrameEnergies) {
                $(energies!(@book self, taken, frame, $name $(, end $end)? $(, sum $($sum)+)?);)+
                self.own.iter_mut().zip(frame.own).for_each(|(sum, part)| *sum += part);
            }
        }
    };
    (@book $account:ident, $taken:ident, $frame:ident, $name:ident) => {};
    (@book $account:ident, $taken:ident, $frame:ident, $name:ident, end $end:ident) => {
        $account.$name = $frame.$end
    };
    (@book $account:ident, $taken:ident, $frame:ident, $name:ident, sum $($sum:ident)+) => {
        $account.$name += 0.0 $(+ $frame.$sum)+
    };
    (@book $account:ident, $taken:ident, $frame:ident, $name:ident, end $end:ident, sum $sum:ident) => {
        $taken.$sum += $frame.$sum;
        $account.$name = $frame.$end + $taken.$sum
    };
}

energies! {
    elastic: 1.0, "strain energy stored in the law, at the beginning of the last step", end elastic;
    kinetic: 1.0, "kinetic energy in the middle of the last step, where velocities belong", end kinetic;
    half_step: 1.0, "what stored energies gained from the beginning of the last step to its middle, where the motion is", end half_step;
    hourglass: 1.0, "stored in the hourglass term", end hourglass;
    damping: 1.0, "dissipated by mass damping", sum damping;
    friction: 1.0, "dissipated by friction", sum friction;
    cutting: 1.0, "dissipated by the tip law and by the softening of the path", sum tip softening;
    cohesive: 1.0, "dissipated by faces that separate, plus what they store", end cohesive_stored, sum cohesive;
    adhesion: 1.0, "dissipated by tissue that slips on the tip", sum adhesion;
    plastic: 1.0, "dissipated by plastic flow", sum plastic;
    damage: 1.0, "dissipated by damage", sum damage;
    viscous: 1.0, "dissipated by the viscous terms", end viscous;
    contact: 1.0, "stored in contact, stick, tip and bond springs and in the dimple around the tip, plus what contact damping dissipated", end contact_stored, sum contact_damping;
    needle: 1.0, "gained and damped by a flexible needle", end needle;
    changes: -1.0, "put in by changes of numbers while the run went on: the same state stores more or less with other constants";
    raised_mass: 1.0, "taken by nodes whose mass was raised for a step: the kinetic energy of the mass that they have no more; negative where they gave", sum raised_mass;
    speed_limit: 1.0, "taken by the limit on the speed of nodes", sum speed_limit;
    advance_cap: 1.0, "dissipated at the tip beyond its law, while the cap on its advance holds its force above the threshold", sum advance_cap;
}

/// Energy below which a ratio would compare rounding with rounding [J].
const NOTHING: f64 = 1e-18;

fn ratio(part: f64, whole: f64) -> f64 {
    if whole <= NOTHING { 0.0 } else { part / whole }
}

impl EnergyAccount {
    /// External work and what effects of the program's own supplied [J].
    pub fn put_in(&self) -> f64 {
        self.external + self.own.iter().sum::<f64>()
    }

    /// Sum of everything that external work turned into [J].
    pub fn accounted(&self) -> f64 {
        Self::PARTS.iter().map(|part| part.sign * (part.of)(self)).sum::<f64>() - self.own.iter().sum::<f64>()
    }

    /// What nobody can explain, over the largest external work so far: (external - accounted) / largest |external|, positive
    /// where energy is lost; 0 while nothing has happened. What a run is judged by has a floor: [`crate::verdict`].
    pub fn imbalance(&self) -> f64 {
        if self.external_max > 0.0 { (self.external - self.accounted()) / self.external_max } else { 0.0 }
    }

    /// Elastic and hourglass energy [J].
    pub fn internal(&self) -> f64 {
        self.elastic + self.hourglass
    }

    /// Kinetic over internal energy; 0 where nothing is stored.
    pub fn kinetic_to_internal(&self) -> f64 {
        ratio(self.kinetic, self.internal())
    }

    /// Hourglass over internal energy; 0 where nothing is stored.
    pub fn hourglass_to_internal(&self) -> f64 {
        ratio(self.hourglass, self.internal())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_is_booked_by_the_table() {
        let frame = FrameEnergies {
            elastic: 1.0,
            tip: 2.0,
            softening: 3.0,
            contact_stored: 4.0,
            contact_damping: 5.0,
            adhesion: 6.0,
            ..Default::default()
        };
        let (mut account, mut taken) = (EnergyAccount { changes: 7.0, ..Default::default() }, Default::default());
        account.book(&mut taken, &frame);
        account.book(&mut taken, &frame);
        let told = (account.elastic, account.cutting, account.contact, account.adhesion, account.changes);
        assert_eq!(told, (1.0, 10.0, 14.0, 12.0, 7.0));
        assert_eq!(account.accounted(), 1.0 + 10.0 + 14.0 + 12.0 - 7.0);
        assert_eq!(EnergyAccount::PARTS[6].column, "cutting_j");
        let mut sum = frame;
        sum += frame;
        assert_eq!(sum - frame, frame);
    }

    #[test]
    fn ratios_are_zero_without_internal_energy() {
        let energy = EnergyAccount { kinetic: 1.0, ..Default::default() };
        assert_eq!(energy.kinetic_to_internal(), 0.0);
        let energy = EnergyAccount { kinetic: 1.0, elastic: 3.0, hourglass: 1.0, ..Default::default() };
        assert_eq!(energy.kinetic_to_internal(), 0.25);
        assert_eq!(energy.hourglass_to_internal(), 0.25);
    }
}
