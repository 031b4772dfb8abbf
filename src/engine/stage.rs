//! The list of stages of one step, and of the measurements at the end of a frame.

/// One stage of the step. Name = file stem in `shaders/stages` = pipeline label = timing label.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Where the sections of an opened path are; on adapters with many lanes, elsewhere within the next one.
    PathMeans,
    /// Tip law: springs between tip and anchors, threshold, advance of the material tip coordinate.
    AdvanceTip,
    /// Cells that the tip has passed lose stiffness; their energy is booked as cutting.
    SoftenPath,
    /// The same tip law on a free path: the tip finds its material point, and whether it is in open material.
    AdvanceFreeTip,
    /// Sample points that the tip of a free path has passed are marked; their cells lose stiffness.
    SoftenFreePath,
    /// J and volumetric stiffness of every tetrahedron.
    MeasureDilatation,
    /// By how much an opened path makes the tetrahedra around it grow.
    OpeningDilatation,
    /// Dilatation and pressure of every node of a tetrahedral mesh.
    AveragePressure,
    /// Stress and stiffness bound of every tetrahedron, as forces on its corners.
    TetrahedronForces,
    /// Stress, hourglass force and stiffness bound of every hexahedron, as forces on its corners.
    ElementForces,
    /// Traction and damage of faces that separate.
    CohesiveForces,
    /// Contact of cone and shaft with the opened path, friction, and tip springs on the nodes.
    NeedleContact,
    /// Forces of the points beside the opened path.
    OpeningPoints,
    /// What opening adds to the cells around the path.
    OpeningCells,
    /// What cells and points tell of the sections; on adapters with many lanes, elsewhere within the next one.
    PathSums,
    /// What the sections of the path do to tissue, needle and tip; friction.
    OpeningReactions,
    /// All of it on the nodes.
    OpeningNodes,
    /// Contact of a sphere or flat punch with the top face.
    IndenterContact,
    /// Gather, loads, damping, central difference, prescribed motion.
    IntegrateNodes,
    /// Energies, J, stress of every cell (once per frame).
    MeasureCells,
    /// Kinetic energy, speeds, counters of every node (once per frame).
    MeasureNodes,
    /// Energy that opening adds, and its sums (once per frame).
    MeasureOpening,
    /// Energy beside the opened path where nothing has relaxed (once per frame).
    MeasureRelaxation,
    /// The stress beside the opened path relaxes (once per frame).
    RelaxPath,
    /// Sums over the contact nodes (once per frame).
    MeasureContact,
    /// Reactions of the six faces (once per frame).
    MeasureFaces,
    /// Energies and torn area of faces that separate (once per frame).
    MeasureSeparation,
    /// Stress, pressure and stretch of every cell, for a window (once per frame that is drawn).
    CellFields,
    /// Their means at the nodes (once per frame that is drawn).
    NodeFields,
}

impl Stage {
    /// All stages in order.
    pub const ALL: [Stage; 29] = [
        Stage::PathMeans,
        Stage::AdvanceTip,
        Stage::SoftenPath,
        Stage::AdvanceFreeTip,
        Stage::SoftenFreePath,
        Stage::MeasureDilatation,
        Stage::OpeningDilatation,
        Stage::AveragePressure,
        Stage::TetrahedronForces,
        Stage::ElementForces,
        Stage::CohesiveForces,
        Stage::NeedleContact,
        Stage::OpeningPoints,
        Stage::OpeningCells,
        Stage::PathSums,
        Stage::OpeningReactions,
        Stage::OpeningNodes,
        Stage::IndenterContact,
        Stage::IntegrateNodes,
        Stage::MeasureCells,
        Stage::MeasureNodes,
        Stage::MeasureContact,
        // Adds to the loads of a flexible needle that the one above has summed.
        Stage::MeasureOpening,
        Stage::MeasureRelaxation,
        Stage::RelaxPath,
        Stage::MeasureFaces,
        Stage::MeasureSeparation,
        Stage::CellFields,
        Stage::NodeFields,
    ];

    /// File stem and label.
    pub fn name(self) -> &'static str {
        match self {
            Stage::PathMeans => "path_means",
            Stage::AdvanceTip => "advance_tip",
            Stage::SoftenPath => "soften_path",
            Stage::AdvanceFreeTip => "advance_free_tip",
            Stage::SoftenFreePath => "soften_free_path",
            Stage::MeasureDilatation => "measure_dilatation",
            Stage::OpeningDilatation => "opening_dilatation",
            Stage::AveragePressure => "average_pressure",
            Stage::TetrahedronForces => "tetrahedron_forces",
            Stage::ElementForces => "element_forces",
            Stage::CohesiveForces => "cohesive_forces",
            Stage::NeedleContact => "needle_contact",
            Stage::OpeningPoints => "opening_points",
            Stage::OpeningCells => "opening_cells",
            Stage::PathSums => "path_sums",
            Stage::OpeningReactions => "opening_reactions",
            Stage::OpeningNodes => "opening_nodes",
            Stage::IndenterContact => "indenter_contact",
            Stage::IntegrateNodes => "integrate_nodes",
            Stage::MeasureCells => "measure_cells",
            Stage::MeasureNodes => "measure_nodes",
            Stage::MeasureOpening => "measure_opening",
            Stage::MeasureRelaxation => "measure_relaxation",
            Stage::RelaxPath => "relax_path",
            Stage::MeasureContact => "measure_contact",
            Stage::MeasureFaces => "measure_faces",
            Stage::MeasureSeparation => "measure_separation",
            Stage::CellFields => "cell_fields",
            Stage::NodeFields => "node_fields",
        }
    }

    /// True for the stages that give forces for a displacement.
    pub fn gives_forces(self) -> bool {
        self.averages() || matches!(self, Stage::TetrahedronForces | Stage::ElementForces)
    }

    /// True for the stages that average the pressure of tetrahedra. A frame without a step has them all the same: its energies need them.
    pub fn averages(self) -> bool {
        matches!(self, Stage::MeasureDilatation | Stage::OpeningDilatation | Stage::AveragePressure)
    }

    /// True for the stages that give a window what it draws.
    pub fn draws(self) -> bool {
        matches!(self, Stage::CellFields | Stage::NodeFields)
    }

    /// True for the stages that run once per frame, in its last step: [`Stage::MeasureNodes`] after it, all others between its forces and
    /// [`Stage::IntegrateNodes`], so that stored energies belong to the same displacement as the forces.
    pub fn once_per_frame(self) -> bool {
        matches!(
            self,
            Stage::MeasureCells
                | Stage::MeasureNodes
                | Stage::MeasureOpening
                | Stage::MeasureRelaxation
                | Stage::RelaxPath
                | Stage::MeasureContact
                | Stage::MeasureFaces
                | Stage::MeasureSeparation
        )
    }
}
