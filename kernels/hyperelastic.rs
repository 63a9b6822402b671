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
    EXTENDED, Point, corner_sums, field_gradients, log_volume, log_volume_slope, volume_stiffness,
};
use super::holzapfel::{self, Fibres};
use super::linearised::{HYPERELASTIC, Rows};
use super::{Params, corner, mooney_rivlin, neo_hookean};
use crate::math::wide::{Lanes, Packed};
use crate::math::{M3, Number, Real, V3, V4, rotation_matrix};

/// Text shared by the shaders of hyperelastic laws.
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
pub struct Material<N> {
    /// Edges of a cell, m.
    pub edges: V3<N>,
    /// Elastic strain of the rest shape along x, y, z.
    pub pre_strain: V3<N>,
    /// κ, Pa
    pub bulk: N,
    /// Law, without the volumetric term.
    pub law: Law<N>,
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

    /// A material of the same kind, `scale` times as stiff.
    pub fn scaled(self, scale: R) -> Self {
        let law = match self.law {
            Law::NeoHookean(mu) => Law::NeoHookean(mu * scale),
            Law::MooneyRivlin(c) => Law::MooneyRivlin(c.map(|c| c * scale)),
            Law::Holzapfel(mu, fibres) => {
                Law::Holzapfel(mu * scale, Fibres { stiffness: fibres.stiffness * scale, ..fibres })
            }
        };
        Self { bulk: self.bulk * scale, law, ..self }
    }

    /// The same in every lane of a register.
    #[inline(always)]
    pub fn packed<L: Lanes<R>>(&self, lanes: L) -> Material<Packed<R, L>> {
        let one = |value: R| Packed::splat(lanes, value);
        let three = |v: V3<R>| v.packed(lanes);
        let law = match self.law {
            Law::NeoHookean(mu) => Law::NeoHookean(one(mu)),
            Law::MooneyRivlin([c10, c01]) => Law::MooneyRivlin([one(c10), one(c01)]),
            Law::Holzapfel(mu, Fibres { directions: [[x1, y1], [x2, y2]], stiffness, growth, dispersion }) => {
                let directions = [[one(x1), one(y1)], [one(x2), one(y2)]];
                let [stiffness, growth, dispersion] = [one(stiffness), one(growth), one(dispersion)];
                Law::Holzapfel(one(mu), Fibres { directions, stiffness, growth, dispersion })
            }
        };
        let (edges, pre_strain) = (three(self.edges), three(self.pre_strain));
        Material { edges, pre_strain, bulk: one(self.bulk), law }
    }
}

impl<N: Number> Material<N> {
    /// Factor of the shear modulus on `tr ε 1` at small strain: that of isochoric laws.
    #[inline(always)]
    pub fn of_trace(&self) -> N {
        match self.law {
            Law::NeoHookean(mu) | Law::Holzapfel(mu, _) => mu.like(0.0),
            Law::MooneyRivlin([c10, _]) => c10.like(-2.0 / 3.0),
        }
    }

    /// Shear modulus at small strain, Pa.
    #[inline(always)]
    pub fn shear(&self) -> N {
        match self.law {
            Law::NeoHookean(mu) | Law::Holzapfel(mu, _) => mu,
            Law::MooneyRivlin([c10, c01]) => c10.like(2.0) * (c10 + c01),
        }
    }

    /// Stiffening at a point where that of a neo-Hookean material under pressure is `g`.
    #[inline(always)]
    pub fn stiffening(&self, p: &Point<N>, g: N) -> N {
        match self.law {
            Law::MooneyRivlin(c) => mooney_rivlin::stiffening(c, p, g),
            _ => g,
        }
    }

    /// W' of a Gauss point, J/m³.
    #[inline(always)]
    pub fn energy(&self, p: &Point<N>) -> N {
        match self.law {
            Law::NeoHookean(mu) => neo_hookean::energy(mu, p),
            Law::MooneyRivlin(c) => mooney_rivlin::energy(c, p),
            Law::Holzapfel(mu, fibres) => holzapfel::energy(mu, &fibres, p),
        }
    }

