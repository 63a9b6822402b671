//! Hyperelastic hexahedron: laws, energy and internal forces; text shared by the shaders.
//!
//! `W = W'(F) + κ/2 (ln J̄)²` per rest volume. `W'` is that of the law at 2×2×2 Gauss points ([`super::deformation`]). The volumetric term
//! uses the mean dilatation `J̄ = v/V` of the cell (Q1/P0: one pressure per cell), so that nearly incompressible layers do not lock.
//! `v = ∫ det F dV` is exact with these points. With `g_a = F⁻ᵀ G_a`, `c_a = ∂v/∂u_a = Σ w J g_a`, `p = κ ln J̄/J̄`:
//!
//! `f_a = Σ w P' G_a + p c_a`.
//!
//! A pre-strain `e` is the elastic strain of the shape at rest: the stress-free cell has the edges `h/(1 + e)`. With gradients over that
//! cell, `F = I + e + Σ_a u_a ⊗ ∇N_a`.
//!
//! Below a tenth of the volume at rest `ln J` is extended by its tangent ([`super::deformation::log_volume`]), so a cell that is flat or
//! inverted has finite forces that open it again.
//!
//! A law consists of a file with `W'`, `P' = ∂W'/∂F` and `dP'`, in Rust and in WGSL, and an arm of [`Law`]. For neo-Hookean material and the
//! matrix between fibres `κ` is Lamé's λ.
//! Source: Simo, Taylor, Pister 1985 (mean dilatation at finite strain). Differs: the mean enters the κ-term only, not a modified F, which
//! keeps the law's own form of `W'`.
//! Units: u m, edges m, κ Pa, W J, f N.

use super::deformation::{
    EXTENDED, Point, corner_sums, field_gradients, log_volume, log_volume_slope, log_volume_stiffness,
};
use super::holzapfel::{self, Fibres};
use super::linearised::{HYPERELASTIC, Rows};
use super::{Params, corner, mooney_rivlin, neo_hookean};
use crate::math::{M3, Real, V3, V4, rotation_matrix};

/// Text shared by the shaders of hyperelastic cells.
pub const WGSL: [&str; 5] = [
    super::deformation::WGSL,
    neo_hookean::WGSL,
    mooney_rivlin::WGSL,
    holzapfel::WGSL,
    include_str!("hyperelastic.wgsl"),
];

/// Law with its constants, Pa.
#[derive(Clone, Copy, Debug)]
pub enum Law<R> {
    /// μ
    NeoHookean(R),
    /// c₁₀, c₀₁
    MooneyRivlin([R; 2]),
    /// μ and the fibres
    Holzapfel(R, Fibres<R>),
}

/// Numbers of a layer's fibres on the device: both directions; k₂, κ and two zeros.
pub type FibreRows<R> = [V4<R>; 2];

/// Cell size and material of a layer.
#[derive(Clone, Copy, Debug)]
pub struct Material<R> {
    /// Edges of a cell, m.
    pub edges: V3<R>,
    /// Elastic strain of the rest shape along x, y, z.
    pub pre_strain: V3<R>,
    /// κ, Pa
    pub bulk: R,
    /// Law, without the volumetric term.
    pub law: Law<R>,
}

impl<R: Real> Material<R> {
    /// From a layer's `shape`, `material` (κ, the law's constants, and its code), `fibres` and `pre_strain`.
    pub fn of(shape: V4<R>, [bulk, first, second, code]: V4<R>, fibres: FibreRows<R>, pre_strain: V4<R>) -> Self {
        let [[x1, y1, x2, y2], [growth, dispersion, _, _]] = fibres;
        let law = if code == R::of(2.0) {
            let directions = [[x1, y1], [x2, y2]];
            Law::Holzapfel(first, Fibres { directions, stiffness: second, growth, dispersion })
        } else if code == R::one() {
            Law::MooneyRivlin([first, second])
        } else {
            Law::NeoHookean(first)
        };
        Self { edges: V3::from4(shape), pre_strain: V3::from4(pre_strain), bulk, law }
    }

    /// Shear modulus at small strain, Pa.
    fn shear(&self) -> R {
        match self.law {
            Law::NeoHookean(mu) | Law::Holzapfel(mu, _) => mu,
            Law::MooneyRivlin([c10, c01]) => R::of(2.0) * (c10 + c01),
        }
    }

