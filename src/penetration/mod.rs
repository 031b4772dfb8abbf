//! What a needle does to tissue ahead of its tip and around its shaft, from constants that can be measured: the elastic law, the
//! toughness, the radius of the needle.
//!
//! A sharp needle cuts a slit of rest length 2a and wedges it open [Shergold2004]; a blunt or hollow one cuts a ring. With the strain
//! energy U(a, R) of the medium per length of shaft, in plane strain and without volume change,
//! ```text
//! F_tip = min_a [U(a, R) + 2 a J_c],  N = dU/dR at fixed a                          [N], [N/m]
//! ```
//! F_tip is the steady force of the tip, N the normal force of the tissue on a length of shaft, J_c the toughness per area of a slit
//! of width 2a [J/m^2]. U is homogeneous of degree two in (a, R), so `N R = F_tip + U` at the optimum.
//!
//! [`wedged_crack`] solves the slit (a quarter plane of `slit_mesh`), [`wedge_curve`] follows it over all sizes, [`cavity`] has the
//! round hole and the ring crack in closed integrals, [`steady`] what follows for one material and needle. [`indentation`] is the tip on a
//! surface that it has not cut, [`surface`] what of it the run takes.

#![warn(missing_docs)]

pub mod cavity;
pub mod compressible;
pub mod indentation;
pub mod law;
mod mixed_cell;
pub mod neo_hooke_curve;
mod quadrature;
mod skyline;
pub mod slit_mesh;
pub mod steady;
pub mod surface;
pub mod wedge_curve;
pub mod wedged_crack;

pub use steady::{Ring, Steady, Unsolved};
