//! Hyperelastic laws of a scene file: names, constants of the layers, and what they exclude.

use super::invalid::{Invalid, Result};
use super::raw::{self, At, Number, Row};
use super::text::SceneText;
use super::words::word;
use super::{Correction, Element, Integrator, Law, Layer, Skin};
use std::ops::Range;

/// Large-strain law of a body of hexahedra, or, without fibres, of tetrahedra ([`crate::kernels::hyperelastic`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Material {
    /// Compressible neo-Hookean.
    NeoHookean,
    /// Compressible Mooney–Rivlin.
    MooneyRivlin,
    /// Compressible neo-Hookean with collagen fibres, of Holzapfel, Gasser and Ogden.
    Holzapfel,
}

/// Two families of fibres in a layer's plane ([`crate::kernels::holzapfel`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fibres {
    /// k₁, Pa; 0: none.
    pub stiffness: f64,
    /// k₂
    pub growth: f64,
    /// κ: 0 all fibres of a family along its direction, ⅓ every way.
    pub dispersion: f64,
    /// Angles of the families from the x axis towards y, rad.
    pub families: [f64; 2],
}

impl Default for Fibres {
    /// None.
    fn default() -> Self {
        Self { stiffness: 0.0, growth: 1.0, dispersion: 0.0, families: [0.0; 2] }
    }
}

impl Layer {
    /// First constant of a hyperelastic law that is out of its range: field, value, range.
    pub(super) fn odd_constant(&self) -> Option<(&'static str, f64, &'static str)> {
        let Fibres { stiffness, growth, dispersion, families: [first, second] } = self.fibres;
        let share = self.second_share;
        let constants = [
            ("second_share", share, (0.0..=1.0).contains(&share), "a share from 0 to 1"),
            ("fibres.stiffness", stiffness, stiffness.is_finite() && stiffness >= 0.0, "a finite number of at least 0"),
            ("fibres.growth", growth, growth.is_finite() && growth > 0.0, "a finite number above 0"),
            ("fibres.dispersion", dispersion, (0.0..=1.0 / 3.0).contains(&dispersion), "from 0 to 1/3"),
            ("fibres.families", first, first.is_finite(), "finite angles"),
            ("fibres.families", second, second.is_finite(), "finite angles"),
        ];
        constants.into_iter().find(|(_, _, sound, _)| !sound).map(|(name, found, _, wanted)| (name, found, wanted))
    }
}

/// Names of the laws.
pub const MATERIALS: [(&str, Material); 3] = [
    ("neo_hookean", Material::NeoHookean),
    ("mooney_rivlin", Material::MooneyRivlin),
    ("holzapfel", Material::Holzapfel),
];

/// Elastic constants of a layer at small strain.
pub(super) struct Constants {
    /// Young's modulus, Pa; 0 if there is none.
    pub young: f64,
    /// Poisson's ratio.
    pub poisson: f64,
    /// See [`super::Layer::second_share`].
    pub second_share: f64,
}

/// Young's modulus and Poisson's ratio of a layer.
fn linear(scene: &SceneText, raw: &raw::Layer, table: Range<usize>, law: &Law) -> Result<Constants> {
    let why = "it belongs to law = \"mooney_rivlin\"";
    for (key, value) in [("c10_kpa", &raw.c10_kpa), ("c01_kpa", &raw.c01_kpa), ("bulk_kpa", &raw.bulk_kpa)] {
        scene.needless(key, value, why)?;
    }
    if let Law::Springs { stiffness, .. } = law {
        scene.needless("poisson", &raw.poisson, "springs have no Poisson's ratio of their own")?;
        if stiffness.is_some() {
            scene.needless("young_kpa", &raw.young_kpa, "springs with spring_stiffness_n_m are not fitted to it")?;
        }
    }
    let why = match law {
        Law::Springs { .. } => "springs without spring_stiffness_n_m are fitted to it",
        _ => "this law asks for it in each layer",
    };
    let young = match &raw.young_kpa {
        None if matches!(law, Law::Springs { stiffness: Some(_), .. }) => 0.0,
        value => {
            let value = scene.required("young_kpa", value.clone(), table.clone(), why)?;
            scene.number(&raw::Layer::young_kpa, &value)?
        }
    };
    let poisson = match &raw.poisson {
        None if matches!(law, Law::Springs { .. }) => 0.0,
        value => {
            let value = scene.required("poisson", value.clone(), table, why)?;
            let ratio = *value.get_ref();
            if !raw::Layer::poisson.range.holds(ratio) {
                return Err(Invalid::Poisson { at: scene.location(value.span()), found: ratio });
            }
            ratio
        }
    };
    Ok(Constants { young, poisson, second_share: 0.0 })
}

