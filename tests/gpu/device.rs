//! The GPU layer without physics: dispatches of any length, read-back, and the words of its errors.

use super::body::Body;
use super::{Failure, parity};
use cutis::error::Error;
use cutis::gpu::{Buffer, Failed, Gpu, cast};
use cutis::kernels::{GROUP, Params, converge, gather, product, scatter, update};
use cutis::math::V4;

type Test = fn(&Gpu) -> Result<(), Failure>;

/// Every test here, by name.
pub const TESTS: &[(&str, Test)] = &[
    ("a_long_dispatch_is_folded", a_long_dispatch_is_folded),
    ("an_empty_dispatch_does_nothing", an_empty_dispatch_does_nothing),
    ("what_was_written_is_read_back", what_was_written_is_read_back),
    ("a_batch_runs_in_order", a_batch_runs_in_order),
    ("runs_repeat_bit_for_bit", runs_repeat_bit_for_bit),
    ("a_wrong_binding_says_which_names_are_known", a_wrong_binding_says_which_names_are_known),
    ("a_too_large_array_names_itself_and_the_limit", a_too_large_array_names_itself_and_the_limit),
    ("reading_past_an_array_is_refused", reading_past_an_array_is_refused),
    ("writing_past_an_array_is_an_error_at_the_next_read", writing_past_an_array_is_an_error_at_the_next_read),
    ("compensated_sums_are_right_to_one_rounding", compensated_sums_are_right_to_one_rounding),
    ("an_unknown_adapter_lists_those_there_are", an_unknown_adapter_lists_those_there_are),
    ("the_device_says_how_long_it_was_busy", the_device_says_how_long_it_was_busy),
    ("the_device_says_how_long_each_launch_took", the_device_says_how_long_each_launch_took),
];

/// 65,535 groups of 64 per dimension is what core WebGPU dispatches; this is more.
const LONG: usize = 5_000_000;

fn require(holds: bool, what: impl FnOnce() -> String) -> Result<(), Failure> {
    if holds { Ok(()) } else { Err(what().into()) }
}

/// `picked_k = source[ids_k]` on the device.
fn picked(gpu: &Gpu, ids: &[u32], source: &[V4<f32>], threads: usize, rows: u32) -> Result<Vec<V4<f32>>, Failure> {
    let out = gpu.array_of("picked", &vec![[-1f32; 4]; ids.len()])?;
    let list = [
        ("params", &gpu.uniform("params", 16, &[threads as u32, 0, 0, 0])),
        ("ids", &gpu.array_of("ids", ids)?),
        ("source", &gpu.array_of("source", source)?),
        ("picked", &out),
    ];
    let kernel = gpu.bind(&gather::SOURCE, &list)?;
    let mut batch = gpu.batch();
    batch.run(&kernel, threads, rows);
    let parts = gpu.submit_and_read(batch, &[(&out, ids.len() as u64 * 16)])?;
    Ok(cast(&parts[0]))
}

fn a_long_dispatch_is_folded(gpu: &Gpu) -> Result<(), Failure> {
    assert!(LONG > 65_535 * GROUP as usize);
    let source: Vec<V4<f32>> = (0..997).map(|k| [k as f32, 1.0, 2.0, 3.0]).collect();
    let ids: Vec<u32> = (0..LONG as u32).map(|k| k.wrapping_mul(7919) % 997).collect();
    let out = picked(gpu, &ids, &source, LONG, 1)?;
    let wrong = (0..LONG).find(|k| out[*k] != source[ids[*k] as usize]);
    require(wrong.is_none(), || format!("thread {wrong:?} of {LONG} did not run or ran wrongly"))
}

fn an_empty_dispatch_does_nothing(gpu: &Gpu) -> Result<(), Failure> {
    let (ids, source) = ([0u32; 4], [[5f32; 4]]);
    for (threads, rows) in [(0, 1), (4, 0), (0, 0)] {
        let out = picked(gpu, &ids, &source, threads, rows)?;
        require(out == [[-1.0; 4]; 4], || format!("{threads} × {rows} threads wrote {out:?}"))?;
    }
    // empty arrays can be bound, an empty batch can be submitted, nothing can be read
    let (none, ids) = (gpu.array::<V4<f32>>("none", 0)?, gpu.array_of::<u32>("ids", &[])?);
    let list = [
        ("params", &gpu.uniform("params", 16, &[0u32; 4])),
        ("ids", &ids),
        ("values", &gpu.array_of::<V4<f32>>("values", &[])?),
        ("destination", &none),
    ];
    let mut batch = gpu.batch();
    batch.run(&gpu.bind(&scatter::SOURCE, &list)?, 1, 1);
    gpu.submit(batch);
    gpu.submit(gpu.batch());
    let parts = gpu.submit_and_read(gpu.batch(), &[(&none, 0)])?;
    require(parts == [Vec::<u8>::new()], || format!("read {parts:?}"))
}

