//! Studies, hard and random cases, the guard.

#[path = "../guard.rs"]
mod guard;
#[path = "../stability.rs"]
mod stability;
#[path = "../study.rs"]
mod study;