/// Constants of a layer.
pub(super) fn constants(scene: &SceneText, raw: &raw::Layer, law: &Law, table: Range<usize>) -> Result<Constants> {
    match law {
        Law::Hyperelastic(Material::MooneyRivlin) | Law::LargeTetra { material: Material::MooneyRivlin, .. } => {
            let why = "law = \"mooney_rivlin\" has c10_kpa, c01_kpa and bulk_kpa in its place";
            scene.needless("young_kpa", &raw.young_kpa, why)?;
            scene.needless("poisson", &raw.poisson, why)?;
            let number = |row: Row<Number>, value: &Option<At<f64>>| {
                let why = "law = \"mooney_rivlin\" asks for it";
                let value = scene.required(row.name, value.clone(), table.clone(), why)?;
                Ok((scene.number(&row, &value)?, value.span()))
            };
            let (c10, _) = number(raw::Layer::c10_kpa, &raw.c10_kpa)?;
            let (c01, _) = number(raw::Layer::c01_kpa, &raw.c01_kpa)?;
            let (bulk, at) = number(raw::Layer::bulk_kpa, &raw.bulk_kpa)?;
            // constants at small strain
            let shear = 2.0 * (c10 + c01);
            let poisson = (3.0 * bulk - 2.0 * shear) / (2.0 * (3.0 * bulk + shear));
            if !raw::Layer::poisson.range.holds(poisson) {
                return Err(Invalid::LawUnfit {
                    at: scene.location(at),
                    law: word(&MATERIALS, Material::MooneyRivlin),
                    why: "has a bulk modulus that makes its ratio of Poisson less than 0 or more than 0.4999",
                    fix: "take bulk_kpa between 1.4 and 9999 times c10_kpa + c01_kpa",
                });
            }
            let young = 9.0 * bulk * shear / (3.0 * bulk + shear);
            Ok(Constants { young, poisson, second_share: c01 / (c10 + c01) })
        }
        _ => linear(scene, raw, table, law),
    }
}

/// Fibres of a layer: two families at `fibre_angle_deg` to both sides of Langer's lines.
pub(super) fn fibres(scene: &SceneText, raw: &raw::Layer, law: &Law) -> Result<Fibres> {
    let numbers = [
        ("fibre_kpa", &raw.fibre_kpa),
        ("fibre_growth", &raw.fibre_growth),
        ("fibre_dispersion", &raw.fibre_dispersion),
        ("fibre_angle_deg", &raw.fibre_angle_deg),
        ("langer_deg", &raw.langer_deg),
    ];
    if *law != Law::Hyperelastic(Material::Holzapfel) {
        let needless = numbers
            .into_iter()
            .try_for_each(|(key, value)| scene.needless(key, value, "it belongs to law = \"holzapfel\""));
        return needless.map(|()| Fibres::default());
    }
    if raw.fibre_kpa.is_none() {
        let why = "it is of a layer's fibres, and this layer has none; add fibre_kpa";
        numbers.into_iter().try_for_each(|(key, value)| scene.needless(key, value, why))?;
    }
    let dispersion = raw::Layer::fibre_dispersion.or(raw.fibre_dispersion.clone());
    let found = *dispersion.get_ref();
    if !raw::Layer::fibre_dispersion.range.holds(found) {
        return Err(Invalid::Number {
            at: scene.location(dispersion.span()),
            key: "fibre_dispersion".into(),
            found,
            wanted: "a number from 0 (all fibres along their family's direction) to 1/3 (every way)",
            unit: raw::Layer::fibre_dispersion.range.unit.name,
            example: 0.1,
        });
    }
    let number = |row: Row<Number, f64>, value: &Option<At<f64>>| scene.number_or(&row, value.clone());
    let langer = number(raw::Layer::langer_deg, &raw.langer_deg)?.to_radians();
    let aside = number(raw::Layer::fibre_angle_deg, &raw.fibre_angle_deg)?.to_radians();
    Ok(Fibres {
        stiffness: number(raw::Layer::fibre_kpa, &raw.fibre_kpa)?,
        growth: number(raw::Layer::fibre_growth, &raw.fibre_growth)?,
        dispersion: found,
        families: [langer + aside, langer - aside],
    })
}

