//! SIMD arithmetic with the registers of the machine: AVX-512, AVX2 with FMA, NEON, or scalar, detected at run time.
//!
//! `pulp` detects them without unsafe code here. Code between [`Wide::widest`] and the arithmetic must be `#[inline(always)]`: code that is
//! not inlined is compiled for the baseline machine.
//!
//! A [`Task`] gives the same bits with any registers, and so on every machine, because
//! - lanes are independent: there is no sum across a register;
//! - dot products have [`MOST`] sums whatever the register's width ([`dot_product`]);
//! - values that several lanes add to get the contributions in the order of the elements, as in scalar code;
//! - a fused multiply-add ([`Lanes::mul_add`]) rounds once everywhere, in software where the processor has no instruction for it, and a
//!   separate product and sum round twice everywhere: the compiler does not fuse them.
//!
//! [`force`] makes the whole process use other registers than the widest, so that tests can check this on one machine.
//!
//! Vectors at the corners of many boxes at once: [`patterns`] has their sums in the eight sign patterns; there are rotations by
//! quaternions, too. The sums are a Walsh–Hadamard transform of length 8, `a_p = Σ_c (−1)^(bits of p ∧ c) a_c`; applied twice it gives
//! `8 a`. A register holds the same component of as many boxes as it has lanes.

use super::elementary::{fma, fma_f32};
use super::{Number, Real};
use bytemuck::Pod;
use pulp::{Arch, Simd, WithSimd};
use std::array::from_fn;
use std::fmt::{self, Debug, Formatter};
use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub};
use std::sync::atomic::{AtomicU8, Ordering};

/// Registers for tasks on f32 and f64.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Registers {
    /// The widest of this machine.
    Widest,
    /// AVX2 with FMA, 32 bytes.
    Avx2,
    /// [`Arrays`] of 64 bytes, as wide as AVX-512's registers.
    Arrays,
    /// [`OneByOne`].
    One,
}

const ALL: [Registers; 4] = [Registers::Widest, Registers::Avx2, Registers::Arrays, Registers::One];

static FORCED: AtomicU8 = AtomicU8::new(Registers::Widest as u8);

impl Registers {
    /// Kinds available on this machine.
    pub fn of_this_machine() -> Vec<Self> {
        ALL.into_iter().filter(|kind| *kind != Self::Avx2 || has_avx2()).collect()
    }
}

/// Sets the registers of all further tasks on f32 and f64, in all threads of the process; if the machine lacks them, its widest are used.
/// Results do not change, so running tasks are not affected.
pub fn force(registers: Registers) {
    FORCED.store(registers as u8, Ordering::Relaxed);
}

fn forced() -> Registers {
    ALL[usize::from(FORCED.load(Ordering::Relaxed))]
}

/// Registers of numbers `R`.
pub trait Lanes<R: Pod>: Copy {
    /// One register.
    type V: Pod;
    /// Numbers per register, 1 to [`MOST`].
    const COUNT: usize = size_of::<Self::V>() / size_of::<R>();
    /// The same number in all lanes.
    fn splat(self, a: R) -> Self::V;
    /// `a + b`
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a − b`
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b`
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b + c`, rounded once.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
    /// `a / b`
    fn div(self, a: Self::V, b: Self::V) -> Self::V;
    /// `√a`
    fn sqrt(self, a: Self::V) -> Self::V;
    /// `above` where `a ≥ bound`, `below` elsewhere, and for NaN.
    fn pick(self, a: Self::V, bound: Self::V, above: Self::V, below: Self::V) -> Self::V;
    /// The first [`Lanes::COUNT`] numbers of a slice.
    #[inline(always)]
    fn load(self, from: &[R]) -> Self::V {
        bytemuck::pod_read_unaligned(bytemuck::cast_slice(&from[..Self::COUNT]))
    }
    /// Writes the first [`Lanes::COUNT`] numbers of a slice.
    #[inline(always)]
    fn store(self, a: Self::V, to: &mut [R]) {
        to[..Self::COUNT].copy_from_slice(bytemuck::cast_slice(std::slice::from_ref(&a)));
    }
}

/// Numbers in the widest supported register (f32, AVX-512).
pub const MOST: usize = 16;

/// Work compiled once per kind of register.
pub trait Task<R: Pod> {
    /// Result.
    type Output;
    /// Runs the work; mark it `#[inline(always)]`.
    fn run<L: Lanes<R>>(self, lanes: L) -> Self::Output;
}

