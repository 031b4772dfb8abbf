// What the points of the faces of a slit do to a node. The same functions as in shared/surface_pressing.
#import shared/pressing
#import shared/slit_contact

// Its faces may touch where the node does not.
fn is_pressed(contact: Contact, touch: Touch) -> bool {
    return contact.faces != 0u;
}

fn pressing(
    index: u32,
    contact: Contact,
    touch: Touch,
    axis: Axis,
    lever: vec3<f32>,
    s: f32,
    memory: ptr<function, Memory>,
    sums: ptr<function, StepSums>,
) -> Pressing {
    let points = slit_force(index);
    let normal = points.normal;
    (*sums).stored = points.stored;
    (*sums).angular_impulse = (points.torque - cross(lever, normal)) * params.dt;
    (*sums).shaft = dot(points.on_shaft, step_input.direction.xyz) * params.dt;
    (*sums).work = (points.axis_power - axis_power(axis, normal)) * params.dt;
    let size = length(normal);
    let n = normal * select(0.0, 1.0 / size, size > 0.0);
    let v = node_velocity[contact.node].xyz - axis.velocity;
    (*memory).touching = select(0.0, 1.0, size > 0.0);
    (*memory).on_shaft = select(0.0, 1.0, dot(points.on_shaft, points.on_shaft) > 0.0 && s >= puncture.tip_length);
    return Pressing(
        normal, n, v, points.damping, points.rubbing, puncture.face_stiffness * contact.share, points.bound,
    );
}

fn surface_coefficient(contact: Contact, of_shaft: f32) -> f32 {
    return of_shaft;
}
