//! Warnings of a run, by name. A run counts trouble that it goes on with; errors end it.

use std::collections::BTreeMap;

/// Counts of warnings, by name.
pub type Warnings = BTreeMap<&'static str, u32>;

/// A warning, as listed in [`WARNINGS`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Warning {
    /// Name in `warnings` of the report.
    pub name: &'static str,
    /// What has happened as often as it counts.
    pub meaning: &'static str,
    /// What helps, or when nothing has to.
    pub remedy: &'static str,
}

/// Declares the list and its table in the documentation.
macro_rules! warnings {
    ($($name:ident: $meaning:literal; $remedy:literal.)+) => {
        /// All warnings, in alphabetical order. Those of energies, strains and residuals are counted in checked steps (`true_residual_every`
        /// of `[solver]`, and the last).
        ///
        #[doc = concat!("| name | what it counts | what helps |\n| --- | --- | --- |\n" $(, "| `", stringify!($name), "` | ", $meaning, " | ", $remedy, " |\n")+)]
        pub const WARNINGS: &[Warning] =
            &[$(Warning { name: stringify!($name), meaning: $meaning, remedy: $remedy }),+];
    };
}

warnings! {
    columns_not_converged: "batches of compliance columns that were not solved to `column_tolerance`";
        "raise `max_iterations`, or take `preconditioner = \"multigrid\"`".
    contact_not_converged: "steps whose contact laws were left unsolved by more than can be felt, within the row updates of a step";
        "take a shorter `step_ms`, or coarser samples of the tool".
    contact_passes_exhausted: "steps that ended after `max_passes` passes with an error of the contact forces that can be felt";
        "raise `max_passes`, or take a shorter `step_ms`".
    contact_rows_dropped: "directions of contacts along which neither side has any compliance, so that they bear no force";
        "move the contact away from held nodes".
    contacts_dropped: "contacts beyond `max_contacts`, of which the shallowest are left out";
        "raise `max_contacts`".
    contacts_unexplained: "samples of a tool that lie deeper in skin than their motion in the step can have brought them; they bear no force and cut nothing";
        "take a shorter `step_ms`; a blade that drags flaps along has some, in cells that have turned over".
    cut_reserve_exhausted: "links that a blade crossed and that stayed whole, since the nodes reserved for cuts are used up";
        "raise `cut_reserve_columns`".
    device_lost: "ticks of a haptic device that was lost for most of the run";
        "mend the connection; without the device the hand's trajectory leads".
    energy_grew: "rises of the energy by more than the work that was done and a thousandth of both";
        "take a shorter `step_ms`, or `integrator = \"implicit_euler\"`".
    force_jumped: "ticks in which the force on a hand changed by more than 0.5 N beyond what the hand's motion in the last steps explains by the coupling";
        "take a shorter `step_ms`, or a softer coupling".
    held_apart: "ties of held or prescribed nodes that are open: neither side gives way";
        "leave the tie or the boundary out".
    held_overlap: "contacts of held or prescribed nodes that overlap by more than `alarm_mm`: neither side gives way";
        "move the bodies apart, or hold less of them".
    inverted_cells: "cells whose mean deformation gradient has no positive determinant";
        "take finer cells or a shorter `step_ms`; flaps of single cells that a blade drags along may turn over".
    midpoint_moved: "steps of the midpoint rule that are too long for it and take their elastic forces nearer to their end, of first order";
        "take a shorter `step_ms`".
    newton_not_converged: "steps that were to be solved in full and were solved linearised instead";
        "take a shorter `step_ms`, or apply loads in parts".
    non_finite_energy: "energies that are not finite";
        "take a shorter `step_ms`".
    non_finite_nodes: "nodes whose displacement is not finite at the end of the run";
        "take a shorter `step_ms`".
    residual_true_above_tolerance: "steps whose residual in f64 is more than twice the tolerance";
        "take `--precision f64`, a larger `tolerance`, or `refinements`".
    solver_not_converged: "linear solves that ended after `max_iterations`";
        "raise `max_iterations`, or take `preconditioner = \"multigrid\"`".
    step_beyond_linearisation: "1 where the last step is linearised and leaves more of its law than it has load, so that the forces are not in balance";
        "take a shorter `step_ms`, `integrator = \"static\"`, or `newton = true`".
    step_retried: "steps that became non-finite and were taken once more with the contact forces of the step before";
        "take a shorter `step_ms`".
    strain_beyond_law: "cells of a law of small strains that are strained by more than 6 %, where it is 5 % off the neo-Hookean law";
        "take `law = \"neo_hookean\"`".
    tangent_indefinite: "tangents of Newton's method that had to be raised to be positive definite";
        "nothing has to: the solution is the same; a shorter `step_ms` needs fewer".
}

/// The warning of a name.
pub fn warning(name: &str) -> Option<&'static Warning> {
    WARNINGS.iter().find(|warning| warning.name == name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_is_listed_once_in_order() {
        assert!(WARNINGS.windows(2).all(|pair| pair[0].name < pair[1].name));
        assert_eq!(
            warning("inverted_cells").map(|w| w.meaning),
            Some("cells whose mean deformation gradient has no positive determinant")
        );
        assert_eq!(warning("inverted"), None);
    }
}