    /// W' of a Gauss point, J/m³.
    fn energy(&self, p: &Point<R>) -> R {
        match self.law {
            Law::NeoHookean(mu) => neo_hookean::energy(mu, p),
            Law::MooneyRivlin(c) => mooney_rivlin::energy(c, p),
            Law::Holzapfel(mu, fibres) => holzapfel::energy(mu, &fibres, p),
        }
    }

    /// P' of a Gauss point, Pa.
    pub fn stress(&self, p: &Point<R>) -> M3<R> {
        match self.law {
            Law::NeoHookean(mu) => neo_hookean::stress(mu, p),
            Law::MooneyRivlin(c) => mooney_rivlin::stress(c, p),
            Law::Holzapfel(mu, fibres) => holzapfel::stress(mu, &fibres, p),
        }
    }

    /// dP' for a change of F, Pa.
    pub fn tangent(&self, p: &Point<R>, change: M3<R>) -> M3<R> {
        match self.law {
            Law::NeoHookean(mu) => neo_hookean::tangent(mu, p, change),
            Law::MooneyRivlin(c) => mooney_rivlin::tangent(c, p, change),
            Law::Holzapfel(mu, fibres) => holzapfel::tangent(mu, &fibres, p, change),
        }
    }
}

/// State of a cell for given corner displacements.
pub struct Cell<R> {
    /// Gauss points, numbered by the nearest corner.
    pub points: [Point<R>; 8],
    /// Stress-free volume of a Gauss point, m³.
    pub weight: R,
    /// `J̄ − 1`.
    pub mean_dilatation: R,
    /// Cell size and material.
    pub material: Material<R>,
    /// 1/edges of the stress-free shape, 1/m.
    pub inverse: V3<R>,
    /// The volume is not positive at some Gauss point: energy and forces are those of the extended law.
    pub inverted: bool,
}

impl<R: Real> Cell<R> {
    /// Of a body with `material` by layer, `displacement` the displacements of its nodes, m.
    pub fn of(
        params: &Params<R>,
        shape: &[V4<R>],         // [layer] cell edges m, mass of one corner kg
        material: &[V4<R>],      // [layer] κ, two constants Pa, the law's code
        fibres: &[FibreRows<R>], // [layer] directions; k₂, κ
        pre_strain: &[V4<R>],    // [layer] elastic strain at rest along x, y, z
        layer_of: &[u32],        // [cells_z] layer
        displacement: &[V4<R>],  // [node] displacement, m
        split: &[u32],           // see `split`
        cell: usize,
    ) -> Self {
        let layer = layer_of[params.cell_at(cell)[2]] as usize;
        let u = params.corner_nodes(split, cell).map(|n| V3::from4(displacement[n]));
        Self::new(Material::of(shape[layer], material[layer], fibres[layer], pre_strain[layer]), &u)
    }

    /// From the corners' displacements, m.
    pub fn new(material: Material<R>, u: &[V3<R>; 8]) -> Self {
        let (edges, e) = (material.edges, material.pre_strain);
        let stretch = e + V3::splat(R::one());
        let inverse = V3::new(stretch.x / edges.x, stretch.y / edges.y, stretch.z / edges.z);
        let points = field_gradients(inverse, u).map(|gradient| Point::new(M3::diagonal(e) + gradient));
        let sum = points.iter().map(|p| p.dilatation).sum::<R>();
        let inverted = points.iter().any(Point::inverted);
        let eighth = R::of(0.125);
        let weight = eighth / (inverse.x * inverse.y * inverse.z);
        Self { points, weight, mean_dilatation: sum * eighth, material, inverse, inverted }
    }

    /// Energy, J
    pub fn energy(&self) -> R {
        let sum = self.points.iter().map(|p| self.material.energy(p)).sum::<R>();
        let log = log_volume(self.mean_dilatation)[0];
        self.weight * (sum + R::of(4.0) * self.material.bulk * log * log)
    }

    /// `κ φ(J̄) φ'(J̄)`, which is `κ ln J̄/J̄` for a volume above a tenth, Pa.
    pub fn pressure(&self) -> R {
        self.material.bulk * log_volume(self.mean_dilatation)[0] * log_volume_slope(self.mean_dilatation)
    }

    /// `∂v/∂u_a`, m².
    pub fn volume_gradient(&self) -> [V3<R>; 8] {
        corner_sums(self.inverse, &self.points.map(|p| p.cofactor * self.weight))
    }

