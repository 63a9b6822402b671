//! Product with the system matrix, cells per second: the CPU path in f64 and f32, and the GPU on the first adapter. Each result is
//! checked against the f64 twin before its time counts.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use cutis::bodies::Model;
use cutis::gpu::{Bound, Buffer, Gpu};
use cutis::kernels::GROUP;
use cutis::kernels::product::{self, CellForces, Frames, LANES, cell_groups, product};
use cutis::math::{Real, V3, V4, rotation_matrix};
use std::path::Path;
use std::time::{Duration, Instant};

/// Largest relative error of a product: about 200 rounded terms per sum, f32.
const BOUND: f64 = 200.0 * 6e-8;

struct Case {
    model: Model,
    rotation: Vec<V4<f64>>,
    z: Vec<V4<f64>>,
    exact: Vec<V4<f64>>,
}

fn case(cells: u32, levels: u32) -> Case {
    let text = format!(
        "title = 'bench'\n[time]\nstep_ms = 5.0\nduration_s = 1.0\n[skin]\nsize_mm = [20.0, 20.0]\ncells = [{cells}, {cells}]\n\
         law = 'corotational'\n\
         [[skin.layer]]\nname = 'skin'\nthickness_mm = 2.3\ncells = {levels}\nyoung_kpa = 100.0\npoisson = 0.45\n\
         density_kg_m3 = 1000.0\n[[boundary]]\nregion = 'bottom'\n"
    );
    let files = cutis::scene::Files::Embedded(&[]);
    let scene = cutis::scene::parse(&text, Path::new("bench.toml"), &files).expect("the text above is a scene");
    let model = Model::new(&scene, 0).expect("the grid is small");
    let wave = |i: usize, n: usize| (i as f64 * 0.7 + n as f64).sin();
    let rotation: Vec<V4<f64>> = (0..model.grid.cell_count())
        .map(|i| {
            let q = [0.3 * wave(i, 0), 0.3 * wave(i, 1), 0.3 * wave(i, 2), 1.0];
            let length = q.iter().map(|c| c * c).sum::<f64>().sqrt();
            q.map(|c| c / length)
        })
        .collect();
    let z: Vec<V4<f64>> =
        (0..model.grid.node_count()).map(|i| [wave(i, 3), wave(i, 4), wave(i, 5), 0.0].map(|c| 1e-4 * c)).collect();
    let exact = dense(&model, &rotation, &z);
    Case { model, rotation, z, exact }
}

fn check(name: &str, exact: &[V4<f64>], found: impl Iterator<Item = [f64; 4]>) {
    let largest = exact.iter().flatten().fold(0.0f64, |m, v| m.max(v.abs()));
    let worst = exact.iter().zip(found).flat_map(|(a, b)| (0..3).map(move |n| (a[n] - b[n]).abs())).fold(0.0, f64::max);
    println!("{name}: worst error {:.1e} of the largest force (bound {BOUND:.0e})", worst / largest);
    assert!(worst <= BOUND * largest, "{name} is wrong: its time would mean nothing");
}

/// The same product element by element with the whole 24×24 matrices, in f64: shares no code with what is measured.
fn dense(model: &Model, rotation: &[V4<f64>], z: &[V4<f64>]) -> Vec<V4<f64>> {
    let params = model.params::<f64>();
    let mut w = vec![[0.0; 4]; z.len()];
    for (cell, q) in rotation.iter().enumerate() {
        let corners = params.corners(cell);
        let k = &model.hexahedra().stiffness[model.grid.layer_of[params.cell_at(cell)[2]] as usize];
        let r = rotation_matrix(*q);
        let local = corners.map(|n| (r.transpose() * V3::from4(z[n])).f64());
        for (a, node) in corners.into_iter().enumerate() {
            let force = [0, 1, 2].map(|i| (0..24).map(|c| k[3 * a + i][c] * local[c / 3][c % 3]).sum::<f64>());
            let turned = (r * V3::of(force)).f64();
            (0..3).for_each(|n| w[node][n] += params.stiffness_factor * turned[n]);
        }
    }
    for (i, w) in w.iter_mut().enumerate() {
        let dofs = model.dofs[i];
        *w = [0, 1, 2, 3].map(|n| if n < 3 { dofs[n] * (w[n] + params.inertia * dofs[3] * z[i][n]) } else { 0.0 });
    }
    w
}

