//! The slider as it moves: its contacts, the chain that they make of the blocks, and the motion of the blocks.

use super::chain::{Chain, State};
use super::lane_layout::Layout;
use crate::model::{ContactChange, Interface, Parameters};
use pulp::Scalar512b;

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
        let layout = Layout::new(parameters.blocks);
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
        log: impl FnMut(ContactChange, (u64, f64)),
    ) {
        let (row, lane) = self.chain.layout.slot(block);
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

    /// Moves the origin by `time` s and `displacement` m.
    pub fn move_origin(&mut self, time: f64, displacement: f64) {
        self.interface.move_origin(time, displacement);
        for block in 0..self.chain.layout.blocks {
            let (row, lane) = self.chain.layout.slot(block);
            self.state.displacement[row][lane] -= displacement;
            self.chain.update(block, &self.interface);
        }
    }
}
