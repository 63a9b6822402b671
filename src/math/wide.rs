//! Arithmetic on as many numbers at once as the machine has room for: AVX-512, AVX2 with FMA, NEON, or one by one, found out at run time.
//!
//! `pulp` does the finding out without unsafe code here. Code between [`Wide::widest`] and the arithmetic must be `#[inline(always)]`: what
//! is not inlined is compiled for the plain machine. How many numbers there are, and whether a product and a sum round once or twice,
//! depends on the machine, so results repeat bit for bit on one machine only.

use bytemuck::Pod;
use pulp::{Arch, Simd, WithSimd};
use std::ops::{Add, Mul, Sub};

/// The machine's registers, of numbers `R`.
pub trait Lanes<R: Pod>: Copy {
    /// One register.
    type V: Pod;
    /// Numbers in a register, 1 to [`MOST`].
    const COUNT: usize = size_of::<Self::V>() / size_of::<R>();
    /// The same number everywhere.
    fn splat(self, a: R) -> Self::V;
    /// `a + b`
    fn add(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a − b`
    fn sub(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b`
    fn mul(self, a: Self::V, b: Self::V) -> Self::V;
    /// `a b + c`, rounded once where the machine can.
    fn mul_add(self, a: Self::V, b: Self::V, c: Self::V) -> Self::V;
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

/// Numbers in the widest register there is (f32, AVX-512).
pub const MOST: usize = 16;

/// Work that is compiled once for every kind of machine.
pub trait Task<R: Pod> {
    /// What it hands back.
    type Output;
    /// The work; mark it `#[inline(always)]`.
    fn run<L: Lanes<R>>(self, lanes: L) -> Self::Output;
}

/// Numbers that a [`Task`] can be run on.
pub trait Wide: Pod + Add<Output = Self> + Sub<Output = Self> + Mul<Output = Self> {
    /// Runs a task with the widest registers of this machine; number by number where the numbers have none.
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
        a * b + c
    }
}

#[derive(Clone, Copy)]
struct On<S>(S);

macro_rules! wide {
    ($t:ty, $v:ident, $splat:ident, $add:ident, $sub:ident, $mul:ident, $mul_add:ident) => {
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
        }
        impl Wide for $t {
            fn widest<T: Task<$t>>(task: T) -> T::Output {
                struct Op<T>(T);
                impl<T: Task<$t>> WithSimd for Op<T> {
                    type Output = T::Output;
                    #[inline(always)]
                    fn with_simd<S: Simd>(self, simd: S) -> T::Output {
                        self.0.run(On(simd))
                    }
                }
                Arch::new().dispatch(Op(task))
            }
        }
    };
}
wide!(f32, f32s, splat_f32s, add_f32s, sub_f32s, mul_f32s, mul_add_e_f32s);
wide!(f64, f64s, splat_f64s, add_f64s, sub_f64s, mul_f64s, mul_add_e_f64s);
