//! Checks of deformable bodies made in code.

use super::Part;
use crate::scene::invalid::Result;
use crate::scene::{Element, Law, Mass, Skin, Start};

/// Checks a deformable body made in code.
pub(super) fn check(part: &Part, skin: &Skin) -> Result<()> {
    part.finite("position, velocity, displacement", &[skin.position, skin.velocity, skin.displacement].concat())?;
    part.positive("size", &skin.size)?;
    part.of("layers").that(!skin.layers.is_empty(), "none", "at least one layer")?;
    part.not_negative("rayleigh_mass, rayleigh_stiffness", &[skin.rayleigh_mass, skin.rayleigh_stiffness])?;
    // grid, mesh or embedded surface
    let odd = skin.mesh.as_ref().map_or_else(|| skin.odd_grid(), |mesh| mesh.misfit(skin));
    odd.map_or(Ok(()), |(name, found, wanted)| Err(part.of(name).refuse(found, wanted)))?;
    let odd = skin.embedded.as_ref().and_then(|surface| surface.misfit(skin));
    odd.map_or(Ok(()), |(name, found, wanted)| Err(part.of(name).refuse(found, wanted)))?;
    // layers
    for (k, layer) in skin.layers.iter().enumerate() {
        let part = part.of(format!("layers[{k}]"));
        part.positive("density", &[layer.density])?;
        part.not_negative("toughness", &[layer.toughness])?;
        let breaks = part.of("break_strain");
        breaks.that(layer.break_strain > 0.0, layer.break_strain, "above 0, infinite where nothing breaks")?;
        let of_springs = layer.break_strain == f64::INFINITY || matches!(skin.law, Law::Springs { .. });
        breaks.that(of_springs, layer.break_strain, "infinite of other laws than springs")?;
        let odd = layer.pre_strain.iter().find(|e| !(**e > -0.5 && **e < 1.0));
        odd.map_or(Ok(()), |e| Err(part.of("pre_strain").refuse(e, "strains between -0.5 and 1")))?;
        let strained = layer.pre_strain != [0.0; 2] && matches!(skin.law, Law::Springs { .. });
        part.of("pre_strain").that(!strained, "not 0", "0 of springs")?;
        if !matches!(skin.law, Law::Springs { stiffness: Some(_), .. }) {
            part.positive("young", &[layer.young])?;
        }
        if !matches!(skin.law, Law::Springs { .. }) {
            part.of("poisson").that((0.0..0.5).contains(&layer.poisson), layer.poisson, "from 0 to below 0.5")?;
        }
        layer.odd_constant().map_or(Ok(()), |(name, found, wanted)| Err(part.of(name).refuse(found, wanted)))?;
    }
    // law, start and mass
    if let Law::Springs { stiffness, damping } = skin.law {
        part.of("law").that(
            stiffness.is_some() || skin.mesh.is_some(),
            "springs to fit",
            "a stiffness without a mesh",
        )?;
        part.of("law").positive("stiffness", stiffness.as_slice())?;
        part.of("law").not_negative("damping", &[damping])?;
    }
    match skin.start {
        Start::Random { amplitude, .. } => part.of("start").not_negative("amplitude", &[amplitude])?,
        Start::Twist(angle) => part.of("start").finite("angle", &[angle])?,
        Start::Rest | Start::Flat | Start::Inverted => {}
    }
    if let Law::LargeTetra { element, .. } = skin.law {
        let of_tetrahedra = matches!(element, Element::Tetra | Element::PlainTetra);
        part.of("law.element").that(of_tetrahedra, "of hexahedra", "Tetra or PlainTetra")?;
    }
    let linear = matches!(skin.law, Law::Fem { .. });
    part.of("mass").that(linear || skin.mass != Mass::Consistent, "consistent", "lumped or uniform with this law")
}
