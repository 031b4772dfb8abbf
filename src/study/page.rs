//! `study.html`.
use super::analysis::Analysis;
use crate::error::Result;

pub fn page(_analysis: &Analysis, _command: &str, _written: &str) -> Result<String> {
    Ok(String::new())
}
