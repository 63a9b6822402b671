"""Meshes that meshio writes, as `cutis mesh --json` reads them, and what cutis writes, as meshio reads it.

    python3 tests/cli/meshio_check.py CUTIS FOLDER

Ends with 1 and a line on what differs; prints a line for each file otherwise. Needs meshio 5 and numpy.
"""

import json
import subprocess
import sys
from pathlib import Path

import meshio
import numpy as np

CUTIS, FOLDER = sys.argv[1], Path(sys.argv[2])
SPACE = 1e-12  # relative: sums of a few hundred terms in f64
NARROW = 1e-6  # of formats that keep f32

def block(n, sheared):
    """A block of n x n x n cubes, each of five tetrahedra, mirrored in turn so that faces agree; and its points."""
    axis = np.linspace(0.0, 1.0, n + 1) ** 1.25
    z, y, x = np.meshgrid(axis, axis, axis, indexing="ij")
    points = np.stack([x + sheared * z, y, 2.0 * z], axis=-1).reshape(-1, 3)
    number = lambda i, j, k: (k * (n + 1) + j) * (n + 1) + i
    even = [(0, 1, 2, 4), (3, 2, 1, 7), (5, 4, 7, 1), (6, 7, 4, 2), (1, 2, 4, 7)]
    tets = []
    for k in range(n):
        for j in range(n):
            for i in range(n):
                corner = [number(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2)) for c in range(8)]
                odd = (i + j + k) % 2
                for tet in even:
                    ids = [corner[c ^ odd] for c in tet]
                    a, b, c, d = points[ids]
                    if np.dot(b - a, np.cross(c - a, d - a)) < 0:
                        ids[2], ids[3] = ids[3], ids[2]
                    tets.append(ids)
    return points, np.array(tets)

def skin(tets):
    """Faces of one tetrahedron alone, turned outward."""
    faces = {}
    for a, b, c, d in tets:
        for face in [(b, c, d), (a, d, c), (a, b, d), (a, c, b)]:
            faces.setdefault(tuple(sorted(face)), []).append(face)
    return np.array([one[0] for one in faces.values() if len(one) == 1])

