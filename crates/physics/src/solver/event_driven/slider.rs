//! The slider as it moves: its contacts, the chain that they make of the blocks, and the motion of the blocks.
//!
//! Blocks lie in rows of eight: block j in row j mod R of lane j div R, with R = ceil(N/8). The neighbours of a block
//! are then the rows above and below in the same lane; beyond the first and the last row they lie in the next lane.
//! Slots beyond the last block keep a coupling, a stiffness and a force of zero and stay at rest.

use super::moving_frame::OriginShift;
use crate::model::equation::StiffnessMatrix;
use crate::model::simd::{Simd, Vector};
use crate::model::{AttachedContacts, ContactChange, Interface, LANES, Parameters, Row};
use pulp::Scalar512b;

/// Block 1, at which the drive pulls, in the first row.
pub(super) const FIRST_BLOCK: Row = Row([1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);

#[derive(Clone, Copy, Debug)]
pub(super) struct BlockLayout {
    pub blocks: usize,
    pub rows: usize,
}

/// Where a block lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Slot {
    pub row: usize,
    pub lane: usize,
}

impl Slot {
    pub const FIRST: Self = Self { row: 0, lane: 0 };
}

impl BlockLayout {
    pub fn new(blocks: usize) -> Self {
        Self {
            blocks,
            rows: blocks.div_ceil(LANES),
        }
    }

    #[inline]
    pub fn slot(self, block: usize) -> Slot {
        Slot {
            row: block % self.rows,
            lane: block / self.rows,
        }
    }

    /// Block in a slot; beyond the last one for padding.
    pub fn block(self, Slot { row, lane }: Slot) -> usize {
        lane * self.rows + row
    }

    /// Rows for all blocks, filled with one value.
    pub fn filled(self, value: f64) -> Vec<Row> {
        vec![Row::filled(value); self.rows]
    }
}

/// Displacements and velocities in lanes.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub displacement: Vec<Row>,
    pub velocity: Vec<Row>,
}

/// The chain's coefficients in lanes.
#[derive(Clone, Debug)]
pub(super) struct Chain {
    pub layout: BlockLayout,
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
    pub fn new(parameters: &Parameters, layout: BlockLayout) -> Self {
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
            let Slot { row, lane } = layout.slot(block);
            chain.coupling[row][lane] = parameters.coupling_stiffness() / chain.mass;
            chain.bare[row][lane] = *diagonal;
            chain.diagonal[row][lane] = diagonal / chain.mass;
        }
        chain
    }

    /// Updates the coefficients of a block whose contacts have changed.
    pub fn update(&mut self, block: usize, interface: &Interface) {
        let Slot { row, lane } = self.layout.slot(block);
        self.diagonal[row][lane] =
            (self.bare[row][lane] + interface.block_stiffness[block]) / self.mass;
        self.pull[row][lane] = interface.block_pull[block] / self.mass;
        self.upper[row][lane] = interface.block_upper[block];
        self.lower[row][lane] = interface.block_lower[block];
    }

    #[inline]
    pub fn at(&self, rows: &[Row], block: usize) -> f64 {
        let Slot { row, lane } = self.layout.slot(block);
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

/// Contacts, chain and motion, which change together. All displacements are those of the frame.
#[derive(Clone, Debug)]
pub(super) struct Slider {
    pub interface: Interface,
    pub chain: Chain,
    pub state: State,
}

impl Slider {
    /// At rest, with all contacts attached.
    pub fn new(parameters: &Parameters) -> Self {
        let layout = BlockLayout::new(parameters.blocks);
        let interface = Interface::new(parameters);
        let mut chain = Chain::new(parameters, layout);
        for block in 0..layout.blocks {
            chain.update(block, &interface);
        }
        Self {
            interface,
            chain,
            state: State {
                displacement: layout.filled(0.0),
                velocity: layout.filled(0.0),
            },
        }
    }

    /// Displacement of a block, in m.
    #[inline]
    pub fn displacement(&self, block: usize) -> f64 {
        self.chain.at(&self.state.displacement, block)
    }

    /// Displacements of all blocks, in m.
    pub fn displacements(&self) -> impl Iterator<Item = f64> {
        (0..self.chain.layout.blocks).map(|block| self.displacement(block))
    }

    /// Mean displacement of the blocks, in m.
    #[inline]
    pub fn mean_displacement(&self) -> f64 {
        self.chain.mean(Scalar512b, &self.state.displacement)
    }

    /// Breaks the contacts of a block that has reached a break position, at displacement `x` m.
    #[inline]
    pub fn break_reached(
        &mut self,
        block: usize,
        time: f64,
        x: f64,
        log: impl FnMut(ContactChange, AttachedContacts),
    ) {
        let Slot { row, lane } = self.chain.layout.slot(block);
        let upper = self.chain.upper[row][lane];
        let lower = self.chain.lower[row][lane];
        // Rounding may leave the block just short of the position that it has reached.
        let reached = if upper - x <= x - lower {
            x.max(upper)
        } else {
            x.min(lower)
        };
        self.interface.break_reached(block, time, reached, log);
        self.chain.update(block, &self.interface);
    }

    /// Attaches the contact that is due next, at displacement `x` m of its block.
    #[inline]
    pub fn attach_next(&mut self, x: f64) -> ContactChange {
        let change = self.interface.reattach_running(Scalar512b, x);
        self.chain.update(change.block, &self.interface);
        change
    }

    pub fn move_origin(&mut self, OriginShift { time, displacement }: OriginShift) {
        self.interface.move_origin(time, displacement);
        for block in 0..self.chain.layout.blocks {
            let Slot { row, lane } = self.chain.layout.slot(block);
            self.state.displacement[row][lane] -= displacement;
            self.chain.update(block, &self.interface);
        }
    }
}
