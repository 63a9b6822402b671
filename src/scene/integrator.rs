//! Integrator of a scene, and its compatibility with the bodies.

use super::hyperelastic::large_strain;
use super::invalid::{Invalid, Result};
use super::raw::{self, At};
use super::text::SceneText;
use super::{Integrator, Law, Load, Mass, Skin, Tool};

/// Integrator of a scene; `touching` is true if bodies can touch or are attached.
pub(super) fn integrator(
    scene: &SceneText,
    word: Option<At<String>>,
    solver: &raw::Solver,
    skins: &[Skin],
    tools: &[Tool],
    loads: &[Load],
    touching: bool,
) -> Result<Integrator> {
    let word = raw::Time::integrator.or(word);
    let integrator = scene.choice(&raw::Time::integrator, &word)?;
    let unfit = |why: &'static str, fix: &'static str| Invalid::IntegratorUnfit {
        at: scene.location(word.span()),
        found: word.get_ref().clone(),
        why,
        fix,
    };
    // those that go with contact
    if integrator == Integrator::ImplicitEuler {
        return Ok(integrator);
    }
    if integrator == Integrator::Static {
        return unfit_for_static(skins, tools).map_or(Ok(integrator), |(why, fix)| Err(unfit(why, fix)));
    }
    // those of one body that is free of it
    if touching {
        let why = "is for one body that touches nothing, and this scene has tools, walls, ties or several bodies";
        return Err(unfit(why, "take \"implicit_euler\", or leave them out"));
    }
    if !fits_loads(integrator, skins, loads) {
        return Err(unfit(FOLLOWED, "take \"implicit_euler\" with newton = true, or follower = false"));
    }
    if matches!(integrator, Integrator::Newmark | Integrator::Midpoint) {
        return Ok(integrator);
    }
    // the explicit one
    if skins.iter().any(|s| s.mass == Mass::Consistent) {
        return Err(unfit(
            "divides by the masses of nodes, and this mass is consistent",
            "use a lumped or uniform mass",
        ));
    }
    if skins.iter().any(|s| matches!(s.law, Law::Springs { .. })) {
        return Err(unfit("is for hexahedra, and this skin is of springs", "take \"implicit_euler\""));
    }
    let why = "integrator = \"symplectic_euler\" solves no system";
    scene.needless("preconditioner", &solver.preconditioner, why)?;
    scene.needless("tolerance", &solver.tolerance, why)?;
    scene.needless("floor_n", &solver.floor_n, why)?;
    scene.needless("max_iterations", &solver.max_iterations, why)?;
    scene.needless("refinements", &solver.refinements, why)?;
    Ok(integrator)
}

/// Why static steps do not go with these bodies, and the remedy.
pub(super) fn unfit_for_static(skins: &[Skin], tools: &[Tool]) -> Option<(&'static str, &'static str)> {
    let moves = |tool: &Tool| tool.free.is_some() || tool.blade.is_some() || tool.carve.is_some();
    if skins.is_empty() || tools.iter().any(moves) {
        let why = "finds the balance of deformable bodies and what presses them, and a [[rigid]] body moves freely, a blade cuts, or a tool carves, in time";
        return Some((why, "take \"implicit_euler\", or leave them out"));
    }
    if skins.iter().any(Skin::breaks) {
        return Some(("finds one balance, and springs break in time", "leave break_strain out"));
    }
    let moving = skins.iter().any(|skin| skin.velocity != [0.0; 3]);
    moving.then_some(("has no velocities", "leave velocity_m_s out"))
}

/// Why the midpoint rule does not go with follower pressures on hyperelastic bodies.
pub(super) const FOLLOWED: &str =
    "minimises a potential of each step of a hyperelastic body, and a pressure that follows the surface has none there";

/// Whether an integrator goes with the loads.
pub(super) fn fits_loads(integrator: Integrator, skins: &[Skin], loads: &[Load]) -> bool {
    let large = |load: &Load| large_strain(&skins[load.body]);
    integrator != Integrator::Midpoint || !loads.iter().any(|load| load.follows() && large(load))
}

/// Rejects an integrator that gains energy with a law.
pub(super) fn stable(scene: &SceneText, word: &At<String>, integrator: Integrator, law: Law) -> Result<()> {
    if integrator.fits(law) {
        return Ok(());
    }
    let (why, fix) = match law {
        Law::Hyperelastic(_) => (
            "gains energy without bound with a hyperelastic law",
            "take \"midpoint\", which keeps it, or \"implicit_euler\"",
        ),
        _ => (
            "has one linear solve a step with this law, and gains energy without bound",
            "take \"implicit_euler\", or a hyperelastic law with \"midpoint\"",
        ),
    };
    Err(Invalid::IntegratorUnfit { at: scene.location(word.span()), found: word.get_ref().clone(), why, fix })
}
