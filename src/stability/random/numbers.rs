//! A small seeded source of numbers: splitmix64 (Steele, Lea, Flood 2014). The same on every machine.

/// Step of the state of splitmix64.
const STEP: u64 = 0x9E37_79B9_7F4A_7C15;

/// Numbers of one scene.
#[derive(Debug, Clone)]
pub struct Numbers(u64);

impl Numbers {
    /// Those of the scene `index` of `seed`: no scene needs the ones before it.
    pub fn of(seed: u64, index: u64) -> Self {
        let mut numbers = Numbers(seed ^ index.wrapping_mul(0xD1B5_4A32_D192_ED03));
        numbers.bits();
        Numbers(numbers.bits() ^ index)
    }

    /// 64 of them.
    pub fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(STEP);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// 0 <= x < 1.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Between two positive numbers, evenly in the logarithm.
    pub fn log(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.unit())
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.unit() < probability
    }

    /// 0 to `count` - 1.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count as u64) as usize
    }

    /// From the normal distribution of mean 0 and deviation 1 (Box and Muller 1958).
    pub fn normal(&mut self) -> f64 {
        // 1 - x is never 0.
        (-2.0 * (1.0 - self.unit()).ln()).sqrt() * (std::f64::consts::TAU * self.unit()).cos()
    }

    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.below(from.len())]
    }
}

/// A number as a scene has it, with five digits: what the mathematical functions of two machines do in the last bit is lost.
pub fn written(x: f64) -> String {
    let short: f64 = format!("{x:.4e}").parse().expect("a number that was just written");
    format!("{short:?}")
}

/// Three numbers or two, as a list.
pub fn list(values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|x| written(*x)).collect();
    format!("[{}]", texts.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_those_of_splitmix64_and_differ_from_scene_to_scene() {
        // First output of the reference implementation from the state 0.
        assert_eq!(Numbers(0).bits(), 0xE220_A839_7B1D_CDAF);
        let first: Vec<u64> = (0..100).map(|index| Numbers::of(7, index).bits()).collect();
        assert!((0..100).all(|i| !first[..i].contains(&first[i])));
        let mut numbers = Numbers::of(1, 2);
        let mean = (0..1000).map(|_| numbers.unit()).sum::<f64>() / 1000.0;
        assert!((mean - 0.5).abs() < 0.05, "{mean}");
    }

    #[test]
    fn a_written_number_is_a_float_of_toml() {
        assert_eq!(written(10.0), "10.0");
        assert_eq!(written(1.0 / 3.0), "0.33333");
        assert_eq!(list(&[0.5, -2e-7]), "[0.5, -2e-7]");
    }
}
