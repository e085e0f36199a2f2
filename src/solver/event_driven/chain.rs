//! The chain of blocks as the solver sees it: its coefficients in lanes, updated as contacts break and attach.

use super::layout::Layout;
use crate::model::equation::StiffnessMatrix;
use crate::model::{Interface, Parameters, Row};

/// The coefficients that depend on contacts, one entry a block.
#[derive(Clone, Debug)]
pub(super) struct PerBlock {
    /// Diagonal of S/m, in 1/s².
    pub diagonal: Vec<f64>,
    /// Contact force at displacement zero, Σ k_i a_i/m, in m/s².
    pub pull: Vec<f64>,
    /// Nearest break positions, in m.
    pub upper: Vec<f64>,
    pub lower: Vec<f64>,
}

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
    /// Share of a block in a mean, 1/N; 0 in padding.
    shares: Vec<Row>,
    /// Diagonal of S/m, in 1/s².
    pub diagonal: Vec<Row>,
    /// Contact force at displacement zero, Σ k_i a_i/m, in m/s².
    pub pull: Vec<Row>,
    /// Nearest break positions, in m.
    pub upper: Vec<Row>,
    pub lower: Vec<Row>,
    /// The same four for the eliminations of a leap, which go from block to block.
    pub per_block: PerBlock,
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
            shares: layout.filled(0.0),
            diagonal: layout.filled(0.0),
            pull: layout.filled(0.0),
            upper: layout.filled(f64::INFINITY),
            lower: layout.filled(f64::NEG_INFINITY),
            per_block: PerBlock {
                diagonal: vec![0.0; layout.blocks],
                pull: vec![0.0; layout.blocks],
                upper: vec![f64::INFINITY; layout.blocks],
                lower: vec![f64::NEG_INFINITY; layout.blocks],
            },
            drive_stiffness: parameters.drive_stiffness,
            damping_rate: parameters.damping_rate,
        };
        let bare = StiffnessMatrix::new(parameters, &vec![0.0; layout.blocks]);
        for (block, diagonal) in bare.diagonal.iter().enumerate() {
            let (row, lane) = layout.slot(block);
            chain.coupling[row][lane] = parameters.coupling_stiffness() / chain.mass;
            chain.bare[row][lane] = *diagonal;
            chain.shares[row][lane] = 1.0 / layout.blocks as f64;
            let diagonal = diagonal / chain.mass;
            (chain.diagonal[row][lane], chain.per_block.diagonal[block]) = (diagonal, diagonal);
        }
        chain
    }

    /// Updates the coefficients of a block whose contacts have changed.
    pub fn update(&mut self, block: usize, interface: &Interface) {
        let (row, lane) = self.layout.slot(block);
        let diagonal = (self.bare[row][lane] + interface.block_stiffness[block]) / self.mass;
        let pull = interface.block_pull[block] / self.mass;
        let (upper, lower) = (interface.block_upper[block], interface.block_lower[block]);
        (self.diagonal[row][lane], self.per_block.diagonal[block]) = (diagonal, diagonal);
        (self.pull[row][lane], self.per_block.pull[block]) = (pull, pull);
        (self.upper[row][lane], self.per_block.upper[block]) = (upper, upper);
        (self.lower[row][lane], self.per_block.lower[block]) = (lower, lower);
    }

    /// The entry of a block.
    #[inline]
    pub fn at(&self, rows: &[Row], block: usize) -> f64 {
        let (row, lane) = self.layout.slot(block);
        rows[row][lane]
    }

    /// Mean of the entries of all blocks.
    #[inline]
    pub fn mean(&self, rows: &[Row]) -> f64 {
        let mut sum = Row::filled(0.0);
        for (row, shares) in rows.iter().zip(&self.shares) {
            sum.0 = std::array::from_fn(|lane| sum[lane] + row[lane] * shares[lane]);
        }
        sum.reduce(|a, b| a + b)
    }
}