def area(points, triangles):
    a, b, c = (points[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()

def volume(points, tets):
    a, b, c, d = (points[tets[:, k]] for k in range(4))
    return np.einsum("ij,ij->i", b - a, np.cross(c - a, d - a)).sum() / 6.0

def wrong(name, what, found, wanted):
    print(f"{name}: {what} is {found}, wanted {wanted}")
    sys.exit(1)

def near(name, what, found, wanted, slack):
    if not np.allclose(found, wanted, rtol=slack, atol=slack):
        wrong(name, what, found, wanted)

def cutis(*arguments):
    ran = subprocess.run([CUTIS, "mesh", *map(str, arguments), "--json"], capture_output=True, text=True)
    if ran.returncode != 0:
        wrong(arguments[0], "exit status", ran.returncode, f"0: {ran.stderr}")
    return json.loads(ran.stdout)

points, tets = block(4, 0.3)
faces = skin(tets)
tags = np.where(points[tets].mean(axis=1)[:, 2] > 1.0, 5, 3)
cells = [("triangle", faces), ("tetra", tets)]
on_cells = [np.full(len(faces), 9), tags]
solid = meshio.Mesh(points, cells, cell_data={"gmsh:physical": on_cells, "gmsh:geometrical": on_cells})
solid.field_data = {"side": np.array([9, 2]), "fat": np.array([3, 3]), "der mis": np.array([5, 3])}
solid41 = meshio.Mesh(points, cells, cell_data=solid.cell_data, field_data=solid.field_data)
# the entity that each point is in, which its writer asks for
solid41.point_data = {"gmsh:dim_tags": np.tile([3, 1], (len(points), 1))}
plain = meshio.Mesh(points, cells, cell_data={"region": on_cells})
used = np.unique(faces)
surface = meshio.Mesh(points[used], [("triangle", np.searchsorted(used, faces))])

# what meshio writes
forms = [
    ("gmsh22.msh", solid, "gmsh22", {"binary": False}),
    ("gmsh22b.msh", solid, "gmsh22", {"binary": True}),
    ("gmsh41.msh", solid41, "gmsh", {"binary": False}),
    ("gmsh41b.msh", solid41, "gmsh", {"binary": True}),
    ("vtk42.vtk", plain, "vtk42", {"binary": False}),
    ("vtk42b.vtk", plain, "vtk42", {"binary": True}),
    ("vtk51.vtk", plain, "vtk51", {"binary": False}),
    ("vtk51b.vtk", plain, "vtk51", {"binary": True}),
    ("ascii.vtu", plain, "vtu", {"binary": False}),
    ("binary.vtu", plain, "vtu", {"binary": True, "compression": None}),
    ("zlib.vtu", plain, "vtu", {"binary": True, "compression": "zlib"}),
    ("ascii.stl", surface, "stl", {"binary": False}),
    ("binary.stl", surface, "stl", {"binary": True}),
    ("ascii.ply", surface, "ply", {"binary": False}),
    ("binary.ply", surface, "ply", {"binary": True}),
    ("faces.obj", surface, "obj", {}),
]
for name, mesh, form, options in forms:
    path = FOLDER / name
    meshio.write(path, mesh, file_format=form, **options)
    found = cutis(path)
    narrow = NARROW if mesh is surface else SPACE
    is_solid = mesh is not surface
    counts = (found["points"], found["tetrahedra"], found["triangles"], found["components"], found["boundary"]["closed"])
    wanted = (len(mesh.points), len(tets) if is_solid else 0, len(faces), 1, True)
    if counts != wanted:
        wrong(name, "points, tetrahedra, triangles, components, closed", counts, wanted)
    near(name, "low", found["low"], mesh.points.min(axis=0), narrow)
    near(name, "high", found["high"], mesh.points.max(axis=0), narrow)
    near(name, "volume", found["volume"], volume(points, tets), narrow)
    near(name, "area", found["area"], area(points, faces), narrow)
    if found["defects"]:
        wrong(name, "defects", found["defects"], [])
    if is_solid and "gmsh41" not in name:
        regions = [(r["dimension"], r["tag"], r["cells"]) for r in found["regions"]]
        wanted = [(2, 9, len(faces)), (3, 3, int((tags == 3).sum())), (3, 5, int((tags == 5).sum()))]
        if regions != wanted:
            wrong(name, "regions", regions, wanted)
    if name.startswith("gmsh22") and [r["name"] for r in found["regions"]] != ["side", "fat", "der mis"]:
        wrong(name, "names", [r["name"] for r in found["regions"]], ["side", "fat", "der mis"])
    print(f"{name}: {found['points']} points, {found['tetrahedra']} tetrahedra, volume {found['volume']:.12g} read")

# what cutis writes
source = FOLDER / "gmsh22b.msh"
for name, options in [(n, o) for n in ("out.msh", "out.vtu", "out.stl", "out.ply", "out.obj") for o in ([], ["--text"])]:
    path = FOLDER / name
    # meshio 5.3 does not read numbers behind the list of a binary face, as regions are
    cutis(FOLDER / "binary.ply" if name == "out.ply" else source, "--out", path, *options)
    form = {"out.msh": "gmsh", "out.obj": "obj"}.get(name)
    mesh = meshio.read(path, file_format=form)
    is_solid = name in ("out.msh", "out.vtu")
    narrow = name == "out.stl"
    triangles = mesh.get_cells_type("triangle")
    if is_solid:
        if not np.array_equal(mesh.points, points):
            wrong(name, "points", "others", "the same bits")
        if not (np.array_equal(triangles, faces) and np.array_equal(mesh.get_cells_type("tetra"), tets)):
            wrong(name, "cells", "others", "the same")
        key = "gmsh:physical" if name == "out.msh" else "region"
        if not np.array_equal(mesh.get_cell_data(key, "tetra"), tags):
            wrong(name, "regions", "others", "the same")
    elif not np.allclose(mesh.points[triangles], points[faces], rtol=0, atol=NARROW if narrow else 0):
        wrong(name, "corners of triangles", "others", "the same")
    print(f"{name} {' '.join(options)}: read back by meshio")
print("all agree")
