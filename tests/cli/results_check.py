"""What a run saves, as meshio, trimesh and pygltflib read it.

    python3 tests/cli/results_check.py FOLDER

FOLDER is that of a run with all fields and formats of [output] and two pictures. Ends with 1 and a line on what differs. Needs meshio 5,
numpy, trimesh and pygltflib.
"""

import sys
from pathlib import Path

import meshio
import numpy as np
import pygltflib
import trimesh

FOLDER = Path(sys.argv[1])
NARROW = 1e-9  # m, f32 of 10 mm

def wrong(name, what, found, wanted):
    print(f"{name}: {what} is {found}, wanted {wanted}")
    sys.exit(1)

volume = meshio.read(FOLDER / "vtu/volume_0002.vtu")
surface = meshio.read(FOLDER / "vtu/surface_0002.vtu")
hexahedra = volume.get_cells_type("hexahedron")
triangles = surface.get_cells_type("triangle")
fields = {"stress_pa": (6,), "strain": (6,), "von_mises_pa": (), "alive_share": (), "layer": (), "body": ()}
for name, mesh, more in [("volume", volume, {}), ("surface", surface, {"wall": (), "color": (3,)})]:
    for key, shape in {**fields, **more}.items():
        found = mesh.cell_data[key][0]
        if found.shape[1:] != shape or not np.isfinite(found).all():
            wrong(name, key, found.shape, shape)
    for key in ["displacement_m", "velocity_m_s"]:
        if mesh.point_data[key].shape != mesh.points.shape:
            wrong(name, key, mesh.point_data[key].shape, mesh.points.shape)

# von Mises of the tensor's eigenvalues
xx, yy, zz, xy, yz, zx = volume.cell_data["stress_pa"][0].T
tensors = np.stack([xx, xy, zx, xy, yy, yz, zx, yz, zz], axis=-1).reshape(-1, 3, 3)
a, b, c = np.linalg.eigvalsh(tensors).T
invariant = np.sqrt(0.5 * ((a - b) ** 2 + (b - c) ** 2 + (c - a) ** 2))
if not np.allclose(invariant, volume.cell_data["von_mises_pa"][0], rtol=1e-9, atol=1e-6):
    wrong("volume", "von Mises stress", "other", "that of the eigenvalues")

# the surface is closed
wanted = trimesh.Trimesh(surface.points, triangles, process=False)
if not wanted.is_watertight:
    wrong("surface", "closed", False, True)
files = {
    "obj": trimesh.load(FOLDER / "surface/surface_0002.obj", process=False, force="mesh"),
    "stl": trimesh.load(FOLDER / "surface/surface_0002.stl", process=False),
}
for ending, mesh in files.items():
    if not np.allclose(mesh.triangles, surface.points[triangles], rtol=0, atol=NARROW):
        wrong(ending, "triangles", "others", "those of the VTU file")
scene = trimesh.load(FOLDER / "surface/surface_0002.glb", process=False)
# the node turns z up to y up
upright = surface.points[:, [0, 2, 1]] * [1, 1, -1]
turn, _ = scene.graph.get("bodies")
found = scene.geometry["bodies"].triangles @ turn[:3, :3].T + turn[:3, 3]
if not np.allclose(found, upright[triangles], rtol=0, atol=1e-8):
    wrong("glb", "triangles", "others", "those of the VTU file, upright")
gltf = pygltflib.GLTF2().load(str(FOLDER / "surface/surface_0002.glb"))
names = [node.name for node in gltf.nodes]
if names != ["bodies", "tip"]:
    wrong("glb", "names", names, ["bodies", "tip"])
for mesh in gltf.meshes:
    attributes = mesh.primitives[0].attributes
    if attributes.COLOR_0 is None or gltf.accessors[attributes.COLOR_0].count != gltf.accessors[attributes.POSITION].count:
        wrong("glb", "colours", attributes.COLOR_0, "one per vertex")
    low, high = gltf.accessors[attributes.POSITION].min, gltf.accessors[attributes.POSITION].max
    if len(low) != 3 or any(a > b for a, b in zip(low, high)):
        wrong("glb", "bounds", (low, high), "a box")
tools = meshio.read(FOLDER / "vtu/tools_0002.vtu")
if len(tools.get_cells_type("triangle")) != 4:
    wrong("tools", "triangles", len(tools.get_cells_type("triangle")), 4)
contacts = meshio.read(FOLDER / "vtu/contacts_0002.vtu")
force = contacts.point_data["force_n"]
if len(contacts.points) == 0 or force.shape != contacts.points.shape or not force[:, 2].sum() > 0:
    wrong("contacts", "force", force, "one that lifts the tip")
print(f"{len(hexahedra)} hexahedra, {len(triangles)} triangles, volume {wanted.volume:.6g} m3")
print("all agree")
