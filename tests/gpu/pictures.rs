//! Pictures of the adapter against those of the rasteriser, of the same scene: a patch that was pressed and cut, with its tool.

use super::{Failure, report};
use cutis::gpu::Gpu;
use cutis::report::frames::{Look, Painter, SkinSurface, camera, tool_positions, with_surfaces};
use cutis::scene::{Scene, incision};
use cutis::step::{Platform, Simulation};
use cutis::view::{Camera, Clip, Drawn, Effort, Image, Renderer, Surface, render};
use glam::DVec3;

type Test = fn(&Gpu) -> Result<(), Failure>;

pub const TESTS: [(&str, Test); 5] = [
    ("a_run_on_an_adapter_draws_there", a_run_on_an_adapter_draws_there),
    ("a_picture_is_that_of_the_rasteriser", a_picture_is_that_of_the_rasteriser),
    ("a_picture_is_repeated_to_the_bit", a_picture_is_repeated_to_the_bit),
    ("a_clipping_plane_leaves_one_half", a_clipping_plane_leaves_one_half),
    ("what_cannot_be_drawn_is_counted_or_left_out", what_cannot_be_drawn_is_counted_or_left_out),
];

const SIZE: [u32; 2] = [480, 320];
/// Side of the blocks over which pictures are averaged, pixels: edges differ by a pixel, since there are 4 samples there and 16 here.
const BLOCK: usize = 16;
/// Largest mean difference of a channel: the rasteriser darkens hollows (ambient occlusion), and so a few pixels along edges and the blade;
/// half a percent here.
const MEAN: f64 = 0.01;
/// Largest difference of a block's mean, from 0 to 1. Occlusion takes a twentieth of a block beside the blade; another colour of a layer, or
/// no blade, changes one by 0.4 and more.
const OF_BLOCK: f64 = 0.1;

/// The incision on few cells, after its first cuts.
fn cut() -> Result<(Scene, Simulation), Failure> {
    let scene = incision()?.in_test_form();
    let mut simulation = Simulation::new(&scene, &Platform::Cpu64)?;
    let mut severed = 0;
    while severed < 4 {
        severed += simulation.step(false)?.severed;
        if simulation.time > 1.0 {
            return Err("nothing was cut".into());
        }
    }
    Ok((scene, simulation))
}

/// Draws, off-screen.
fn renderer(gpu: &Gpu) -> Result<Renderer, Failure> {
    let (_, (device, queue)) = gpu.adapter.request(&Default::default())?;
    Ok(Renderer::new(device, queue, Effort::Full))
}

/// What the rasteriser and the adapter draw of a state.
fn both(renderer: &mut Renderer, scene: &Scene, simulation: &mut Simulation) -> Result<[Image; 2], Failure> {
    let state = simulation.snapshots()?;
    let skin = SkinSurface::new(simulation, &state);
    let tools = tool_positions(scene, simulation);
    let camera = camera(scene);
    let drawn = with_surfaces(scene, &skin, &tools, &Look::default(), |bodies, tools| {
        renderer.load(&Drawn { clipped: bodies, whole: tools, in_front: &[] });
        render(&[bodies, tools].concat(), &camera, SIZE[0], SIZE[1], &[])
    })?;
    renderer.draw(&camera, SIZE, None);
    Ok([drawn, renderer.read()?])
}

/// Mean difference of a channel over a picture, and the largest over a block; both from 0 to 1.
fn difference(a: &Image, b: &Image) -> [f64; 2] {
    assert_eq!([a.width, a.height, b.width, b.height], [SIZE[0], SIZE[1], SIZE[0], SIZE[1]]);
    let (width, height) = (SIZE[0] as usize, SIZE[1] as usize);
    let mut blocks = vec![[0.0; 3]; (width / BLOCK) * (height / BLOCK)];
    let mut sum = 0.0;
    for (k, (x, y)) in a.rgb.iter().zip(&b.rgb).enumerate() {
        let (pixel, channel) = (k / 3, k % 3);
        let d = (f64::from(*x) - f64::from(*y)) / 255.0;
        sum += d.abs();
        let block = pixel / width / BLOCK * (width / BLOCK) + pixel % width / BLOCK;
        blocks[block][channel] += d / (BLOCK * BLOCK) as f64;
    }
    let largest = blocks.as_flattened().iter().map(|d: &f64| d.abs()).fold(0.0, f64::max);
    [sum / a.rgb.len() as f64, largest]
}