/// Hands over a closure that multiplies once.
fn cpu<R: Real>(model: &Model, rotation: &[V4<f64>], z: &[V4<f64>], use_it: impl FnOnce(&mut dyn FnMut(&mut [V4<R>]))) {
    let round = |a: &[V4<f64>]| a.iter().map(|v| v.map(R::of)).collect::<Vec<_>>();
    let (rotation, dofs, z) = (round(rotation), round(&model.dofs), round(z));
    let (params, modes, layers) = (model.params::<R>(), model.modes::<R>(), &model.grid.layer_of);
    let mut scratch: Vec<CellForces<R>> = vec![[[[R::zero(); LANES]; 3]; 8]; cell_groups(&params)];
    let frames = Frames::new(&params, &rotation, &[]);
    use_it(&mut |w| {
        product(&params, &modes, layers, &frames, &dofs, &z, w, &mut scratch);
    });
}

/// The shader with arrays of its own.
struct Device {
    gpu: Gpu,
    kernel: Bound,
    w: Buffer,
    threads: usize,
    nodes: usize,
}

impl Device {
    fn new(gpu: Gpu, case: &Case) -> cutis::error::Result<Self> {
        let model = &case.model;
        let params = model.params::<f32>();
        let narrow = |a: &[V4<f64>]| a.iter().map(|v| v.map(|c| c as f32)).collect::<Vec<_>>();
        let modes: Vec<[f32; 4]> =
            model.modes::<f32>().iter().flatten().flatten().map(|c| [c[0], c[1], c[2], 0.0]).collect();
        let w = gpu.array::<V4<f32>>("w", case.z.len())?;
        let list = [
            ("params", gpu.uniform("params", 0, &params.words())),
            ("modes", gpu.uniform("modes", 168 * 48, &modes)),
            ("layer_of", gpu.array_of("layer_of", &model.grid.layer_of)?),
            ("rotation", gpu.array_of("rotation", &narrow(&case.rotation))?),
            ("dofs", gpu.array_of("dofs", &narrow(&model.dofs))?),
            ("z", gpu.array_of("z", &narrow(&case.z))?),
            ("w", w.clone()),
            ("partial_product", gpu.array::<f32>("partial_product", params.product_groups as usize)?),
            ("scalars", gpu.array::<V4<f32>>("scalars", 2)?),
            ("split", gpu.array::<u32>("split", 1)?),
        ];
        let borrowed: Vec<(&str, &Buffer)> = list.iter().map(|(name, buffer)| (*name, buffer)).collect();
        let kernel = gpu.bind(&product::SOURCE, &borrowed)?;
        let threads = (params.product_groups * GROUP) as usize;
        Ok(Self { kernel, w, threads, nodes: case.z.len(), gpu })
    }

    fn run(&self, times: usize) -> cutis::error::Result<Vec<V4<f32>>> {
        let mut batch = self.gpu.batch();
        for _ in 0..times {
            batch.run(&self.kernel, self.threads, 1);
        }
        let bytes = (self.nodes * 16) as u64;
        let parts = self.gpu.submit_and_read(batch, &[(&self.w, bytes)])?;
        Ok(cutis::gpu::cast(&parts[0]))
    }
}