/// Laws of tetrahedra by name.
pub(super) fn laws_of_tetrahedra(element: Element) -> [(&'static str, Law); 4] {
    let (of, large) =
        (|corotational| Law::Fem { element, corotational }, |material| Law::LargeTetra { material, element });
    let [(neo_hookean, soft), (mooney_rivlin, rubber), _] = MATERIALS;
    [("corotational", of(true)), ("linear", of(false)), (neo_hookean, large(soft)), (mooney_rivlin, large(rubber))]
}

/// All laws by name; those of small strain with the given element.
pub(super) fn laws(element: Element) -> Vec<(&'static str, Law)> {
    let springs = Law::Springs { stiffness: None, damping: 0.0 };
    let of = |corotational| Law::Fem { element, corotational };
    let hyperelastic = MATERIALS.map(|(word, material)| (word, Law::Hyperelastic(material)));
    let others = [("corotational", of(true)), ("linear", of(false)), ("springs", springs)];
    hyperelastic.into_iter().chain(others).collect()
}

/// Why steps cannot be solved to their nonlinear balance, or why asking is needless; `touching` is the correction of a scene with contact,
/// `followed` says whether follower pressures act.
pub(super) fn unfit_for_newton(
    skins: &[Skin],
    touching: Option<Correction>,
    followed: bool,
    integrator: Integrator,
) -> Option<&'static str> {
    match (touching, integrator) {
        _ if !skins.iter().any(large_strain) => Some("only hyperelastic laws have a nonlinear balance to solve for"),
        (_, Integrator::SymplecticEuler) => Some("integrator = \"symplectic_euler\" solves no system"),
        (Some(_), Integrator::Static) => Some("static steps with contact are solved in full already"),
        (_, Integrator::Static) if followed => Some("static steps with follower pressures are solved in full already"),
        (Some(Correction::Uncoupled | Correction::Precomputed), _) => {
            Some("with contact it needs correction = \"exact\", since each solve goes on from the last one's forces")
        }
        _ => None,
    }
}

/// Whether a body has a hyperelastic law.
pub(super) fn large_strain(skin: &Skin) -> bool {
    matches!(skin.law, Law::Hyperelastic(_) | Law::LargeTetra { .. })
}

/// Rejects what Newton's method does not support; `touching` and `followed` as for [`unfit_for_newton`].
pub(super) fn fits(
    scene: &SceneText,
    skins: &[Skin],
    touching: Option<Correction>,
    followed: bool,
    integrator: Integrator,
    solver: &raw::Solver,
) -> Result<()> {
    let asked = solver.newton.as_ref().filter(|newton| *newton.get_ref());
    if let (Some(newton), Some(why)) = (asked, unfit_for_newton(skins, touching, followed, integrator)) {
        return Err(Invalid::NeedlessKey { at: scene.location(newton.span()), key: "newton", why });
    }
    let hyperelastic = skins.iter().any(|skin| matches!(skin.law, Law::Hyperelastic(_)));
    let in_full = asked.is_some() && integrator == Integrator::ImplicitEuler;
    if in_full || hyperelastic && !followed && integrator.newton(false, touching.is_some()) {
        let why = "Newton's method stops at the true residual already, and linear refinements would undo its steps";
        return match &solver.refinements {
            Some(rounds) if *rounds.get_ref() > 0 => scene.needless("refinements", &solver.refinements, why),
            _ => Ok(()),
        };
    }
    Ok(())
}