    /// P' of a Gauss point, Pa.
    #[inline(always)]
    pub fn stress(&self, p: &Point<N>) -> M3<N> {
        match self.law {
            Law::NeoHookean(mu) => neo_hookean::stress(mu, p),
            Law::MooneyRivlin(c) => mooney_rivlin::stress(c, p),
            Law::Holzapfel(mu, fibres) => holzapfel::stress(mu, &fibres, p),
        }
    }

    /// dP' for a change of F, Pa.
    #[inline(always)]
    pub fn tangent(&self, p: &Point<N>, change: M3<N>) -> M3<N> {
        match self.law {
            Law::NeoHookean(mu) => neo_hookean::tangent(mu, p, change),
            Law::MooneyRivlin(c) => mooney_rivlin::tangent(c, p, change),
            Law::Holzapfel(mu, fibres) => holzapfel::tangent(mu, &fibres, p, change),
        }
    }
}

/// State of a cell, or of one in each lane, for given corner displacements.
pub struct Cell<N> {
    /// Gauss points, numbered by the nearest corner.
    pub points: [Point<N>; 8],
    /// Stress-free volume of a Gauss point, m³.
    pub weight: N,
    /// `J̄ − 1`.
    pub mean_dilatation: N,
    /// Cell size and material.
    pub material: Material<N>,
    /// 1/edges of the stress-free shape, 1/m.
    pub inverse: V3<N>,
    /// 0 where the volume is not a positive, finite number at some Gauss point, so that energy and forces are those of the extended law; 1
    /// elsewhere.
    pub upright: N,
}

/// Cells of a body, with the displacements of its nodes.
#[derive(Clone, Copy)]
pub struct Cells<'a, R> {
    /// Parameters of the body's kernels.
    pub params: &'a Params<R>,
    /// `[layer]` cell edges, m, and mass of one corner, kg
    pub shape: &'a [V4<R>],
    /// `[layer]` κ, two constants, Pa, and the law's code
    pub material: &'a [V4<R>],
    /// `[layer]` directions; k₂, κ
    pub fibres: &'a [FibreRows<R>],
    /// `[layer]` elastic strain at rest along x, y, z
    pub pre_strain: &'a [V4<R>],
    /// `[cells_z]` layer
    pub layer_of: &'a [u32],
    /// `[cell]` factor on the stiffness of its layer, or one for all
    pub scale: &'a [R],
    /// See [`super::split`].
    pub split: &'a [u32],
    /// `[node]` displacement, m
    pub displacement: &'a [V4<R>],
}

impl<R: Real> Cells<'_, R> {
    /// Layer of a cell.
    pub fn layer(&self, cell: usize) -> usize {
        self.layer_of[self.params.cell_at(cell)[2]] as usize
    }

    /// Factor of a cell on the stiffness of its layer: every law's energy is linear in its constants.
    pub fn scale(&self, cell: usize) -> R {
        self.scale[cell.min(self.scale.len() - 1)]
    }

    /// Cell size and material of a layer.
    pub fn material(&self, layer: usize) -> Material<R> {
        Material::of(self.shape[layer], self.material[layer], self.fibres[layer], self.pre_strain[layer])
    }

    /// Displacements of a cell's corners, m.
    pub fn corners(&self, cell: usize) -> [V3<R>; 8] {
        self.params.corner_nodes(self.split, cell).map(|n| V3::from4(self.displacement[n]))
    }

    /// State of a cell, of its own material.
    pub fn state(&self, cell: usize) -> Cell<R> {
        Cell::new(self.material(self.layer(cell)).scaled(self.scale(cell)), &self.corners(cell))
    }
}

impl<R: Real> Cell<R> {
    /// Whether the volume is not a positive, finite number at some Gauss point.
    pub fn inverted(&self) -> bool {
        self.upright == R::zero()
    }
}