/// Millions of cells per second, median and best of rounds in which every path has its turn, and ratios of the medians: other work on
/// the machine touches all of them alike.
fn compare(case: &Case, id: &str, device: Option<&Device>) {
    const ROUNDS: usize = 25;
    let (model, cells) = (&case.model, case.model.grid.cell_count() as f64);
    let (mut w64, mut w32) = (vec![[0f64; 4]; case.z.len()], vec![[0f32; 4]; case.z.len()]);
    let (mut double, mut single, mut gpu) = (vec![], vec![], vec![]);
    cpu::<f64>(model, &case.rotation, &case.z, |f64_run| {
        cpu::<f32>(model, &case.rotation, &case.z, |f32_run| {
            for _ in 0..ROUNDS {
                let timed = |run: &mut dyn FnMut(), times: f64| {
                    let start = Instant::now();
                    run();
                    1e-6 * times * cells / start.elapsed().as_secs_f64()
                };
                double.push(timed(&mut || f64_run(&mut w64), 1.0));
                single.push(timed(&mut || f32_run(&mut w32), 1.0));
                if let Some(device) = device {
                    gpu.push(timed(&mut || drop(device.run(20)), 20.0));
                }
            }
        });
    });
    let median = |name: &str, rates: &mut Vec<f64>| {
        rates.sort_by(f64::total_cmp);
        let (Some(middle), Some(best)) = (rates.get(rates.len() / 2), rates.last()) else { return f64::NAN };
        println!("{id} {name}: median {middle:.1}, best {best:.1} million cells per second");
        *middle
    };
    let (double, single, gpu) =
        (median("cpu f64", &mut double), median("cpu f32", &mut single), median("gpu", &mut gpu));
    println!("{id}: f32 / f64 {:.2}, cpu f32 / gpu {:.2}", single / double, single / gpu);
}

fn products(c: &mut Criterion) {
    let mut group = c.benchmark_group("product");
    group.sample_size(10).measurement_time(Duration::from_secs(3)).warm_up_time(Duration::from_secs(1));
    // a million cells take a software adapter too long
    let hardware = cutis::gpu::adapters().first().is_some_and(|adapter| !adapter.software);
    for (cells, levels) in [(64, 5), (32, 23), (200, 23)].into_iter().take(if hardware { 3 } else { 2 }) {
        let case = case(cells, levels);
        let id = format!("{cells}x{cells}x{levels}");
        group.throughput(Throughput::Elements(case.model.grid.cell_count() as u64));
        cpu::<f64>(&case.model, &case.rotation, &case.z, |run| {
            let mut w = vec![[0.0; 4]; case.z.len()];
            run(&mut w);
            check("cpu f64", &case.exact, w.iter().copied());
            group.bench_function(BenchmarkId::new("cpu_f64", &id), |b| b.iter(|| run(&mut w)));
        });
        cpu::<f32>(&case.model, &case.rotation, &case.z, |run| {
            let mut w = vec![[0.0; 4]; case.z.len()];
            run(&mut w);
            check("cpu f32", &case.exact, w.iter().map(|v| v.map(f64::from)));
            group.bench_function(BenchmarkId::new("cpu_f32", &id), |b| b.iter(|| run(&mut w)));
        });
        let Ok(gpu) = Gpu::open(None) else {
            println!("no adapter: the GPU is left out");
            compare(&case, &id, None);
            continue;
        };
        println!("adapter {} ({}) {}", gpu.adapter.name, gpu.adapter.backend, gpu.adapter.driver);
        let device = Device::new(gpu, &case).expect("arrays fit");
        let found = device.run(1).expect("the device works");
        check("gpu", &case.exact, found.into_iter().map(|v| v.map(f64::from)));
        compare(&case, &id, Some(&device));
        // 20 products a submission, as a solve has them, so that the read-back does not count
        group.throughput(Throughput::Elements(20 * case.model.grid.cell_count() as u64));
        group.bench_function(BenchmarkId::new("gpu_20_products", &id), |b| b.iter(|| device.run(20)));
    }
    group.finish();
}

criterion_group!(benches, products);
criterion_main!(benches);
