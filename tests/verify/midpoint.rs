//! Midpoint rule with the energy of the step conserved: second order at large strain, energy and momenta in hard cases, Newmark's method for
//! the linear law.

use super::setup::{Body, add, cross, displaced, dot, epsilon, measured, model, tolerance, xyz};
use super::small::{block, held};
use super::{Case, Everywhere};
use cutis::backend::Snapshot;
use cutis::bodies::{Model, elastic_energy};
use cutis::scene::Integrator::{self, ImplicitEuler, Midpoint, Newmark};
use cutis::scene::{Law, Material, Region, Scene};
use cutis::step::Platform;

pub const EVERYWHERE: &[Everywhere] = &[];
pub const CASES: &[Case] = &[("scratch", scratch)];

fn kinetic(model: &Model, state: &Snapshot) -> f64 {
    state.v.iter().zip(&model.free).map(|(v, free)| 0.5 * free[3] * dot(xyz(*v), xyz(*v))).sum()
}

fn elastic(model: &Model, state: &Snapshot) -> f64 {
    elastic_energy(model, &state.u, &state.rotation, &state.split, &state.law)
}

/// Linear and angular momentum about the origin, kg·m/s and kg·m²/s.
fn momenta(model: &Model, state: &Snapshot) -> [[f64; 3]; 2] {
    let mut out = [[0.0; 3]; 2];
    for (node, rest) in model.rest.iter().enumerate() {
        let p = xyz(state.v[node]).map(|v| model.free[node][3] * v);
        out[0] = add(out[0], p);
        out[1] = add(out[1], cross(add(*rest, xyz(state.u[node])), p));
    }
    out
}

/// A free block of neo-Hookean cells.
fn free(cells: [u32; 2], layers: u32) -> Scene {
    let mut scene = block([10e-3; 2], cells, &[(layers, 20e-3, 34e3, 0.45, 1000.0)]);
    scene.skins[0].law = Law::Hyperelastic(Material::NeoHookean);
    (scene.skins[0].rayleigh_mass, scene.skins[0].rayleigh_stiffness) = (0.0, 0.0);
    (scene.time.gravity, scene.time.integrator) = ([0.0; 3], Midpoint);
    scene
}

fn twist(model: &Model, angle: f64) -> Snapshot {
    displaced(model, |x| {
        let (s, c) = (angle * x[2] / 20e-3).sin_cos();
        [c * x[0] - s * x[1] - x[0], s * x[0] + c * x[1] - x[1], 0.0]
    })
}

fn scratch() {
    let which: Vec<f64> = std::env::var("SCRATCH").unwrap_or("0.5e-3,400,0.785".into()).split(',').map(|s| s.parse().unwrap()).collect();
    let platform = match std::env::var("ON").as_deref() { Ok("gpu") => Platform::Gpu(None), Ok("f32") => Platform::Cpu32, _ => Platform::Cpu64 };
    for integrator in if which.len() > 4 { vec![Newmark, Midpoint] } else { vec![Midpoint] } {
        let mut model = model(&free([4, 4], 8));
        (model.step.step, model.step.integrator) = (which[0], integrator);
        let start = twist(&model, which[2]);
        let mut body = Body::new(&platform, model, &start, if which.len() > 3 { which[3] } else { 1e-8 });
        let first = body.state();
        let e0 = elastic(&body.model, &first);
        let steps = which[1] as usize;
        println!("{integrator:?}: start {e0:e}");
        for step in 1..=steps {
            let out = match body.fallible_step() { Ok(o) => o, Err(e) => { println!("  step {step}: {e}"); break } };
            if step <= 3 || step % (steps / 10).max(1) == 0 || !out.converged || body.moved() {
                let state = match std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| body.state())) { Ok(s) => s, Err(_) => { println!("bad state"); break } };
                let (k, w) = (kinetic(&body.model, &state), elastic(&body.model, &state));
                let [p, l] = momenta(&body.model, &state);
                println!("  {step} converged {} newton {} K {:.4} W {:.4} E-1 {:.3e} P {:.1e} L {:.2e}", out.converged, body.newton(), k / e0, w / e0, (k + w) / e0 - 1.0, p[0].abs() + p[1].abs() + p[2].abs(), l[0].abs() + l[1].abs() + l[2].abs());
            }
        }
    }
    let _ = (epsilon(&platform), tolerance(&platform), measured as fn(&str, f64, f64), held as fn(Region, [bool; 3]) -> _, Integrator::Static);
}