/// Numbers that a [`Task`] can use.
pub trait Wide: Pod + Number {
    /// `self b + c`, rounded once.
    fn mul_add(self, b: Self, c: Self) -> Self;
    /// Runs a task with the widest registers of this machine; one number at a time if there are none.
    fn widest<T: Task<Self>>(task: T) -> T::Output {
        task.run(OneByOne)
    }
}

/// Registers of one number.
#[derive(Clone, Copy, Debug)]
pub struct OneByOne;

impl<R: Wide> Lanes<R> for OneByOne {
    type V = R;
    #[inline(always)]
    fn splat(self, a: R) -> R {
        a
    }
    #[inline(always)]
    fn add(self, a: R, b: R) -> R {
        a + b
    }
    #[inline(always)]
    fn sub(self, a: R, b: R) -> R {
        a - b
    }
    #[inline(always)]
    fn mul(self, a: R, b: R) -> R {
        a * b
    }
    #[inline(always)]
    fn mul_add(self, a: R, b: R, c: R) -> R {
        R::mul_add(a, b, c)
    }
    #[inline(always)]
    fn div(self, a: R, b: R) -> R {
        a / b
    }
    #[inline(always)]
    fn sqrt(self, a: R) -> R {
        a.sqrt()
    }
    #[inline(always)]
    fn pick(self, a: R, bound: R, above: R, below: R) -> R {
        a.pick(bound, above, below)
    }
}

/// Registers of `N` numbers, for any machine.
#[derive(Clone, Copy, Debug)]
pub struct Arrays<const N: usize>;

impl<R: Wide, const N: usize> Lanes<R> for Arrays<N>
where
    [R; N]: Pod,
{
    type V = [R; N];
    #[inline(always)]
    fn splat(self, a: R) -> [R; N] {
        [a; N]
    }
    #[inline(always)]
    fn add(self, a: [R; N], b: [R; N]) -> [R; N] {
        from_fn(|i| a[i] + b[i])
    }
    #[inline(always)]
    fn sub(self, a: [R; N], b: [R; N]) -> [R; N] {
        from_fn(|i| a[i] - b[i])
    }
    #[inline(always)]
    fn mul(self, a: [R; N], b: [R; N]) -> [R; N] {
        from_fn(|i| a[i] * b[i])
    }
    #[inline(always)]
    fn mul_add(self, a: [R; N], b: [R; N], c: [R; N]) -> [R; N] {
        from_fn(|i| R::mul_add(a[i], b[i], c[i]))
    }
    #[inline(always)]
    fn div(self, a: [R; N], b: [R; N]) -> [R; N] {
        from_fn(|i| a[i] / b[i])
    }
    #[inline(always)]
    fn sqrt(self, a: [R; N]) -> [R; N] {
        from_fn(|i| a[i].sqrt())
    }
    #[inline(always)]
    fn pick(self, a: [R; N], bound: [R; N], above: [R; N], below: [R; N]) -> [R; N] {
        from_fn(|i| a[i].pick(bound[i], above[i], below[i]))
    }
}

/// A number in each lane of a register.
pub struct Packed<R: Pod, L: Lanes<R>> {
    v: L::V,
    lanes: L,
}

impl<R: Pod, L: Lanes<R>> Clone for Packed<R, L> {
    #[inline(always)]
    fn clone(&self) -> Self {
        *self
    }
}
impl<R: Pod, L: Lanes<R>> Copy for Packed<R, L> {}

impl<R: Pod + Debug, L: Lanes<R>> Debug for Packed<R, L> {
    fn fmt(&self, f: &mut Formatter) -> fmt::Result {
        let numbers: &[R] = bytemuck::cast_slice(std::slice::from_ref(&self.v));
        numbers.fmt(f)
    }
}

macro_rules! operator {
    ($trait:ident, $fn:ident) => {
        impl<R: Pod, L: Lanes<R>> $trait for Packed<R, L> {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, o: Self) -> Self {
                Self { v: self.lanes.$fn(self.v, o.v), ..self }
            }
        }
    };
}
operator!(Add, add);
operator!(Sub, sub);
operator!(Mul, mul);
operator!(Div, div);

impl<R: Wide, L: Lanes<R>> Neg for Packed<R, L> {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self * self.like(-1.0)
    }
}
impl<R: Pod, L: Lanes<R>> AddAssign for Packed<R, L> {
    #[inline(always)]
    fn add_assign(&mut self, o: Self) {
        *self = *self + o;
    }
}

