//! The cut on the device: no sweep of a path misses what it passes, and it hits what the CPU path hits from the same numbers.

use super::body::Body;
use super::sweeps::{Case, Path, Random, SWEEPS, pad};
use super::{Failure, parity, twins};
use cutis::gpu::{Gpu, Shader, cast};
use cutis::kernels::{COMMON, cut};
use cutis::math::V4;
use glam::DVec3;
use std::collections::BTreeSet;

/// Cases of one dispatch along each axis, each at its own position.
const SIDE: usize = 4;
/// Between two cases, m: further than a case reaches.
const APART: f64 = 12e-3;
/// Dispatches of each kind of path.
const BATCHES: usize = 20;
const PATHS: [Path; 4] = [Path::Through, Path::Near, Path::Rests, Path::Between];

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Every test here, by name.
pub const TESTS: &[(&str, Test)] = &[
    ("no_path_through_a_link_is_missed", no_path_is_missed),
    ("paths_are_missed_by_links_that_do_not_move", missed_where_segments_do_not_move),
    ("random_sweeps_hit_what_they_hit_on_the_cpu", hits_are_those_of_the_cpu),
];

/// What the device and the CPU in f32 have hit: (case, sweep, segment of the case).
type Hits = BTreeSet<(usize, usize, u32)>;

fn cases(path: Path, seed: u64) -> Vec<Case> {
    let mut random = Random::new(seed);
    let position = |n: usize| DVec3::new((n % SIDE) as f64, (n / SIDE % SIDE) as f64, (n / SIDE / SIDE) as f64);
    let centre = DVec3::splat(0.5 * (SIDE - 1) as f64);
    (0..SIDE.pow(3)).map(|n| Case::new(&mut random, path, (position(n) - centre) * APART)).collect()
}

/// Sweeps of all cases, of each case's own blade.
fn both(gpu: &Gpu, shader: &Shader, cases: &[Case]) -> Result<[Hits; 2], Failure> {
    let rest: Vec<V4<f32>> = cases.iter().flat_map(|case| case.rest.iter().map(|p| pad(*p))).collect();
    let points = cases[0].rest.len() as u32;
    let ends: Vec<[u32; 2]> = (0..cases.len() as u32).flat_map(|k| cases[k as usize].segments(k * points)).collect();
    let own = (points - 1) as usize; // segments of a case
    let capacity = ends.len();
    let of = |state: usize| cases.iter().flat_map(|case| case.displacements::<f32>(state)).collect::<Vec<_>>();
    let mut found = [Hits::new(), Hits::new()];
    let words = [capacity as u32, cases.len() as u32, capacity as u32, 0];
    let params = gpu.uniform("params", 16, &words);
    let (ends_there, rest_there) = (gpu.array_of("ends", &ends)?, gpu.array_of("rest", &rest)?);
    for sweep in 0..SWEEPS {
        let quads: Vec<V4<f32>> = cases.iter().flat_map(|case| case.quad(sweep).map(pad)).collect();
        let (before, now) = (of(sweep), of(sweep + 1));
        let list = [
            ("point_u", gpu.array_of("point_u", &now)?),
            ("point_before", gpu.array_of("point_before", &before)?),
            ("quads", gpu.array_of("quads", &quads)?),
            ("hits", gpu.array_of("hits", &vec![[0u32; 2]; capacity])?),
            ("hit_count", gpu.array_of("hit_count", &[0u32; 4])?),
        ];
        let mut bound = vec![("params", &params), ("ends", &ends_there), ("rest", &rest_there)];
        bound.extend(list.iter().map(|(name, buffer)| (*name, buffer)));
        let mut batch = gpu.batch();
        batch.run(&gpu.bind_shader(shader.clone(), &bound)?, capacity, 1);
        let parts = gpu.submit_and_read(batch, &[(&list[4].1, 4), (&list[3].1, capacity as u64 * 8)])?;
        let count = cast::<u32>(&parts[0])[0] as usize;
        let name = |segment: u32| (segment as usize / own, sweep, segment % own as u32);
        found[0].extend(cast::<[u32; 2]>(&parts[1])[..count].iter().map(|hit| name(hit[0])));
        found[1].extend(cut::cut(&ends, &rest, &now, &before, &quads).iter().map(|hit| name(hit.segment)));
    }
    Ok(found)
}