fn holds([mean, block]: [f64; 2]) -> bool {
    mean < MEAN && block < OF_BLOCK
}

fn a_picture_is_that_of_the_rasteriser(gpu: &Gpu) -> Result<(), Failure> {
    let (mut scene, mut simulation) = cut()?;
    let renderer = &mut renderer(gpu)?;
    let [drawn, picture] = both(renderer, &scene, &mut simulation)?;
    let found = difference(&drawn, &picture);
    report(gpu, &format!("pictures: mean {:.4} of {MEAN}, block {:.4} of {OF_BLOCK}", found[0], found[1]));
    if let Some(folder) = std::env::var_os("CUTIS_PICTURES").map(std::path::PathBuf::from) {
        for (name, image) in [("rasteriser.png", &drawn), ("adapter.png", &picture)] {
            let bytes = cutis::view::png(image).map_err(|e| e.to_string())?;
            std::fs::write(folder.join(name), bytes).map_err(|e| e.to_string())?;
        }
    }
    if !holds(found) {
        return Err(format!("mean and block differ by {found:?}").into());
    }
    // counter-tests: another colour of the outermost layer, and no tool
    let top = scene.skins[0].layers.iter_mut().last().ok_or("layers")?;
    let own = std::mem::replace(&mut top.color, [40, 120, 60]);
    let [_, other] = both(renderer, &scene, &mut simulation)?;
    scene.skins[0].layers.iter_mut().last().ok_or("layers")?.color = own;
    let of_color = difference(&drawn, &other);
    scene.tools[0].mesh.triangles.clear();
    let [_, other] = both(renderer, &scene, &mut simulation)?;
    let of_tool = difference(&drawn, &other);
    report(gpu, &format!("another colour: {of_color:.4?}, no tool: {of_tool:.4?}"));
    for (what, found) in [("another colour", of_color), ("no tool", of_tool)] {
        if found[1] < 3.0 * OF_BLOCK {
            return Err(format!("{what} is hardly seen: {found:?}").into());
        }
    }
    Ok(())
}

fn a_run_on_an_adapter_draws_there(gpu: &Gpu) -> Result<(), Failure> {
    let mut scene = incision()?.in_test_form();
    scene.view.size = SIZE;
    let (mut images, mut again) = (vec![], vec![]);
    for platform in [Platform::Cpu64, Platform::Gpu(Some(gpu.adapter.name.clone()))] {
        let mut simulation = Simulation::new(&scene, &platform)?;
        let mut painter = Painter::new(&scene, &simulation);
        for images in [&mut images, &mut again] {
            let report = simulation.step(false)?;
            let state = simulation.snapshots()?;
            let skin = SkinSurface::new(&simulation, &state);
            images.push(painter.draw(&scene, &simulation, &skin, &report)?);
        }
    }
    for of in [&images, &again] {
        let [of_cpu, of_gpu] = &of[..] else { return Err("two pictures".into()) };
        let found = difference(of_cpu, of_gpu);
        report(gpu, &format!("pictures of runs: {found:.4?}"));
        // it is not the rasteriser that has drawn both
        if !holds(found) || of_cpu == of_gpu {
            return Err(format!("mean and block differ by {found:?}").into());
        }
    }
    Ok(())
}

fn a_picture_is_repeated_to_the_bit(gpu: &Gpu) -> Result<(), Failure> {
    let (scene, mut simulation) = cut()?;
    let [_, first] = both(&mut renderer(gpu)?, &scene, &mut simulation)?;
    let renderer = &mut renderer(gpu)?;
    // after another size, and twice
    let camera = Camera { eye: [0.0, 0.0, 0.1], target: [0.0; 3], up: [0.0, 1.0, 0.0], field_of_view_deg: 30.0 };
    renderer.draw(&camera, [77, 31], None);
    for _ in 0..2 {
        let [_, again] = both(renderer, &scene, &mut simulation)?;
        if again != first {
            return Err(format!("other bytes, by {:?}", difference(&first, &again)).into());
        }
    }
    Ok(())
}

