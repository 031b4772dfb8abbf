//! Structs shared with the shaders: same names, same fields, same order as in `shaders/`. A test compares the layouts.

use bytemuck::{Pod, Zeroable};

/// Declares `#[repr(C)]` structs with a list of their field names and offsets for the layout test.
macro_rules! shared_structs {
    ($($(#[$meta:meta])* struct $name:ident { $($field:ident: $ty:ty,)* })*) => {
        $(
            $(#[$meta])*
            #[repr(C)]
            #[derive(Debug, Clone, Copy, Default, PartialEq, Pod, Zeroable)]
            pub struct $name { $(pub $field: $ty,)* }
        )*

        /// Name, size and (field, offset) of every shared struct.
        pub fn layouts() -> Vec<(&'static str, usize, Vec<(&'static str, usize)>)> {
            vec![$((
                stringify!($name),
                size_of::<$name>(),
                vec![$((stringify!($field), std::mem::offset_of!($name, $field)),)*],
            ),)*]
        }
    };
}

shared_structs! {
    /// shaders/shared/params.wgsl
    struct Params {
        quartic: f32,
        dt: f32,
        mass_damping: f32,
        speed_limit: f32,
    }
    /// shaders/shared/elastic.wgsl
    struct Material {
        constants: [f32; 4],
        bulk_modulus: f32,
        shear_modulus: f32,
        hourglass: f32,
        law: u32,
    }
    /// shaders/shared/needle_in_tissue.wgsl
    struct DrawnNeedle {
        tip: [f32; 4],
        direction: [f32; 4],
        opened: [f32; 4],
        bevel: [f32; 4],
        middle: [f32; 4],
        bend: [[f32; 4]; 32],
    }
    /// shaders/shared/point_history.wgsl
    struct PointHistory {
        flow: f32,
        degradation: f32,
        relaxation_work: f32,
        failures: f32,
    }
    /// shaders/effects/plasticity.wgsl
    struct PlasticState {
        x: [f32; 4],
        y: [f32; 4],
        z: [f32; 4],
    }
    /// shaders/effects/fibres.wgsl
    struct FibreParams {
        direction: [f32; 4],
        k1: f32,
        k2: f32,
        _pad0: f32,
        _pad1: f32,
    }
    /// shaders/effects/viscoelastic.wgsl
    struct PronyTerm {
        ratio: f32,
        decay: f32,
        compliance: f32,
        _pad: f32,
    }
    /// shaders/effects/viscoelastic.wgsl
    struct PronySeries {
        terms: [PronyTerm; 8],
    }
    /// shaders/effects/viscoelastic.wgsl
    struct ViscousLayout {
        entries: u32,
        term_count: u32,
        _pad1: u32,
        _pad2: u32,
    }
    /// shaders/effects/viscoelastic.wgsl
    struct ViscousStress {
        normal: [u32; 4],
        shear: [u32; 4],
    }
    /// shaders/shared/own_effects.wgsl
    struct OwnState {
        memory: [f32; 4],
        supplied: f32,
        _pad0: f32,
        _pad1: f32,
        _pad2: f32,
    }
    /// shaders/effects/damage.wgsl
    struct DamageParams {
        onset: f32,
        inverse_displacement: f32,
        largest: f32,
        deletion: f32,
    }
    /// shaders/shared/step_input.wgsl
    struct DriveStep {
        translation_rate: [f32; 4],
        cosine_rate: f32,
        sine_rate: f32,
        _pad0: f32,
        _pad1: f32,
    }
    /// shaders/shared/step_input.wgsl
    struct StepInput {
        tip: [f32; 4],
        velocity: [f32; 4],
        direction: [f32; 4],
        velocity_ahead: [f32; 4],
        angular_velocity_ahead: [f32; 4],
        depth: f32,
        step: u32,
        load_factor: f32,
        rounding: f32,
        drives: [DriveStep; 6],
    }
    /// shaders/shared/cell_edge.wgsl
    struct CellEdge {
        length: f32,
        cube_root: f32,
        quarter_inverse: f32,
        _pad: f32,
    }
    /// shaders/shared/tetrahedron.wgsl
    struct Tetrahedron {
        nodes: [u32; 4],
        slots: [u32; 4],
        gradient_b_and_volume: [f32; 4],
        gradient_c_and_edge: [f32; 4],
        gradient_d_and_material: [f32; 4],
    }
    /// shaders/shared/mesh_node.wgsl
    struct MeshNode {
        arm: [f32; 4],
        first_four: u32,
        end_four: u32,
        flags: u32,
        inverse_volume: f32,
    }
    /// shaders/effects/gravity.wgsl
    struct GravityParams {
        acceleration: [f32; 4],
    }
    /// shaders/effects/puncture.wgsl
    struct PunctureParams {
        exit: f32,
        tip_stiffness: f32,
        residual_stiffness: f32,
        contact_stiffness: f32,
        contact_damping: f32,
        entry_fade: f32,
        needle_radius: f32,
        tip_length: f32,
        anchor_reach: f32,
        path_cell_count: u32,
        softened_radius: f32,
        ring_radius: f32,
        shift: [f32; 4],
        edge_radius: f32,
        bore_radius: f32,
        bore_grip: f32,
        face_stiffness: f32,
        face_damping: f32,
        ring_stiffness: f32,
        _pad3: u32,
        _pad4: u32,
        reference: [f32; 4],
        free_low: [u32; 4],
        free_count: [u32; 4],
        membranes: u32,
        rate_exponent: f32,
        reference_speed: f32,
        transition_length: f32,
        segments: [[f32; 4]; 16],
    }
    /// shaders/effects/puncture.wgsl
    struct TipAnchor {
        surface: [f32; 4],
        column: [u32; 4],
        local: [f32; 4],
    }
    /// shaders/shared/tetrahedron_anchor.wgsl
    struct LinePiece {
        nodes: [u32; 4],
        weights: [f32; 4],
        slopes: [f32; 4],
        range: [f32; 4],
    }
    /// shaders/effects/puncture.wgsl
    struct TipAnchorLoad {
        cell: [u32; 4],
        load: [f32; 4],
    }
    /// shaders/effects/puncture.wgsl
    struct TipState {
        coordinate: f32,
        dissipation: f32,
        spring_energy: f32,
        softening: f32,
        membrane_impulse: f32,
        bond_impulse: f32,
        bond_dissipation: f32,
        bond_stretch: f32,
        bond_slid: f32,
        gap: f32,
        cap_dissipation: f32,
        dimple: f32,
        touch_force: f32,
        advanced: f32,
        shifted: f32,
        touch_stretch: f32,
    }
    /// shaders/effects/puncture.wgsl
    struct PathCell {
        cell: u32,
        left: f32,
        axial_start: f32,
        axial_end: f32,
        dissipation: f32,
        material: u32,
        _pad0: u32,
        _pad1: u32,
    }
    /// shaders/effects/opening.wgsl
    struct OpeningParams {
        direction: [f32; 4],
        entry: [f32; 4],
        numbers: [f32; 4],
        counts: [u32; 4],
        sums: [u32; 4],
        surface: [f32; 4],
        dimple: [[f32; 4]; 26],
        advances: [[f32; 4]; 4],
    }
    /// shaders/effects/opening.wgsl
    struct OpeningStation {
        depth: [f32; 4],
        springs: [f32; 4],
        lists: [u32; 4],
        centre: [f32; 4],
        centre_rate: [f32; 4],
        place: [f32; 4],
        rubbing: [f32; 4],
        by_centre: [f32; 4],
        by_rate: [f32; 4],
        along: [f32; 4],
        across: [f32; 4],
        impulse: [f32; 4],
        rest: [f32; 4],
        rest_direction: [f32; 4],
        disc: [f32; 4],
        by_moment: [f32; 4],
        relaxation: [f32; 4],
        opened: [[f32; 4]; 2],
        shares: [[f32; 4]; 2],
        rates: [[f32; 4]; 2],
    }
    /// shaders/effects/opening.wgsl
    struct OpeningEntry {
        index: u32,
        first: f32,
        second: f32,
        _pad: f32,
    }
    /// shaders/effects/opening.wgsl
    struct OpeningSum {
        by_centre: [f32; 4],
        by_rate: [f32; 4],
        by_moment: [f32; 4],
    }
    /// shaders/effects/opening.wgsl
    struct OpeningRecord {
        impulse: [f32; 4],
        angular_impulse: [f32; 4],
        parts: [f32; 4],
        now: [f32; 4],
        late: [f32; 4],
    }
    /// shaders/shared/opening_cluster.wgsl
    struct OpeningPoint {
        place: [f32; 4],
        numbers: [u32; 4],
    }
    /// shaders/shared/opening_cluster.wgsl
    struct OpeningCluster {
        cell: [u32; 4],
        points: [u32; 4],
        middle: [f32; 4],
        inverse: [f32; 4],
    }
    /// shaders/shared/opening_cell.wgsl
    struct OpeningCell {
        cell: [u32; 4],
        stations: [u32; 4],
        middle: [f32; 4],
        inverse: [f32; 4],
        place: [f32; 4],
    }
    /// shaders/effects/opening.wgsl
    struct OpeningTotals {
        record: OpeningRecord,
        elastic: [[[f32; 4]; 32]; 8],
    }
    /// shaders/stages/opening_nodes.wgsl
    struct OpeningNode {
        numbers: [u32; 4],
        more: [u32; 4],
    }
    /// shaders/shared/tied_nodes.wgsl
    struct TiedNode {
        copies: [u32; 4],
        mass: f32,
        whole_mass: f32,
        _pad0: f32,
        _pad1: f32,
    }
    /// shaders/effects/cohesive.wgsl
    struct CohesiveParams {
        onset: f32,
        shear_onset: f32,
        energy: f32,
        shear_energy: f32,
        exponent: f32,
        penalty: f32,
        inverse_ramp: f32,
        torn_reach: f32,
        pair_count: u32,
        _pad0: u32,
        _pad1: u32,
        _pad2: u32,
    }
    /// shaders/effects/cohesive.wgsl
    struct FacePair {
        nodes: [u32; 4],
        ring: [u32; 4],
        first_way_and_area: [f32; 4],
        second_way_and_start: [f32; 4],
        contacts: [u32; 4],
    }
    /// shaders/effects/cohesive.wgsl
    struct PairState {
        damage: f32,
        dissipation: f32,
        stored: f32,
        _pad: f32,
    }
    /// shaders/stages/measure_separation.wgsl
    struct SeparationSums {
        dissipation: f32,
        stored: f32,
        torn_area: f32,
        _pad: f32,
    }
    /// shaders/effects/free_path.wgsl
    struct FreeTip {
        place: [f32; 4],
        along: [f32; 4],
        across: [f32; 4],
        sway: [f32; 4],
        coordinate: f32,
        entry: f32,
        advance: f32,
        inside: f32,
        material: u32,
        dissipation: f32,
        spring_energy: f32,
        cap_dissipation: f32,
    }
    /// shaders/effects/free_path.wgsl
    struct FreeCell {
        low: [f32; 4],
        size: [f32; 4],
        cell: u32,
        material: u32,
        marked_low: u32,
        marked_high: u32,
        dissipation: f32,
        tissue: u32,
        height_01: f32,
        height_11: f32,
    }
    /// shaders/effects/flexible_needle.wgsl
    struct CentreLine {
        per_length: f32,
        first_step: u32,
        _pad0: u32,
        _pad1: u32,
        offset: [[f32; 4]; 32],
        rate: [[f32; 4]; 32],
    }
    /// shaders/effects/indentation.wgsl
    struct IndentationParams {
        radius: f32,
        face_stiffness: f32,
        face_damping: f32,
        flat: u32,
        bonded: u32,
        _pad0: u32,
        entry: [f32; 2],
    }
    /// shaders/shared/contact_node.wgsl
    struct ContactNode {
        rest: [f32; 4],
        grid: [u32; 4],
        surface: [f32; 4],
        numbers: [u32; 4],
        sizes: [f32; 4],
        ring_low: [u32; 4],
        ring_high: [u32; 4],
    }
    /// shaders/shared/contact_node.wgsl
    struct ContactRecord {
        stick: [f32; 4],
        touch: [f32; 4],
        path: [f32; 4],
        impulse: [f32; 4],
        angular_impulse: [f32; 4],
        parts: [f32; 4],
        energies: [f32; 4],
    }
    /// shaders/shared/contact_node.wgsl
    struct ContactSums {
        impulse: [f32; 4],
        angular_impulse: [f32; 4],
        parts: [f32; 4],
        energies: [f32; 4],
    }
    /// shaders/shared/cell_sums.wgsl
    struct CellSums {
        elastic: f32,
        hourglass: f32,
        min_jacobian: f32,
        min_corner_jacobian: f32,
        inverted_cells: u32,
        inverted_cell: u32,
        overstretched_cells: u32,
        deleted_cells: u32,
        flow: f32,
        degradation: f32,
        relaxation: f32,
        least_intact: f32,
        failures: f32,
        folded_cells: u32,
        _pad0: u32,
        _pad1: u32,
    }
    /// shaders/shared/node_sums.wgsl
    struct NodeSums {
        kinetic: f32,
        damping: f32,
        work: f32,
        moment_x: f32,
        moment_y: f32,
        moment_z: f32,
        max_speed: f32,
        raised_mass: u32,
        out_of_range: u32,
        clamped_nodes: u32,
        raised_energy: f32,
        clamped_energy: f32,
        step_ratio: f32,
        half_step: f32,
        _pad0: u32,
        _pad1: u32,
    }
}
