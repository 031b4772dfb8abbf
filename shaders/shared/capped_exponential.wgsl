// exp(x) - 1, its first and second derivative; beyond x = 10 the second-order Taylor polynomial.
fn capped_exponential(x: f32) -> vec3<f32> {
    const LARGEST: f32 = 10.0;
    const EXP_LARGEST: f32 = 22026.466;
    let e = exp(min(x, LARGEST));
    // Without cancellation where x is small.
    let minus_one = select(e - 1.0, x * (1.0 + 0.5 * x * (1.0 + 0.33333333 * x * (1.0 + 0.25 * x))), abs(x) < 0.05);
    let d = x - LARGEST;
    let beyond = vec3<f32>(EXP_LARGEST * (1.0 + d * (1.0 + 0.5 * d)) - 1.0, EXP_LARGEST * (1.0 + d), EXP_LARGEST);
    return select(vec3<f32>(minus_one, e, e), beyond, x > LARGEST);
}