fn what_was_written_is_read_back(gpu: &Gpu) -> Result<(), Failure> {
    let lengths = [1usize, 3, 4, 5, 1000, 70_001];
    let data: Vec<Vec<u32>> =
        lengths.iter().map(|n| (0..*n as u32).map(|k| k.wrapping_mul(k) ^ 0xA5A5).collect()).collect();
    let buffers: Vec<Buffer> = data.iter().map(|d| gpu.array_of("data", d)).collect::<Result<_, _>>()?;
    // twice: the second time from a staging buffer that held something else
    for take in [1, 2] {
        let wanted: Vec<(&Buffer, u64)> =
            buffers.iter().zip(&lengths).map(|(b, n)| (b, (n / take) as u64 * 4)).collect();
        let parts = gpu.submit_and_read(gpu.batch(), &wanted)?;
        for ((part, data), n) in parts.iter().zip(&data).zip(lengths) {
            require(cast::<u32>(part) == data[..n / take], || format!("{n} / {take} words came back wrong"))?;
        }
    }
    gpu.write(&buffers[4], 400, &[7u32, 8]);
    let back: Vec<u32> = gpu.read(&buffers[4], 1000)?;
    let mut expected = data[4].clone();
    expected[100..102].copy_from_slice(&[7, 8]);
    require(back == expected, || "a write at an offset came back wrong".into())
}

/// Each command of a batch sees what those before it wrote: gather, copy, clear, gather again.
fn a_batch_runs_in_order(gpu: &Gpu) -> Result<(), Failure> {
    let (a, b) = (gpu.array_of("a", &[[1f32; 4], [2.0; 4]])?, gpu.array_of("b", &[[0f32; 4]; 2])?);
    let (params, ids) = (gpu.uniform("params", 16, &[2u32, 0, 0, 0]), gpu.array_of("ids", &[1u32, 0])?);
    let bind =
        |from, to| gpu.bind(&gather::SOURCE, &[("params", &params), ("ids", &ids), ("source", from), ("picked", to)]);
    let (swap, back) = (bind(&a, &b)?, bind(&b, &a)?);
    let mut batch = gpu.batch();
    batch.run(&swap, 2, 1); // b = 2 1
    batch.clear(&b, 16, 16); // b = 2 0
    batch.clear(&b, 0, 0);
    batch.run(&back, 2, 1); // a = 0 2
    batch.copy(&a, 16, &b, 16, 16); // b = 2 2
    let parts = gpu.submit_and_read(batch, &[(&a, 32), (&b, 32)])?;
    let found: Vec<Vec<f32>> = parts.iter().map(|p| cast::<f32>(p).into_iter().step_by(4).collect()).collect();
    require(found == [[0.0, 2.0], [2.0, 2.0]], || format!("a and b are {found:?}"))
}

fn runs_repeat_bit_for_bit(gpu: &Gpu) -> Result<(), Failure> {
    for source in [&product::SOURCE, &update::SOURCE] {
        let body = Body::new(source.name, [7, 8, 6], 8, 0, 5);
        let run = || parity::run_kernel(gpu, source, &body);
        let first = run()?;
        for _ in 0..3 {
            require(run()? == first, || format!("`{}` gave other bits", source.name))?;
        }
    }
    Ok(())
}

