//! Known answers: the solver against closed forms, conservation laws, finite differences and converged references.
//!
//! Every check has a counter-test: the same measure on something that is deliberately wrong must fail it. Checks that run everywhere are
//! functions over [`Platform`] and run in f64, in f32 and, where there is an adapter, on the GPU; without one the GPU runs are listed as
//! ignored with the reason, and `CUTIS_GPU=require` makes that a failure. `CUTIS_MEASURED=1` prints what was measured.

mod dense;
mod differences;
mod direct;
mod elements;
mod holzapfel;
mod inclusions;
mod integrators;
mod loads;
mod masses;
mod midpoint;
mod mooney_rivlin;
mod motion;
mod multigrid;
mod neo_hookean;
mod prestrain;
mod probes;
mod refinement;
mod release;
mod rest_springs;
mod setup;
mod skin_block;
mod slit;
#[path = "../shared/small.rs"]
mod small;
mod solver;
mod springs;
mod statics;
mod tetrahedra;

use cutis::gpu::adapters;
use cutis::step::Platform;
use libtest_mimic::{Arguments, Completion, Failed, Trial};
use std::process::ExitCode;

/// Runs on the CPU path in f64.
pub type Case = (&'static str, fn());
/// Runs on every platform.
pub type Everywhere = (&'static str, fn(&Platform));

fn on_gpu((name, run): Everywhere, adapter_present: bool) -> Trial {
    let required = std::env::var("CUTIS_GPU").is_ok_and(|v| v == "require");
    let trial = move || match (adapter_present, required) {
        (true, _) => {
            run(&Platform::Gpu(None));
            Ok(Completion::Completed)
        }
        (false, true) => Err(Failed::from("CUTIS_GPU=require, but there is no Vulkan, Metal or DX12 adapter")),
        (false, false) => {
            Ok(Completion::ignored_with("no Vulkan, Metal or DX12 adapter; `./tests/run` installs a software one"))
        }
    };
    Trial::ignorable_test(name, trial).with_kind("gpu f32")
}

fn main() -> ExitCode {
    let arguments = Arguments::from_args();
    let found = adapters();
    if !arguments.list {
        let names = found.iter().map(|a| format!("{} ({}, {})", a.name, a.backend, a.driver));
        println!("adapters: {:?}", names.collect::<Vec<_>>());
    }
    let groups: [&[Case]; 22] = [
        rest_springs::CASES,
        multigrid::CASES,
        direct::CASES,
        elements::CASES,
        inclusions::CASES,
        tetrahedra::CASES,
        integrators::CASES,
        loads::CASES,
        differences::CASES,
        dense::CASES,
        solver::CASES,
        springs::CASES,
        statics::CASES,
        motion::CASES,
        neo_hookean::CASES,
        masses::CASES,
        midpoint::CASES,
        skin_block::CASES,
        release::CASES,
        prestrain::CASES,
        probes::CASES,
        slit::CASES,
    ];
    let everywhere: [&[Everywhere]; 18] = [
        rest_springs::EVERYWHERE,
        multigrid::EVERYWHERE,
        elements::EVERYWHERE,
        integrators::EVERYWHERE,
        loads::EVERYWHERE,
        motion::EVERYWHERE,
        holzapfel::EVERYWHERE,
        inclusions::EVERYWHERE,
        mooney_rivlin::EVERYWHERE,
        neo_hookean::EVERYWHERE,
        masses::EVERYWHERE,
        midpoint::EVERYWHERE,
        springs::EVERYWHERE,
        release::EVERYWHERE,
        prestrain::EVERYWHERE,
        probes::EVERYWHERE,
        refinement::EVERYWHERE,
        slit::EVERYWHERE,
    ];
    let mut trials = vec![];
    for (name, run) in groups.into_iter().flatten() {
        let run = move || {
            run();
            Ok(())
        };
        trials.push(Trial::test(*name, run).with_kind("cpu f64"));
    }
    for case in everywhere.into_iter().flatten() {
        let (name, run) = *case;
        for (platform, kind) in [(Platform::Cpu64, "cpu f64"), (Platform::Cpu32, "cpu f32")] {
            let run = move || {
                run(&platform);
                Ok(())
            };
            trials.push(Trial::test(name, run).with_kind(kind));
        }
        trials.push(on_gpu(*case, !found.is_empty()));
    }
    libtest_mimic::run(&arguments, trials).exit_code()
}