/// Cases, those that no sweep hits on the device, and hits that only one of device and CPU has.
fn count(gpu: &Gpu, shader: &Shader, paths: &[Path]) -> Result<[usize; 3], Failure> {
    let mut counts = [0; 3];
    for (kind, path) in paths.iter().enumerate() {
        for batch in 0..BATCHES {
            let cases = cases(*path, (kind * BATCHES + batch) as u64);
            let [there, here] = both(gpu, shader, &cases)?;
            let hit: BTreeSet<usize> = there.iter().map(|hit| hit.0).collect();
            counts[0] += cases.len();
            counts[1] += cases.len() - hit.len();
            counts[2] += there.symmetric_difference(&here).count();
        }
    }
    Ok(counts)
}

fn no_path_is_missed(gpu: &Gpu) -> Result<(), Failure> {
    let [all, missed, other] = count(gpu, &Shader::read(&cut::SOURCE)?, &PATHS)?;
    super::report(gpu, &format!("{missed} of {all} paths missed, {other} hits are not those of the CPU"));
    if missed > 0 {
        return Err(format!("{missed} of {all} paths missed").into());
    }
    Ok(())
}

/// The counter-test: segments stand where the step ends from its start on.
fn missed_where_segments_do_not_move(gpu: &Gpu) -> Result<(), Failure> {
    let mut wgsl = cut::SOURCE.wgsl.to_string();
    for end in ["first", "second"] {
        let (from, to) = (format!("+ point_before[{end}]"), format!("+ point_u[{end}]"));
        if !wgsl.contains(&from) {
            return Err(format!("`{from}` is not in the kernel").into());
        }
        wgsl = wgsl.replacen(&from, &to, 1);
    }
    let shader = Shader::from_text("cut", format!("{COMMON}\n{wgsl}"))?;
    let [all, missed, _] = count(gpu, &shader, &[Path::Near])?;
    super::report(gpu, &format!("{missed} of {all} paths missed by segments that do not move"));
    if missed == 0 {
        return Err(format!("by segments that do not move none of {all} paths was missed").into());
    }
    Ok(())
}

/// Segments of random bodies that only one of device and CPU cuts are among those that rounding decides.
fn hits_are_those_of_the_cpu(gpu: &Gpu) -> Result<(), Failure> {
    let mut counts = [0; 4]; // segments, hits, decided by rounding, different
    for seed in 0..5 {
        let body = Body::new("cut", [7, 8, 6], 8, 0, seed);
        let segments = |words: &[f64]| -> BTreeSet<u32> { words.iter().step_by(2).map(|k| *k as u32).collect() };
        let there = parity::run_kernel(gpu, &cut::SOURCE, &body)?;
        let there = segments(there.get("hits").ok_or("the kernel does not write `hits`")?);
        let here: Vec<f64> = twins::cut::<f32>(&body)[0].1.iter().map(|c| f64::from(*c)).collect();
        let here = segments(&here);
        let uncertain: BTreeSet<u32> = twins::uncertain_segments(&body).iter().map(|k| *k as u32).collect();
        let other: BTreeSet<u32> = there.symmetric_difference(&here).copied().collect();
        if !other.is_subset(&uncertain) {
            return Err(format!("seed {seed}: segments {other:?} differ, rounding decides {uncertain:?}").into());
        }
        let found = [body.springs.ends.len(), here.len(), uncertain.len(), other.len()];
        (0..4).for_each(|k| counts[k] += found[k]);
    }
    let [all, hits, uncertain, other] = counts;
    super::report(gpu, &format!("{all} segments, {hits} cut, rounding decides {uncertain}, {other} differ"));
    if hits < all / 100 {
        return Err(format!("{hits} of {all} segments are cut").into());
    }
    Ok(())
}
