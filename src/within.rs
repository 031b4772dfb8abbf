//! Ranges of numbers that people write.

/// Range of a number, in the unit of its key.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Within {
    /// 0 < x <= limit.
    Positive(f64),
    /// 0 <= x <= limit.
    NotNegative(f64),
    /// low <= x <= high.
    Between(f64, f64),
}

impl Within {
    pub fn holds(self, value: f64) -> bool {
        match self {
            Within::Positive(limit) => value > 0.0 && value <= limit,
            Within::NotNegative(limit) => value >= 0.0 && value <= limit,
            Within::Between(low, high) => value >= low && value <= high,
        }
    }

    /// The range for a message, behind "must be".
    pub fn words(self) -> String {
        match self {
            Within::Positive(limit) => format!("greater than 0 and at most {limit}"),
            Within::NotNegative(limit) => format!("from 0 to {limit}"),
            Within::Between(low, high) => format!("from {low} to {high}"),
        }
    }
}