    /// Internal forces at the corners, N.
    pub fn forces(&self) -> [V3<R>; 8] {
        let pressure = self.pressure();
        let stress = |p: &Point<R>| (self.material.stress(p) + p.cofactor * pressure) * self.weight;
        corner_sums(self.inverse, &self.points.each_ref().map(stress))
    }
}

/// `params.corotational` of a hyperelastic body whose steps are one linear solve each ([`Cell::linearised`]); `product` reads the factor `s`
/// from the length `s^¼` of the cell's quaternion.
pub const STIFFENED: u32 = HYPERELASTIC;
/// That of one whose steps are solved by Newton's method; its small-strain stiffness, which is not stiffened, damps and preconditions.
pub const NEWTON: u32 = HYPERELASTIC + 1;

/// Largest factor.
const STIFFEST: f64 = 1e6;

/// Linearisation of a cell: `s R K' Rᵀ + c ⊗ c` and the stiffness of tension ([`super::linearised`]), with `K'` its stiffness at small strain
/// less that of its mean volume ([`mean_volume`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearised<R> {
    /// s
    pub stiffening: R,
    /// Stiffness of the volume and of tension, divided by `s`: `y` is `c` in the patterns 1, 2 and 4 of the cell's frame, divided by `√s`.
    pub rows: Rows<R>,
}

impl<R: Real> Cell<R> {
    /// Linearisation of a cell with rotation `q`. The stiffness of the volume has its present direction, `c = √(κ (φ'² + φ φ'')/V) ∂v/∂u`: a
    /// rotated one would resist incompressible motion of cells that are strained, by up to κ/μ of their stiffness, and steps would lag
    /// behind their loads.
    ///
    /// `s` is the factor by which the true tangent exceeds the small-strain stiffness, at least: with a tangent less than half of the true
    /// one a linear step overshoots, and steps diverge. With the largest of the Gauss points in each term,
    ///
    /// `s = max(1, |∂φ/∂F|² − 2)`, plus `(κ/μ)/3 (φ'² + φ φ'') mean |cof F − mean cof F|²`, plus `−p/(2 μ) max(1, |F|/√3)` under pressure,
    ///
    /// that is, `λ⁻²` for one principal stretch `λ`; the volume's stiffness against hourglass patterns, which `y` leaves out; the stiffness
    /// that pressure gives to shear; and what stretched fibres add ([`holzapfel::stiffening`]). Where `ln J` is extended the first term is at
    /// least `(1 + φ' |F|)/2`. A pre-strain scales the small-strain stiffness by up to `max (1 + e)²/Π (1 + e)`.
    ///
    /// Rayleigh damping acts with `R K' Rᵀ` and the same stiffness of the volume: with the factor `f = 1 + r_K/h` of the stiffness in `A` the
    /// result is `1 + (s − 1)/f`.
    ///
    /// Tension `τ` is `(T_i + T_j)/(λ_i + λ_j)` for principal Biot stresses `T` and stretches, which is the stiffness that an isotropic law has
    /// against `H_ij = −H_ji`; here `½ (⅔ tr T + √⅔ |dev T|)` of the mean stress, at least half the sum of any two, without damping.
    pub fn linearised(&self, params: &Params<R>, q: V4<R>, forces: &[V3<R>; 8]) -> Linearised<R> {
        let (mut stiffening, mut tension) = (R::one(), R::zero());
        if params.corotational == STIFFENED {
            stiffening = self.stiffening(params.stiffness_factor);
            tension = self.tension(rotation_matrix(q), forces) / params.stiffness_factor;
        }
        let tension = self.inverse * (R::of(0.25) * (R::of(8.0) * self.weight * tension / stiffening).sqrt());
        let bulk = self.material.bulk * self.volume_stiffness();
        let scale = R::of(0.125) * (bulk / (R::of(8.0) * self.weight * stiffening)).sqrt();
        // sign pattern of ∂v/∂u along an axis: the column of Σ w cof F times −2/h
        let slope =
            self.points.iter().fold(M3::zero(), |sum, p| sum + p.cofactor) * (R::of(-2.0) * self.weight * scale);
        let [x, y, z] = (rotation_matrix(q).transpose() * slope).0;
        let volume = [x * self.inverse.x, y * self.inverse.y, z * self.inverse.z];
        Linearised { stiffening, rows: Rows { volume, tension } }
    }