fn a_wrong_binding_says_which_names_are_known(gpu: &Gpu) -> Result<(), Failure> {
    let params = gpu.uniform("params", 16, &[0u32; 4]);
    let short = gpu.uniform("short", 0, &[0u32; 1]);
    let array = gpu.array::<V4<f32>>("array", 4)?;
    let update_params = gpu.uniform("params", 16, &[0u32; 4]);
    let good = [("params", &params), ("ids", &array), ("source", &array), ("picked", &array)];
    let known_names = "params, ids, source, picked";
    let mut unknown = good.to_vec();
    unknown.push(("sauce", &array));
    let fails = [
        ("picked", &good[..3], "no buffer was given for it"),
        ("sauce", &unknown[..], "the shader has no such variable"),
    ];
    for (wanted_name, list, wanted_problem) in fails {
        match gpu.bind(&gather::SOURCE, list) {
            Err(Error::Gpu(Failed::Binding { kernel: "gather", name, known, problem })) => {
                require(name == wanted_name && known == known_names && problem == wanted_problem, || {
                    format!("`{name}`: {problem} ({known})")
                })?;
            }
            other => {
                return Err(format!("{wanted_name}: {:?}", other.map(|_| "bound").map_err(|e| e.to_string())).into());
            }
        }
    }
    // 16 bytes where the shader's block has 144
    let names = ["scalars", "z", "w", "x", "p", "s", "r"];
    let mut list: Vec<(&str, &Buffer)> = names.iter().map(|n| (*n, &array)).collect();
    list.push(("params", &update_params));
    match gpu.bind(&update::SOURCE, &list) {
        Err(e @ Error::Gpu(Failed::Binding { .. })) => {
            let words = e.to_string();
            let all = [
                "`update`",
                "`params`",
                "has 16 bytes, 144 are needed",
                "params, scalars, z, w, x, p, s, r, partial_residual",
            ];
            require(all.iter().all(|part| words.contains(part)), || words)?;
        }
        _ => return Err("16 bytes were taken for 144".into()),
    }
    require(short.bytes == 16, || format!("a uniform has {} bytes", short.bytes))
}

fn a_too_large_array_names_itself_and_the_limit(gpu: &Gpu) -> Result<(), Failure> {
    let count = gpu.adapter.max_binding as usize / 16 + 1;
    match gpu.array::<V4<f32>>("partial_product", count) {
        Err(e @ Error::Gpu(Failed::TooLarge { bytes: need, limit, .. })) => {
            require(need > limit && need == count as u64 * 16, || format!("{need} for {limit}"))?;
            let words = e.to_string();
            let all = ["`partial_product`", "max_storage_buffer_binding_size", &need.to_string(), &limit.to_string()];
            require(all.iter().all(|part| words.contains(part)), || words)
        }
        Err(e) => Err(e.into()),
        Ok(_) => Err("it was made".into()),
    }
}

fn reading_past_an_array_is_refused(gpu: &Gpu) -> Result<(), Failure> {
    let array = gpu.array_of("array", &[1u32, 2, 3, 4])?;
    let read = std::panic::AssertUnwindSafe(|| gpu.read::<u32>(&array, 5).is_ok());
    require(std::panic::catch_unwind(read).is_err(), || "5 words came from an array of 4".into())
}

fn writing_past_an_array_is_an_error_at_the_next_read(gpu: &Gpu) -> Result<(), Failure> {
    let array = gpu.array_of("array", &[1u32, 2, 3, 4])?;
    gpu.write(&array, 16, &[5u32]);
    match gpu.read::<u32>(&array, 4) {
        Err(Error::Gpu(Failed::Device { .. })) => Ok(()),
        Err(e) => Err(e.into()),
        Ok(words) => Err(format!("no error; the array is {words:?}").into()),
    }
}

fn an_unknown_adapter_lists_those_there_are(gpu: &Gpu) -> Result<(), Failure> {
    match Gpu::open(Some("no such adapter")) {
        Err(Error::Gpu(Failed::NoAdapter { wanted, found, .. })) => {
            require(wanted.contains("no such adapter") && found.contains(&gpu.adapter.name), || {
                format!("{wanted}; {found}")
            })
        }
        Err(e) => Err(e.into()),
        Ok(_) => Err("it was opened".into()),
    }
}

/// `r·r` of a running right-hand side as `converge` sums it, and as f64 does; parts of 0.5 to 1.5.
fn summed(gpu: &Gpu, compensated: u32) -> Result<f64, Failure> {
    const NODES: u32 = 1 << 24;
    let parts: Vec<f32> =
        (0..NODES / GROUP).map(|k| 0.5 + (k.wrapping_mul(2_654_435_761) >> 8) as f32 / 16_777_216.0).collect();
    let exact: f64 = parts.iter().map(|p| f64::from(*p)).sum();
    let params = Params::<f32> { node_count: NODES, rhs_count: 1, compensated, ..Params::default() };
    let scalars = gpu.array_of("scalars", &[[1f32, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, 3.0]])?;
    let list = [
        ("params", &gpu.uniform("params", 0, &params.words())),
        ("partial_residual", &gpu.array_of("partial_residual", &parts)?),
        ("scalars", &scalars),
    ];
    let mut batch = gpu.batch();
    batch.run(&gpu.bind(&converge::SOURCE, &list)?, 1, 1);
    let found = f64::from(cast::<f32>(&gpu.submit_and_read(batch, &[(&scalars, 32)])?[0])[5]);
    Ok((found / exact - 1.0).abs())
}

