//! What every law, effect and element computes: against references, closed forms and the f64 engine.

#[path = "../common/mod.rs"]
mod common;
#[path = "../dynamics.rs"]
mod dynamics;
#[path = "../effects/main.rs"]
mod effects;
#[path = "../fields.rs"]
mod fields;
#[path = "../indentation.rs"]
mod indentation;
#[path = "../lanes.rs"]
mod lanes;
#[path = "../lanes_tets.rs"]
mod lanes_tets;
#[path = "../material/main.rs"]
mod material;
#[path = "../material_point/main.rs"]
mod material_point;
#[path = "../needle_beam.rs"]
mod needle_beam;
#[path = "../own_effect/main.rs"]
mod own_effect;
#[path = "../penetration.rs"]
mod penetration;
#[path = "../tets/main.rs"]
mod tets;