fn a_clipping_plane_leaves_one_half(gpu: &Gpu) -> Result<(), Failure> {
    let square = [[-0.01, -0.01, 0.0], [0.01, -0.01, 0.0], [0.01, 0.01, 0.0], [-0.01, 0.01, 0.0]];
    let colors = [[200, 30, 30]; 2];
    let surface = Surface {
        positions: &square,
        triangles: &[[0, 1, 2], [0, 2, 3]],
        colors: cutis::view::Paint::Triangles(&colors),
        smooth: false,
        outlines: &[],
        shininess: 10.0,
    };
    // from above, x to the right
    let camera = Camera { eye: [0.0, 0.0, 0.06], target: [0.0; 3], up: [0.0, 1.0, 0.0], field_of_view_deg: 30.0 };
    let clip = Some(Clip { normal: [2.0, 0.0, 0.0], offset: 0.004 });
    let renderer = &mut renderer(gpu)?;
    let red = |image: &Image, x: f64| {
        // x = 0.01 m is 0.01 / (0.06 tan 15°) of half the height
        let column = SIZE[0] as f64 / 2.0 + x / (0.06 * 15f64.to_radians().tan()) * SIZE[1] as f64 / 2.0;
        let k = 3 * (SIZE[1] as usize / 2 * SIZE[0] as usize + column as usize);
        u16::from(image.rgb[k]) > 2 * u16::from(image.rgb[k + 1])
    };
    renderer.load(&Drawn { clipped: &[surface], ..Default::default() });
    for (clip, wanted) in [(None, [true, true, true, true]), (clip, [false, false, false, true])] {
        renderer.draw(&camera, SIZE, clip);
        let image = renderer.read()?;
        let found = [-0.009, -0.001, 0.0015, 0.0025].map(|x| red(&image, x));
        if found != wanted {
            return Err(format!("{clip:?}: {found:?}, wanted {wanted:?}").into());
        }
    }
    // what is not to be clipped stays whole
    renderer.load(&Drawn { whole: &[surface], ..Default::default() });
    renderer.draw(&camera, SIZE, clip);
    let image = renderer.read()?;
    if red(&image, -0.009) { Ok(()) } else { Err("the plane has cut what it was to leave".into()) }
}

fn what_cannot_be_drawn_is_counted_or_left_out(gpu: &Gpu) -> Result<(), Failure> {
    let positions = [[0.0, 0.0, 0.0], [0.01, 0.0, 0.0], [0.0, 0.01, 0.0], [f64::NAN, 0.0, 0.0]];
    let surface = Surface {
        positions: &positions,
        triangles: &[[0, 1, 2], [0, 1, 3], [0, 1, 9]],
        colors: cutis::view::Paint::Triangles(&[]),
        smooth: true,
        outlines: &[],
        shininess: f64::NAN,
    };
    let renderer = &mut renderer(gpu)?;
    if !renderer.read()?.rgb.is_empty() {
        return Err("a picture before the first".into());
    }
    let skipped = renderer.load(&Drawn { clipped: &[surface], ..Default::default() });
    if skipped != 2 {
        return Err(format!("{skipped} triangles skipped, not 2").into());
    }
    // a camera without a direction sees the rasteriser's background
    let blind = Camera { eye: [0.0; 3], target: [0.0; 3], up: [0.0, 0.0, 1.0], field_of_view_deg: 30.0 };
    let far = Camera { eye: DVec3::MAX.to_array(), ..blind };
    for camera in [blind, far] {
        renderer.draw(&camera, SIZE, None);
        let found = difference(&render(&[], &blind, SIZE[0], SIZE[1], &[])?, &renderer.read()?);
        if found[0] > 2.0 / 255.0 {
            return Err(format!("the background differs by {found:?}").into());
        }
    }
    Ok(())
}
