//! What a scene with a neo-Hookean body may not have.

use super::invalid::{Invalid, Result};
use super::raw::{self, At, Table};
use super::text::SceneText;
use super::{Integrator, Tool};

/// The word for the law.
pub(super) const WORD: &str = "neo_hookean";

/// Where the file says `law = "neo_hookean"`, if it does.
pub(super) fn asked_for(skin: &Option<Table<raw::Skin>>, blocks: &[Table<raw::Skin>]) -> Option<At<String>> {
    let words = skin.iter().chain(blocks).filter_map(|table| table.keys.law.clone());
    words.into_iter().find(|word| word.get_ref() == WORD)
}

/// Refuses what the law does not go with.
pub(super) fn fits(
    scene: &SceneText,
    word: &Option<At<String>>,
    tools: &[Tool],
    integrator: Integrator,
    solver: &raw::Solver,
) -> Result<()> {
    let Some(word) = word else {
        return Ok(());
    };
    let unfit = |why: &'static str, fix: &'static str| Invalid::LawUnfit { at: scene.place(word.span()), why, fix };
    if tools.iter().any(|tool| tool.blade.is_some()) {
        return Err(unfit("is not cut, and a tool has a blade", "take \"fem\", or leave the tool's blade out"));
    }
    if integrator == Integrator::SymplecticEuler {
        let fix = "take \"fem\", or integrator = \"implicit_euler\" or \"newmark\"";
        return Err(unfit("takes implicit steps, and the integrator is \"symplectic_euler\"", fix));
    }
    if solver.refinements.as_ref().is_some_and(|rounds| *rounds.get_ref() > 0) {
        let fix = "leave refinements out: Newton's method stops at the true residual already";
        return Err(unfit("is solved by Newton's method, which linear refinements would undo", fix));
    }
    Ok(())
}
