//! The chain of blocks as the solver sees it: its coefficients in lanes, updated as contacts break and attach.

use super::lane_layout::Layout;
use crate::model::equation::StiffnessMatrix;
use crate::model::simd::{Simd, Vector};
use crate::model::{Interface, Parameters, Row};

/// Displacements and velocities in lanes.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub displacement: Vec<Row>,
    pub velocity: Vec<Row>,
}

/// The chain's coefficients in lanes, all divided by the block mass.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub layout: Layout,
    /// Block mass m, in kg.
    pub mass: f64,
    /// Diagonal of S without contacts, in N/m.
    pub bare: Vec<Row>,
    /// K_int/m, in 1/s²; 0 in padding.
    pub coupling: Vec<Row>,
    /// Diagonal of S/m, in 1/s².
    pub diagonal: Vec<Row>,
    /// Contact force at displacement zero, Σ k_i a_i/m, in m/s².
    pub pull: Vec<Row>,
    /// Nearest break positions, in m.
    pub upper: Vec<Row>,
    pub lower: Vec<Row>,
    /// Stiffness K_d of the driving spring, in N/m.
    pub drive_stiffness: f64,
    /// Damping rate γ, in 1/s.
    pub damping_rate: f64,
}

impl Chain {
    /// The chain without contacts, driven at block 1.
    pub fn new(parameters: &Parameters, layout: Layout) -> Self {
        let mut chain = Self {
            layout,
            mass: parameters.block_mass(),
            bare: layout.filled(0.0),
            coupling: layout.filled(0.0),
            diagonal: layout.filled(0.0),
            pull: layout.filled(0.0),
            upper: layout.filled(f64::INFINITY),
            lower: layout.filled(f64::NEG_INFINITY),
            drive_stiffness: parameters.drive_stiffness,
            damping_rate: parameters.damping_rate,
        };
        let bare = StiffnessMatrix::new(parameters, &vec![0.0; layout.blocks]);
        for (block, diagonal) in bare.diagonal.iter().enumerate() {
            let (row, lane) = layout.slot(block);
            chain.coupling[row][lane] = parameters.coupling_stiffness() / chain.mass;
            chain.bare[row][lane] = *diagonal;
            chain.diagonal[row][lane] = diagonal / chain.mass;
        }
        chain
    }

    /// Updates the coefficients of a block whose contacts have changed.
    pub fn update(&mut self, block: usize, interface: &Interface) {
        let (row, lane) = self.layout.slot(block);
        self.diagonal[row][lane] =
            (self.bare[row][lane] + interface.block_stiffness[block]) / self.mass;
        self.pull[row][lane] = interface.block_pull[block] / self.mass;
        self.upper[row][lane] = interface.block_upper[block];
        self.lower[row][lane] = interface.block_lower[block];
    }

    /// The entry of a block.
    #[inline]
    pub fn at(&self, rows: &[Row], block: usize) -> f64 {
        let (row, lane) = self.layout.slot(block);
        rows[row][lane]
    }

    /// Mean of the entries of all blocks, where those of padding are 0.
    #[inline(always)]
    pub fn mean<S: Simd>(&self, simd: S, rows: &[Row]) -> f64 {
        let mut sums = simd.splat(0.0);
        for row in rows {
            sums = sums.plus(simd.load(row));
        }
        sums.reduce(|a, b| a + b) / self.layout.blocks as f64
    }
}