    /// `φ'² + φ φ''`, at least `(0.6 − ln J̄/5) φ'²`, above a tenth: in a volume that grows, `p ∂²v/∂u²` of the tension adds up to
    /// `(2/3 ln J̄) φ'²`, so the true tangent has `(1 − ln J̄/3) φ'²` in all where the first term has `(1 − ln J̄) φ'²`.
    fn volume_stiffness(&self) -> R {
        let [log, slope] = [log_volume(self.mean_dilatation)[0], log_volume_slope(self.mean_dilatation)];
        let least = (R::of(0.6) - R::of(0.2) * log).max(R::of(0.1)).min(R::of(0.6));
        log_volume_stiffness(self.mean_dilatation).max(least * slope * slope)
    }

    /// `τ` of [`Cell::linearised`], Pa.
    fn tension(&self, rotation: M3<R>, forces: &[V3<R>; 8]) -> R {
        // mean of P, by columns
        let mut stress = [V3::zero(); 3];
        for (a, force) in forces.iter().enumerate() {
            for (n, column) in stress.iter_mut().enumerate() {
                *column = if corner(a)[n] == 0 { *column - *force } else { *column + *force };
            }
        }
        let (share, inverse) = (R::of(0.0625) / self.weight, self.inverse);
        let stress =
            M3([stress[0] * (share / inverse.x), stress[1] * (share / inverse.y), stress[2] * (share / inverse.z)]);
        let trace = stress.dot(rotation);
        let deviator = (stress.dot(stress) - trace * trace / R::of(3.0)).max(R::zero());
        (trace / R::of(3.0) + (deviator / R::of(6.0)).sqrt()).max(R::zero())
    }

    /// `1 + (s − 1)/f` of [`Cell::linearised`].
    fn stiffening(&self, factor: R) -> R {
        let (zero, one, two) = (R::zero(), R::one(), R::of(2.0));
        let shear = self.material.shear();
        let squared = |m: M3<R>| m.dot(m);
        let (mut pressed, mut longest, mut fibrous) = (one, R::of(3.0), zero);
        let (mut beyond, mut squares) = (M3::zero(), zero); // of the cofactors, from the first one
        for p in &self.points {
            let stretched = squared(M3::identity() + p.h);
            pressed = pressed.max(squared(p.log_gradient) - two);
            if one + p.dilatation < R::of(EXTENDED) {
                pressed = pressed.max((one + log_volume_slope(p.dilatation) * stretched.sqrt()) / two);
            }
            let more = p.cofactor - self.points[0].cofactor;
            beyond = beyond + more;
            squares += squared(more);
            longest = longest.max(stretched);
            if let Law::Holzapfel(mu, fibres) = &self.material.law {
                fibrous = fibrous.max(holzapfel::stiffening(*mu, fibres, p));
            }
        }
        let uneven = (squares - R::of(0.125) * squared(beyond)).max(zero);
        let volume = self.material.bulk / (R::of(24.0) * shear) * self.volume_stiffness() * uneven;
        let sheared = (-self.pressure() / (two * shear)).max(zero) * (longest / R::of(3.0)).sqrt();
        let stretch = self.material.pre_strain + V3::splat(one);
        let strained = stretch.times(stretch) * (one / (stretch.x * stretch.y * stretch.z));
        let strained = one.max(strained.x).max(strained.y).max(strained.z);
        let s = ((pressed + volume + sheared + fibrous) * strained).min(R::of(STIFFEST));
        one + (s - one) / factor
    }
}

/// Stiffness of the mean volume of a box at rest by corner and axis, `κ V b ⊗ b` with the mean gradients `b`, N/m.
pub fn mean_volume(edges: [f64; 3], bulk: f64) -> [[f64; 24]; 24] {
    let volume: f64 = edges.iter().product();
    let slope = |m: usize| (if corner(m / 3)[m % 3] == 1 { 0.25 } else { -0.25 }) / edges[m % 3];
    std::array::from_fn(|m| std::array::from_fn(|n| bulk * volume * slope(m) * slope(n)))
}

/// Displacements of a cell's corners.
pub fn at_corners<R: Real>(params: &Params<R>, u: &[V4<R>], cell: usize) -> [V3<R>; 8] {
    params.corners(cell).map(|n| V3::from4(u[n]))
}