impl<N: Number> Cell<N> {
    /// From the corners' displacements, m.
    #[inline(always)]
    pub fn new(material: Material<N>, u: &[V3<N>; 8]) -> Self {
        let (edges, e) = (material.edges, material.pre_strain);
        let [zero, one] = [e.x.like(0.0), e.x.like(1.0)];
        let stretch = e + V3::splat(one);
        let inverse = V3::new(stretch.x / edges.x, stretch.y / edges.y, stretch.z / edges.z);
        let gradients = field_gradients(inverse, u);
        let first = Point::new(gradients[0].plus_diagonal(e));
        let (mut points, mut sum, mut upright) = ([first; 8], zero, one);
        let (least, most) = (zero.like(f64::from(f32::MIN_POSITIVE)), zero.like(f64::from(f32::MAX)));
        for (point, gradient) in points.iter_mut().zip(gradients) {
            *point = Point::new(gradient.plus_diagonal(e));
            sum += point.dilatation;
            let volume = one + point.dilatation;
            upright = volume.pick(least, most.pick(volume, upright, zero), zero);
        }
        let eighth = zero.like(0.125);
        let weight = eighth / (inverse.x * inverse.y * inverse.z);
        Self { points, weight, mean_dilatation: sum * eighth, material, inverse, upright }
    }

    /// Energy, J
    #[inline(always)]
    pub fn energy(&self) -> N {
        let mut sum = self.weight.like(0.0);
        for p in &self.points {
            sum += self.material.energy(p);
        }
        let log = log_volume(self.mean_dilatation)[0];
        self.weight * (sum + sum.like(4.0) * self.material.bulk * log * log)
    }

    /// `κ φ(J̄) φ'(J̄)`, which is `κ ln J̄/J̄` for a volume above a tenth, Pa.
    #[inline(always)]
    pub fn pressure(&self) -> N {
        self.material.bulk * log_volume(self.mean_dilatation)[0] * log_volume_slope(self.mean_dilatation)
    }

    /// `∂v/∂u_a`, m².
    pub fn volume_gradient(&self) -> [V3<N>; 8] {
        corner_sums(self.inverse, &self.points.map(|p| p.cofactor * self.weight))
    }

    /// Internal forces at the corners, N.
    #[inline(always)]
    pub fn forces(&self) -> [V3<N>; 8] {
        let pressure = self.pressure();
        let mut stress = [self.points[0].h; 8];
        for (stress, p) in stress.iter_mut().zip(&self.points) {
            *stress = (self.material.stress(p) + p.cofactor * pressure) * self.weight;
        }
        corner_sums(self.inverse, &stress)
    }
}

/// `params.corotational` of a hyperelastic body whose steps are one linear solve each ([`Cell::linearised`]); `product` reads the factor `s`
/// from the length `s^¼` of the cell's quaternion.
pub const STIFFENED: u32 = HYPERELASTIC;
/// That of one whose steps are solved by Newton's method; its small-strain stiffness, which is not stiffened, damps and preconditions.
pub const NEWTON: u32 = HYPERELASTIC + 1;

/// Largest factor.
pub(super) const STIFFEST: f64 = 1e6;

/// Linearisation of a cell: `s R K' Rᵀ + c ⊗ c` and the stiffness of tension ([`super::linearised`]), with `K'` its stiffness at small strain
/// less that of its mean volume ([`mean_volume`]).
#[derive(Clone, Copy, Debug)]
pub struct Linearised<N> {
    /// s
    pub stiffening: N,
    /// Stiffness of the volume and of tension, divided by `s`: `y` is `c` in the patterns 1, 2 and 4 of the cell's frame, divided by `√s`.
    pub rows: Rows<N>,
}

