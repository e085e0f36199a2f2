//! The equation of motion, and the slider in it as an elastic chain: its stiffness matrix S and its frequencies.
//!
//! ```text
//! m x_j'' = K_int (x_{j-1} - 2 x_j + x_{j+1}) + [j = 1] F_S - Σ_i k_i (x_j - a_i) - m γ x_j'
//! F_S     = K_d (V0 t + Δ (cos(2π t/T) - 1) - x_1)
//! ```
//!
//! At the ends the missing neighbour drops out. The sum runs over the attached contacts of block j; `a_i` is where
//! contact i attached. S is tridiagonal: the springs `K_int` between neighbours, the attached contacts of each block,
//! and the driving spring at block 1. All blocks have the same mass m, so the squared angular frequencies are the
//! eigenvalues of S/m; `deterministic_rows.rs` among the tests compares them with known ones. The solvers have their
//! own fast forms of the equation; `equation_of_motion.rs` compares them with the plain one.

use super::Parameters;
use super::theory::bisected;

/// The tridiagonal stiffness matrix of the slider for given contact stiffnesses.
#[derive(Clone, Debug)]
pub struct StiffnessMatrix {
    /// Diagonal, one entry a block, in N/m.
    pub diagonal: Vec<f64>,
    /// Off-diagonal entry -`K_int`, the same everywhere, in N/m.
    pub coupling: f64,
}

impl StiffnessMatrix {
    /// The matrix for `contacts[j]` N/m of attached contacts at block j, with the driving spring.
    pub fn new(parameters: &Parameters, contacts: &[f64]) -> Self {
        let coupling = parameters.coupling_stiffness();
        let last = contacts.len() - 1;
        let mut diagonal: Vec<f64> = contacts
            .iter()
            .enumerate()
            .map(|(j, contact)| {
                let neighbours = usize::from(j > 0) + usize::from(j < last);
                contact + neighbours as f64 * coupling
            })
            .collect();
        diagonal[0] += parameters.drive_stiffness;
        Self {
            diagonal,
            coupling: -coupling,
        }
    }

    /// The matrix with every contact attached, at its mean stiffness.
    pub fn intact(parameters: &Parameters) -> Self {
        Self::new(
            parameters,
            &vec![parameters.block_contact_stiffness(); parameters.blocks],
        )
    }

    /// Number of eigenvalues below a value, by the signs of the pivots of S - λ.
    fn eigenvalues_below(&self, value: f64) -> usize {
        let mut pivot = 1.0_f64;
        let mut below = 0;
        for (j, diagonal) in self.diagonal.iter().enumerate() {
            let fill = if j == 0 {
                0.0
            } else {
                self.coupling * self.coupling / pivot
            };
            pivot = diagonal - value - fill;
            if pivot == 0.0 {
                pivot = f64::MIN_POSITIVE;
            }
            below += usize::from(pivot < 0.0);
        }
        below
    }

    /// The eigenvalue with the given index, counted from the smallest, by bisection to the last bit, in N/m; infinite
    /// if an entry has overflowed.
    pub fn eigenvalue(&self, index: usize) -> f64 {
        let widest =
            self.diagonal.iter().fold(0.0_f64, |most, d| most.max(*d)) + 2.0 * self.coupling.abs();
        if !widest.is_finite() {
            return f64::INFINITY;
        }
        let high = widest * (1.0 + f64::EPSILON);
        bisected(-f64::EPSILON * widest, high, |value| {
            self.eigenvalues_below(value) > index
        })
    }
}

/// Largest angular frequency of the intact slider, in rad/s.
pub fn largest_frequency(parameters: &Parameters) -> f64 {
    (StiffnessMatrix::intact(parameters).eigenvalue(parameters.blocks - 1)
        / parameters.block_mass())
    .sqrt()
}