impl<R: Wide, L: Lanes<R>> Packed<R, L> {
    /// The same number in all lanes.
    #[inline(always)]
    pub fn splat(lanes: L, value: R) -> Self {
        Self { v: lanes.splat(value), lanes }
    }
    /// The first numbers of a slice.
    #[inline(always)]
    pub fn load(lanes: L, from: &[R]) -> Self {
        Self { v: lanes.load(from), lanes }
    }
    /// Writes the first numbers of a slice.
    #[inline(always)]
    pub fn store(self, to: &mut [R]) {
        self.lanes.store(self.v, to);
    }
    /// A function of each lane; not for what has to be fast.
    #[inline(always)]
    fn each(self, of: impl Fn(R) -> R) -> Self {
        let mut numbers = [self.lanes.splat(R::zeroed()); 1];
        let own: &[R] = bytemuck::cast_slice(std::slice::from_ref(&self.v));
        bytemuck::cast_slice_mut(&mut numbers).iter_mut().zip(own).for_each(|(to, from)| *to = of(*from));
        Self { v: numbers[0], ..self }
    }
}

impl<R: Wide, L: Lanes<R>> Number for Packed<R, L> {
    #[inline(always)]
    fn like(self, value: f64) -> Self {
        Self { v: self.lanes.splat(R::zeroed().like(value)), ..self }
    }
    #[inline(always)]
    fn sqrt(self) -> Self {
        Self { v: self.lanes.sqrt(self.v), ..self }
    }
    #[inline(always)]
    fn ln(self) -> Self {
        self.each(R::ln)
    }
    #[inline(always)]
    fn exp(self) -> Self {
        self.each(R::exp)
    }
    #[inline(always)]
    fn abs(self) -> Self {
        self.pick(self.like(0.0), self, -self)
    }
    #[inline(always)]
    fn max(self, other: Self) -> Self {
        self.pick(other, self, other.pick(other, other, self))
    }
    #[inline(always)]
    fn min(self, other: Self) -> Self {
        other.pick(self, self, other.pick(other, other, self))
    }
    #[inline(always)]
    fn pick(self, bound: Self, above: Self, below: Self) -> Self {
        Self { v: self.lanes.pick(self.v, bound.v, above.v, below.v), ..self }
    }
    #[inline(always)]
    fn all_at_least(self, bound: Self) -> bool {
        let (own, bound) = ([self.v], [bound.v]);
        let (own, bound): (&[R], &[R]) = (bytemuck::cast_slice(&own), bytemuck::cast_slice(&bound));
        let mut all = true;
        for i in 0..L::COUNT {
            all &= own[i].all_at_least(bound[i]);
        }
        all
    }
}

#[derive(Clone, Copy)]
struct On<S>(S);

/// Runs on AVX2, or on the widest registers without it.
#[cfg(target_arch = "x86_64")]
fn on_avx2<O: WithSimd>(work: O) -> O::Output {
    match pulp::x86::V3::try_new() {
        Some(simd) => Simd::vectorize(simd, work),
        None => Arch::new().dispatch(work),
    }
}

#[cfg(not(target_arch = "x86_64"))]
fn on_avx2<O: WithSimd>(work: O) -> O::Output {
    Arch::new().dispatch(work)
}

#[cfg(target_arch = "x86_64")]
fn has_avx2() -> bool {
    pulp::x86::V3::try_new().is_some()
}

#[cfg(not(target_arch = "x86_64"))]
fn has_avx2() -> bool {
    false
}