fn compensated_sums_are_right_to_one_rounding(gpu: &Gpu) -> Result<(), Failure> {
    let (plain, kept) = (summed(gpu, 0)?, summed(gpu, 1)?);
    super::report(gpu, &format!("a sum of 262,144 parts is off by {plain:.1e}, compensated by {kept:.1e}"));
    require(kept <= f64::from(f32::EPSILON), || format!("compensated: off by {kept:e}"))?;
    require(plain > 2.0 * kept, || format!("plain sums are as good: {plain:e} and {kept:e}; nothing to compensate"))
}

/// Copies 65,536 values so many times, a pass each (the clear between them ends it); s busy and s by the wall clock.
fn timed(gpu: &Gpu, passes: usize) -> Result<(Option<f64>, f64), Failure> {
    let count = 1 << 16;
    let ids: Vec<u32> = (0..count as u32).collect();
    let out = gpu.array::<V4<f32>>("picked", count)?;
    let list = [
        ("params", &gpu.uniform("params", 16, &[count as u32, 0, 0, 0])),
        ("ids", &gpu.array_of("ids", &ids)?),
        ("source", &gpu.array::<V4<f32>>("source", count)?),
        ("picked", &out),
    ];
    let kernel = gpu.bind(&gather::SOURCE, &list)?;
    gpu.busy(gpu.batch())?; // what was before does not count
    let mut batch = gpu.batch();
    for _ in 0..passes {
        batch.clear(&out, 0, 16);
        batch.run(&kernel, count, 1);
    }
    let start = std::time::Instant::now();
    let busy = gpu.busy(batch)?;
    Ok((busy, start.elapsed().as_secs_f64()))
}

fn the_device_says_how_long_it_was_busy(gpu: &Gpu) -> Result<(), Failure> {
    require(timed(gpu, 4)?.0.is_none(), || "timed without being asked to".into())?;
    gpu.time_passes(true);
    let (busy, wall) = timed(gpu, 20)?;
    let Some(busy) = busy else {
        gpu.time_passes(false);
        return Ok(()); // an adapter without timestamps says nothing
    };
    require(busy > 0.0 && busy <= wall, || format!("busy for {busy} s of {wall} s"))?;
    let nothing = gpu.busy(gpu.batch())?;
    require(nothing == Some(0.0), || format!("{nothing:?} s for nothing"))?;
    let (beyond, _) = timed(gpu, 3000)?;
    require(beyond.is_none(), || format!("{beyond:?} s of more passes than there are timestamps"))?;
    let (again, _) = timed(gpu, 20)?;
    require(again.is_some_and(|s| s > 0.0), || format!("{again:?} s after too many passes"))?;
    gpu.time_passes(false);
    require(timed(gpu, 4)?.0.is_none(), || "goes on timing".into())
}

fn the_device_says_how_long_each_launch_took(gpu: &Gpu) -> Result<(), Failure> {
    let values = gpu.array::<V4<f32>>("source", 64)?;
    let list = [
        ("params", &gpu.uniform("params", 16, &[64u32, 0, 0, 0])),
        ("ids", &gpu.array::<u32>("ids", 64)?),
        ("source", &values),
        ("picked", &gpu.array::<V4<f32>>("picked", 64)?),
    ];
    let kernel = gpu.bind(&gather::SOURCE, &list)?;
    let launched = |count: usize| {
        let mut batch = gpu.batch();
        (0..count).for_each(|_| batch.run(&kernel, 64, 1));
        gpu.submit(batch);
        gpu.launch_times(gpu.batch())
    };
    require(launched(3)?.is_none(), || "timed without being asked to".into())?;
    gpu.time_launches(true);
    // more than a query set holds
    for count in [3, 3000] {
        let Some(times) = launched(count)? else {
            gpu.time_launches(false);
            return Ok(()); // an adapter without timestamps says nothing
        };
        require(times.len() == count && times.iter().all(|(name, s)| *name == "gather" && *s >= 0.0), || {
            format!("{} launches of {count}, {:?}", times.len(), times.first())
        })?;
        require(times.iter().any(|(_, s)| *s > 0.0), || "no launch took any time".into())?;
    }
    // passes are not split, so their number differs
    gpu.time_passes(true);
    let times = launched(3)?.ok_or("no timestamps")?;
    require(times.len() == 1, || format!("{} passes of one", times.len()))?;
    gpu.time_launches(false);
    require(launched(3)?.is_none(), || "goes on timing".into())
}
