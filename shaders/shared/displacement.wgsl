// Displacement u in fixed point: one unit is 2^-36 m (14.6 pm), range +-31 mm; differences of neighbours are exact.
const DISPLACEMENT_UNIT: f32 = 1.4551915228366852e-11;
const UNITS_PER_METRE: f32 = 68719476736.0;
#ifdef TETRAHEDRA
// Corner displacements are subtracted in integers: half of the range shows that nothing wrapped round [m].
const LARGEST_DIFFERENCE: f32 = 15.6e-3;
#else
// The element stage adds four differences of corner displacements in integers: each must stay below a quarter of the
// range [m].
const LARGEST_DIFFERENCE: f32 = 7.8e-3;
#endif
