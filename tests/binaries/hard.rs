//! Hard and random cases, and the guard.

#[path = "../guard.rs"]
mod guard;
#[path = "../stability.rs"]
mod stability;
