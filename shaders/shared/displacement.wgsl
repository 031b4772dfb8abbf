// Displacement u in fixed point: one unit is 2^-36 m (14.6 pm), range +-31 mm; differences of neighbours are exact.
const DISPLACEMENT_UNIT: f32 = 1.4551915228366852e-11;
const UNITS_PER_METRE: f32 = 68719476736.0;
// The element stage adds four differences of corner displacements in integers: each must stay below a quarter of the
// range [m].
const LARGEST_DIFFERENCE: f32 = 7.8e-3;