macro_rules! wide {
    ($t:ty, $v:ident, $fma:path, $splat:ident, $add:ident, $sub:ident, $mul:ident, $div:ident, $sqrt:ident, $mul_add:ident, $at_least:ident, $select:ident) => {
        impl<S: Simd> Lanes<$t> for On<S> {
            type V = S::$v;
            #[inline(always)]
            fn splat(self, a: $t) -> Self::V {
                self.0.$splat(a)
            }
            #[inline(always)]
            fn add(self, a: Self::V, b: Self::V) -> Self::V {
                self.0.$add(a, b)
            }
            #[inline(always)]
            fn sub(self, a: Self::V, b: Self::V) -> Self::V {
                self.0.$sub(a, b)
            }
            #[inline(always)]
            fn mul(self, a: Self::V, b: Self::V) -> Self::V {
                self.0.$mul(a, b)
            }
            #[inline(always)]
            fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V {
                self.0.$mul_add(a, b, c)
            }
            #[inline(always)]
            fn div(self, a: Self::V, b: Self::V) -> Self::V {
                self.0.$div(a, b)
            }
            #[inline(always)]
            fn sqrt(self, a: Self::V) -> Self::V {
                self.0.$sqrt(a)
            }
            #[inline(always)]
            fn pick(self, a: Self::V, bound: Self::V, above: Self::V, below: Self::V) -> Self::V {
                self.0.$select(self.0.$at_least(a, bound), above, below)
            }
        }
        impl Wide for $t {
            fn mul_add(self, b: Self, c: Self) -> Self {
                $fma(self, b, c)
            }
            fn widest<T: Task<$t>>(task: T) -> T::Output {
                struct Op<T>(T);
                impl<T: Task<$t>> WithSimd for Op<T> {
                    type Output = T::Output;
                    #[inline(always)]
                    fn with_simd<S: Simd>(self, simd: S) -> T::Output {
                        self.0.run(On(simd))
                    }
                }
                match (forced(), Arch::new()) {
                    (Registers::Arrays, _) => task.run(Arrays::<{ 64 / size_of::<$t>() }>),
                    (Registers::One, _) | (_, Arch::Scalar) => task.run(OneByOne),
                    (Registers::Avx2, _) => on_avx2(Op(task)),
                    (Registers::Widest, widest) => widest.dispatch(Op(task)),
                }
            }
        }
    };
}
wide!(
    f32,
    f32s,
    fma_f32,
    splat_f32s,
    add_f32s,
    sub_f32s,
    mul_f32s,
    div_f32s,
    sqrt_f32s,
    mul_add_f32s,
    greater_than_or_equal_f32s,
    select_f32s
);
wide!(
    f64,
    f64s,
    fma,
    splat_f64s,
    add_f64s,
    sub_f64s,
    mul_f64s,
    div_f64s,
    sqrt_f64s,
    mul_add_f64s,
    greater_than_or_equal_f64s,
    select_f64s
);

/// `a·b` by [`MOST`] sums that each take every so many products, which registers of any width have side by side: one chain of additions
/// takes four times as long.
#[inline(always)]
pub fn dot_product<R: Real>(a: &[R], b: &[R]) -> R {
    let mut sums = [R::zero(); MOST];
    add_products(a, b, &mut sums);
    let mut sum = R::zero();
    for n in 0..MOST {
        sum += sums[n];
    }
    sum
}

/// Adds the products of two slices of one length to the sums of [`dot_product`].
#[inline(always)]
pub fn add_products<R: Real>(a: &[R], b: &[R], sums: &mut [R; MOST]) {
    debug_assert_eq!(a.len(), b.len());
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<MOST>(), b.as_chunks::<MOST>());
    // a copy stays in registers
    let mut own = *sums;
    for k in 0..a.len().min(b.len()) {
        for n in 0..MOST {
            own[n] += a[k][n] * b[k][n];
        }
    }
    for n in 0..a_rest.len().min(b_rest.len()) {
        own[n] += a_rest[n] * b_rest[n];
    }
    *sums = own;
}

/// `a·b`
#[inline(always)]
pub fn dot<R: Real, L: Lanes<R>>(l: L, a: [L::V; 3], b: [L::V; 3]) -> L::V {
    l.mul_add(a[2], b[2], l.mul_add(a[1], b[1], l.mul(a[0], b[0])))
}

/// Sums over the corners with the eight sign patterns; corner and pattern numbers are bits x + 2y + 4z.
///
/// Written out, without loops: what is indexed in a loop that the compiler keeps lies in memory, and a product took twice as long (f64: 2.3 times).
#[inline(always)]
pub fn patterns<R: Real, L: Lanes<R>>(l: L, [a, b, c, d, e, f, g, h]: [[L::V; 3]; 8]) -> [[L::V; 3]; 8] {
    let x = patterns_of(l, [a[0], b[0], c[0], d[0], e[0], f[0], g[0], h[0]]);
    let y = patterns_of(l, [a[1], b[1], c[1], d[1], e[1], f[1], g[1], h[1]]);
    let z = patterns_of(l, [a[2], b[2], c[2], d[2], e[2], f[2], g[2], h[2]]);
    [
        [x[0], y[0], z[0]],
        [x[1], y[1], z[1]],
        [x[2], y[2], z[2]],
        [x[3], y[3], z[3]],
        [x[4], y[4], z[4]],
        [x[5], y[5], z[5]],
        [x[6], y[6], z[6]],
        [x[7], y[7], z[7]],
    ]
}