impl<N: Number> Cell<N> {
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
    /// least `(1 + φ' |F|)/2`; Mooney–Rivlin material has more ([`mooney_rivlin::stiffening`]). A pre-strain scales the small-strain stiffness
    /// by up to `max (1 + e)²/Π (1 + e)`.
    ///
    /// Rayleigh damping acts with `R K' Rᵀ` and the same stiffness of the volume: with the factor `f = 1 + r_K/h` of the stiffness in `A` the
    /// result is `1 + (s − 1)/f`.
    ///
    /// Tension `τ` is `(T_i + T_j)/(λ_i + λ_j)` for principal Biot stresses `T` and stretches, which is the stiffness that an isotropic law has
    /// against `H_ij = −H_ji`; here `½ (⅔ tr T + √⅔ |dev T|)` of the mean stress, at least half the sum of any two, without damping.
    ///
    /// `factor` is `f`; none for [`NEWTON`]: a matrix without stiffening and tension.
    #[inline(always)]
    pub fn linearised(&self, factor: Option<N>, q: V4<N>, forces: &[V3<N>; 8]) -> Linearised<N> {
        let [zero, one, eight] = [q[3].like(0.0), q[3].like(1.0), q[3].like(8.0)];
        let rotation = rotation_matrix(q);
        let (mut stiffening, mut tension) = (one, zero);
        if let Some(factor) = factor {
            stiffening = self.stiffening(factor);
            tension = self.tension(rotation, forces) / factor;
        }
        let tension = self.inverse * (one.like(0.25) * (eight * self.weight * tension / stiffening).sqrt());
        let bulk = self.material.bulk * volume_stiffness(self.mean_dilatation);
        let scale = one.like(0.125) * (bulk / (eight * self.weight * stiffening)).sqrt();
        // sign pattern of ∂v/∂u along an axis: the column of Σ w cof F times −2/h
        let mut slope = M3::diagonal(V3::splat(zero));
        for p in &self.points {
            slope = slope + p.cofactor;
        }
        let [x, y, z] = (rotation.transpose() * (slope * (one.like(-2.0) * self.weight * scale))).0;
        let volume = [x * self.inverse.x, y * self.inverse.y, z * self.inverse.z];
        Linearised { stiffening, rows: Rows { volume, tension } }
    }

    /// `τ` of [`Cell::linearised`], Pa.
    #[inline(always)]
    fn tension(&self, rotation: M3<N>, forces: &[V3<N>; 8]) -> N {
        let [zero, three, six] = [self.weight.like(0.0), self.weight.like(3.0), self.weight.like(6.0)];
        // mean of P, by columns
        let mut stress = [V3::splat(zero); 3];
        for (a, force) in forces.iter().enumerate() {
            for (n, column) in stress.iter_mut().enumerate() {
                *column = if corner(a)[n] == 0 { *column - *force } else { *column + *force };
            }
        }
        let (share, inverse) = (zero.like(0.0625) / self.weight, self.inverse);
        let stress =
            M3([stress[0] * (share / inverse.x), stress[1] * (share / inverse.y), stress[2] * (share / inverse.z)]);
        let trace = stress.dot(rotation);
        let deviator = (stress.dot(stress) - trace * trace / three).max(zero);
        (trace / three + (deviator / six).sqrt()).max(zero)
    }

    /// `1 + (s − 1)/f` of [`Cell::linearised`].
    #[inline(always)]
    fn stiffening(&self, factor: N) -> N {
        let (zero, one, two, three) = (factor.like(0.0), factor.like(1.0), factor.like(2.0), factor.like(3.0));
        let shear = self.material.shear();
        let (mut pressed, mut longest, mut fibrous) = (one, three, zero);
        let (mut beyond, mut squares) = (M3::diagonal(V3::splat(zero)), zero); // of the cofactors, from the first one
        for p in &self.points {
            let f = p.gradient();
            let stretched = f.dot(f);
            let mut own = one.max(p.log_gradient.dot(p.log_gradient) - two);
            let (volume, least) = (one + p.dilatation, one.like(EXTENDED));
            if !volume.all_at_least(least) {
                let extended = own.max((one + log_volume_slope(p.dilatation) * stretched.sqrt()) / two);
                own = volume.pick(least, own, extended);
            }
            pressed = pressed.max(self.material.stiffening(p, own));
            let more = p.cofactor - self.points[0].cofactor;
            beyond = beyond + more;
            squares += more.dot(more);
            longest = longest.max(stretched);
            if let Law::Holzapfel(mu, fibres) = &self.material.law {
                fibrous = fibrous.max(holzapfel::stiffening(*mu, fibres, p));
            }
        }
        let uneven = (squares - one.like(0.125) * beyond.dot(beyond)).max(zero);
        let volume = self.material.bulk / (one.like(24.0) * shear) * volume_stiffness(self.mean_dilatation) * uneven;
        let sheared = (-self.pressure() / (two * shear)).max(zero) * (longest / three).sqrt();
        let stretch = self.material.pre_strain + V3::splat(one);
        let strained = stretch.times(stretch) * (one / (stretch.x * stretch.y * stretch.z));
        let strained = one.max(strained.x).max(strained.y).max(strained.z);
        let s = ((pressed + volume + sheared + fibrous) * strained).min(one.like(STIFFEST));
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
