//! What a contact event changes in the motion that follows it within a step, on the grid and in Taylor steps.
//!
//! An event changes the force on one block j, by (ΔP - ΔK x_j)/m per mass, where K and P are the sums of k_i and of
//! k_i a_i over its attached contacts. With ξ the position in the step since the event, x_j(ξ) = Σ c_p ξ^p and
//! g_p = h² (ΔP - ΔK x_j)_p/m, the law of motion gives, order by order, what is added
//!
//! ```text
//! at j:         δ2 ξ² + δ3 ξ³ + δ4 ξ⁴,   δ2 = g_0/2,   δ3 = g_1/6 - γh δ2/3,   δ4 = g_2/12 - γh δ3/4 - h² S_jj/m δ2/12
//! at j-1, j+1:  h² K_int/m δ2/12 ξ⁴
//! ```
//!
//! and terms of higher order, which spread along the chain.

const TWELFTH: f64 = 1.0 / 12.0;

/// Terms in m at the block, [δ2, δ3, δ4], for changes of force g_0 to g_2 in m, with γh and h² S_jj/m.
#[inline(always)]
pub(super) fn own_terms([g0, g1, g2]: [f64; 3], damping: f64, diagonal: f64) -> [f64; 3] {
    let second = 0.5 * g0;
    let third = 2.0 * TWELFTH * (g1 - 2.0 * damping * second);
    let fourth = TWELFTH * (g2 - diagonal * second) - 0.25 * damping * third;
    [second, third, fourth]
}

/// The term δ4 in m at the blocks beside, with h² K_int/m.
#[inline(always)]
pub(super) fn term_beside(second: f64, coupling: f64) -> f64 {
    TWELFTH * coupling * second
}
