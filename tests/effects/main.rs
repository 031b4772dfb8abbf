//! Every law against its reference, every kernel against the f64 engine and against known answers.

mod adhesion;
mod cohesive;
mod damage;
mod element;
mod fibres;
mod flexible_needle;
mod friction;
mod gravity;
mod indentation;
mod laid_path;
mod laws;
mod mass_scaling;
mod mooney_rivlin;
mod opening;
mod plasticity;
mod puncture;
mod viscoelastic;
