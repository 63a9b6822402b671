//! draft
use cutis::step::{Place, Simulation};
fn main() {
    let mut a = std::env::args().skip(1);
    let scene = cutis::scene::read(std::path::Path::new(&a.next().unwrap())).unwrap_or_else(|e| panic!("{e}"));
    let place = match a.next().as_deref() {
        Some("gpu") => Place::Gpu(None),
        Some("f32") => Place::Cpu32,
        _ => Place::Cpu64,
    };
    let steps: u32 = a.next().map_or(240, |s| s.parse().unwrap());
    let every: u32 = a.next().map_or(1, |s| s.parse().unwrap());
    let mut sim = Simulation::new(&scene, &place).unwrap_or_else(|e| panic!("{e}"));
    println!("{:?}", sim.device());
    let t = std::time::Instant::now();
    for n in 0..steps {
        let r = sim.step(n % 20 == 19).unwrap();
        if n % every == every - 1 {
            println!(
                "{n:4} free {:3} res {:.1e} true {:?} | contacts {:2} passes {} cres {:.1e} col {:3} corr {:3} F {:?} | cut {} open {:.4} probe {:?} {:?}",
                r.free.iterations,
                r.residual,
                r.true_residual,
                r.contact.count,
                r.contact.passes,
                r.contact.residual,
                r.contact.column_iterations,
                r.correction_iterations,
                r.contact.on_tool.iter().map(|f| f.map(|c| (c * 1000.0).round() / 1000.0)).collect::<Vec<_>>(),
                r.severed,
                r.opening * 1e3,
                r.probes,
                r.warnings
            );
        }
    }
    println!("{:?} {:?} ms/step", sim.totals(), t.elapsed().as_secs_f64() * 1e3 / f64::from(steps));
}
