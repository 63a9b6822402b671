//! Mesh files of two million tetrahedra: time to read them, against the time to read the bytes alone, and the peak of memory, against what
//! the file and the mesh take. Each mesh that is read is compared with the one that was written first, bit for bit. Prints the table of
//! `benches/results/two_cores/mesh.md`.

use cutis::formats::{Cell, Encoding, Format, Mesh, parse, read, write};
use std::hint::black_box;
use std::time::Instant;

/// Cubes along an edge of the block, six tetrahedra each.
const CUBES: u32 = 70;
/// Readings of each file; their median counts.
const ROUNDS: usize = 5;

fn block() -> Mesh {
    let n = CUBES;
    let mut mesh = Mesh::default();
    for z in 0..=n {
        for y in 0..=n {
            // thirds have all their digits
            mesh.points.extend((0..=n).map(|x| [x, y, z].map(|k| f64::from(k) / 3.0)));
        }
    }
    let id = |x: u32, y: u32, z: u32| (z * (n + 1) + y) * (n + 1) + x;
    for z in 0..n {
        for y in 0..n {
            for x in 0..n {
                let corners = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]];
                let nodes = corners.map(|[i, j, k]: [u32; 3]| id(x + i, y + j, z + k));
                mesh.add(Cell::Hexahedron, &nodes, 1 + (z / 10) as i32);
            }
        }
    }
    mesh.others.clear();
    mesh
}

/// Bytes that the arrays of a mesh take.
fn bytes(mesh: &Mesh) -> usize {
    24 * mesh.points.len() + 20 * mesh.tetrahedra.len() + 16 * mesh.triangles.len()
}

fn median(mut times: Vec<f64>) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn main() {
    let solid = block();
    let (triangles, triangle_regions): (Vec<_>, Vec<_>) =
        solid.tetrahedra.iter().take(1_000_000).map(|t| ([t[0], t[1], t[2]], 0)).unzip();
    // through a file, which has the points in use alone
    let surface = Mesh { points: solid.points.clone(), triangles, triangle_regions, ..Mesh::default() };
    let file = write(&surface, Format::Ply, Encoding::Binary, "a.ply".as_ref()).expect("it is written");
    let surface = parse(&file, Format::Ply, "a.ply".as_ref(), &mut |_| {}).expect("it reads back");
    drop(file);
    println!("{} points, {} tetrahedra; median of {ROUNDS}\n", solid.points.len(), solid.tetrahedra.len());
    println!("| file | MB | s | MB/s | of reading its bytes alone | peak of memory, file + mesh = 1 |");
    println!("|---|---|---|---|---|---|");
    let folder = std::env::temp_dir();
    let forms = [
        ("msh 2.2, text", Format::Msh, Encoding::Text, &solid),
        ("msh 2.2, binary", Format::Msh, Encoding::Binary, &solid),
        ("vtu, text", Format::Vtu, Encoding::Text, &solid),
        ("vtu, base64", Format::Vtu, Encoding::Binary, &solid),
        ("ply, text, 1 million triangles", Format::Ply, Encoding::Text, &surface),
        ("ply, binary, 1 million triangles", Format::Ply, Encoding::Binary, &surface),
        ("obj, 1 million triangles", Format::Obj, Encoding::Text, &surface),
        ("stl, text, 1 million triangles", Format::Stl, Encoding::Text, &surface),
        ("stl, binary, 1 million triangles", Format::Stl, Encoding::Binary, &surface),
    ];
    for (name, format, encoding, mesh) in forms {
        let path = folder.join(format!("cutis_mesh_{}.{}", std::process::id(), format.ending()));
        let file = write_form(mesh, format, encoding, &path);
        let mut found = None;
        let held = allocation_counter::measure(|| found = Some(read(&path, &mut |_| {}).expect("it reads back")));
        let found = found.expect("it was read");
        match format {
            // corners are compared: STL has no points
            Format::Stl => assert_eq!(corners(&found, |c| c), corners(mesh, narrow(encoding)), "{name}"),
            _ => assert!(found == *mesh, "{name}: another mesh"),
        }
        let (mut raw, mut whole) = (vec![], vec![]);
        for _ in 0..ROUNDS {
            let timed = |run: &mut dyn FnMut()| {
                let start = Instant::now();
                run();
                start.elapsed().as_secs_f64()
            };
            raw.push(timed(&mut || drop(black_box(std::fs::read(&path).expect("it is there")))));
            whole.push(timed(&mut || drop(black_box(read(&path, &mut |_| {}).expect("it reads back")))));
        }
        let (raw, whole) = (median(raw), median(whole));
        let megabytes = file as f64 * 1e-6;
        let memory = held.bytes_max as f64 / (file + bytes(&found)) as f64;
        let rate = megabytes / whole;
        println!("| {name} | {megabytes:.0} | {whole:.2} | {rate:.0} | {:.0} × | {memory:.2} |", whole / raw);
        std::fs::remove_file(&path).expect("it is there");
    }
}

/// Writes a file; its length.
fn write_form(mesh: &Mesh, format: Format, encoding: Encoding, path: &std::path::Path) -> usize {
    let bytes = write(mesh, format, encoding, path).expect("it is written");
    std::fs::write(path, &bytes).expect("the folder for temporary files takes it");
    bytes.len()
}

fn narrow(encoding: Encoding) -> fn(f64) -> f64 {
    if encoding == Encoding::Text { |c| c } else { |c| f64::from(c as f32) }
}

fn corners(mesh: &Mesh, to: fn(f64) -> f64) -> Vec<[[f64; 3]; 3]> {
    mesh.triangles.iter().map(|ids| ids.map(|id| mesh.points[id as usize].map(to))).collect()
}