/// The same of one component.
#[inline(always)]
fn patterns_of<R: Real, L: Lanes<R>>(l: L, [a, b, c, d, e, f, g, h]: [L::V; 8]) -> [L::V; 8] {
    // along x, y and z
    let [a, b, c, d] = [l.add(a, b), l.sub(a, b), l.add(c, d), l.sub(c, d)];
    let [e, f, g, h] = [l.add(e, f), l.sub(e, f), l.add(g, h), l.sub(g, h)];
    let [a, b, c, d] = [l.add(a, c), l.add(b, d), l.sub(a, c), l.sub(b, d)];
    let [e, f, g, h] = [l.add(e, g), l.add(f, h), l.sub(e, g), l.sub(f, h)];
    [l.add(a, e), l.add(b, f), l.add(c, g), l.add(d, h), l.sub(a, e), l.sub(b, f), l.sub(c, g), l.sub(d, h)]
}

/// Rows of `|q|² R(q)`: zero for a removed cell.
#[inline(always)]
pub fn rotation_rows<R: Real, L: Lanes<R>>(l: L, [x, y, z, w]: [L::V; 4]) -> [[L::V; 3]; 3] {
    let (x2, y2, z2) = (l.add(x, x), l.add(y, y), l.add(z, z));
    let (xx, yy, zz, ww) = (l.mul(x, x), l.mul(y, y), l.mul(z, z), l.mul(w, w));
    let (xy, xz, yz) = (l.mul(x2, y), l.mul(x2, z), l.mul(y2, z));
    let (wx, wy, wz) = (l.mul(w, x2), l.mul(w, y2), l.mul(w, z2));
    let (low, across) = (l.sub(ww, zz), l.sub(xx, yy));
    [
        [l.add(low, across), l.sub(xy, wz), l.add(xz, wy)],
        [l.add(xy, wz), l.sub(low, across), l.sub(yz, wx)],
        [l.sub(xz, wy), l.add(yz, wx), l.sub(l.add(ww, zz), l.add(xx, yy))],
    ]
}

/// Rows of `R(q) − I` for a unit quaternion, without cancellation at small angles; `r` are the rows of `R`.
#[inline(always)]
pub fn rotation_minus_one<R: Real, L: Lanes<R>>(
    l: L,
    [x, y, z, _]: [L::V; 4],
    mut r: [[L::V; 3]; 3],
) -> [[L::V; 3]; 3] {
    let minus_two = l.splat(R::of(-2.0));
    for (n, [a, b]) in [[y, z], [x, z], [x, y]].into_iter().enumerate() {
        r[n][n] = l.mul(minus_two, l.mul_add(a, a, l.mul(b, b)));
    }
    r
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Numbers in a register, and `(1 + ε)² − 1 − 2ε`, which two roundings lose.
    struct Lost;

    impl<R: crate::math::Real> Task<R> for Lost {
        type Output = (usize, R);
        #[inline(always)]
        fn run<L: Lanes<R>>(self, lanes: L) -> (usize, R) {
            let one = R::one() + R::EPSILON;
            let least = lanes.splat(R::zero() - R::one() - R::EPSILON - R::EPSILON);
            let mut out = [R::zero(); MOST];
            lanes.store(lanes.mul_add(lanes.splat(one), lanes.splat(one), least), &mut out);
            (L::COUNT, out[L::COUNT - 1])
        }
    }

    #[test]
    fn dot_products_of_any_length_have_every_product_once() {
        for count in [0, 1, 15, 16, 17, 100] {
            let [a, b]: [Vec<f64>; 2] = [3, 5].map(|n| (0..count).map(|k| ((k * n) % 7) as f64).collect());
            let plain: f64 = a.iter().zip(&b).map(|(a, b)| a * b).sum();
            assert_eq!(dot_product(&a, &b), plain, "{count}");
        }
    }

    #[test]
    fn each_kind_of_register_rounds_a_product_sum_once() {
        for kind in Registers::of_this_machine() {
            force(kind);
            let (count, rest) = f64::widest(Lost);
            let (count_f32, rest_f32) = f32::widest(Lost);
            assert_eq!((rest, rest_f32), (f64::EPSILON * f64::EPSILON, f32::EPSILON * f32::EPSILON), "{kind:?}");
            assert!(count_f32 == 2 * count || kind == Registers::One, "{kind:?}: {count_f32} of f32, {count} of f64");
            match kind {
                Registers::Widest => assert!(count_f32 <= MOST),
                Registers::Avx2 => assert_eq!(count, 4),
                Registers::Arrays => assert_eq!(count, 8),
                Registers::One => assert_eq!((count, count_f32), (1, 1)),
            }
        }
        force(Registers::Widest);
    }
}
