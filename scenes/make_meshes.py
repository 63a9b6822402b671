#!/usr/bin/env python3
"""Writes the skin of scenes/skin_tetra.toml as Gmsh files of three sizes: meshes/skin_coarse.msh, skin_middle.msh,
skin_fine.msh; the surface of scenes/pad.toml: meshes/pad.obj; and those of scenes/verify/bar_aslant.toml and cook.toml: meshes/bar_aslant.obj, cook.obj.

Plain Python 3, no packages, no input, no randomness: the same files on every run.

    python3 scenes/make_meshes.py
    python3 scenes/make_meshes.py --pad 24 FILE.msh     the pad as tetrahedra, 24 cells across, to compare with

The pad: a box bent to a cushion of 16 x 12 x 8 mm, with round corners and a top that is 3 mm lower at its rim.

The bar: 3 x 3 x 12 mm, turned by 30 degrees about y. Cook's membrane: a tapered panel, 2 mm thick.

The skin: a box of 20 x 20 x 2.3 mm with its corner at the origin, as Gmsh's box has it; version 2.2, text. Physical groups: the
volume `skin`; its faces `bottom`, `top` and `sides`.

Nodes of a raster are moved by up to a fifth of its width, on faces within them, on edges along them. Each cell becomes six
tetrahedra from its corner of the lowest rank; the faces opposite are halved by the diagonal of theirs. Ranks are
mixed, so that neighbours are split in different ways and no direction is preferred.
"""

from itertools import product
from pathlib import Path
import math
import sys

SIZE = (20.0, 20.0, 2.3)  # mm
PAD = (16.0, 12.0, 8.0)  # mm
ROUND = 0.35  # of the pad's corners: 0 none, 0.5 an ellipse
DROP = 3.0  # mm, of its top at the middle of its sides
BAR = (3.0, 3.0, 12.0)  # mm
TURNED = math.radians(30.0)  # of the bar about y
SIZES = {"coarse": (8, 8, 2), "middle": (12, 12, 3), "fine": (16, 16, 4)}  # cells
JITTER = 0.2  # largest move of a node along an axis, widths of a cell
# Corners around each face of a cell, counter-clockwise from outside; a corner has the bits x, y, z.
FACES = ((0, 4, 6, 2), (1, 3, 7, 5), (0, 1, 5, 4), (2, 6, 7, 3), (0, 2, 3, 1), (4, 5, 7, 6))
GROUPS = ((2, 2, "bottom"), (2, 3, "top"), (2, 4, "sides"), (3, 1, "skin"))  # dimension, number, name


def mixed(*numbers):
    """A number from 0 to 1 that follows from others as if by chance (a multiplicative hash of 32 bits)."""
    state = 0x9E3779B9
    for number in numbers:
        state = (state ^ number) * 0x85EBCA6B % 2**32
        state = (state ^ state >> 13) * 0xC2B2AE35 % 2**32
        state ^= state >> 16
    return state / 2**32


def volume(points):
    """Six times the signed volume of a tetrahedron."""
    a, b, c = ([q - p for p, q in zip(points[0], other)] for other in points[1:])
    return (
        a[0] * (b[1] * c[2] - b[2] * c[1]) + a[1] * (b[2] * c[0] - b[0] * c[2]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    )


def halves(face, rank):
    """A face as two triangles from its node of the lowest rank."""
    start = min(range(4), key=lambda k: rank[face[k]])
    a, b, c, d = (face[(start + k) % 4] for k in range(4))
    return (a, b, c), (a, c, d)


def box(at):
    """A place of the skin, mm, by its shares of the edges."""
    return [size * share for size, share in zip(SIZE, at)]


def cushion(at):
    """The same of the pad."""
    x, y = 2 * at[0] - 1, 2 * at[1] - 1
    low = DROP * (x * x + y * y - x * x * y * y) / PAD[2]
    return [
        0.5 * PAD[0] * x * (1 - ROUND * y * y) ** 0.5,
        0.5 * PAD[1] * y * (1 - ROUND * x * x) ** 0.5,
        PAD[2] * at[2] * (1 - low),
    ]


def aslant(at):
    """The same of the bar."""
    x, y, z = (size * (share - 0.5) for size, share in zip(BAR, at))
    return [x * math.cos(TURNED) + z * math.sin(TURNED), y, z * math.cos(TURNED) - x * math.sin(TURNED)]


def tapered(at):
    """The same of Cook's membrane, 48 mm long, 44 mm high where it is clamped and 16 where it is sheared."""
    return [48.0 * (at[0] - 0.5), 2.0 * (at[1] - 0.5), 44.0 * at[0] + (44.0 - 28.0 * at[0]) * at[2]]


def mesh(cells, place, jitter):
    """Points, tetrahedra, and triangles of the faces with their group, of a box that is bent by `place`."""
    counts = [n + 1 for n in cells]
    number = {at: k for k, at in enumerate(product(*map(range, counts)))}
    points, rank = [], []
    for at, k in number.items():
        inner = (0 < i < n for i, n in zip(at, cells))
        moves = (jitter * (2 * mixed(k, axis) - 1) * free for axis, free in enumerate(inner))
        points.append(place([(i + move) / n for i, move, n in zip(at, moves, cells)]))
        rank.append((mixed(k, 3), k))
    tetrahedra, triangles = [], []
    for cell in product(*map(range, cells)):
        corner = [number[tuple(i + (a >> axis & 1) for axis, i in enumerate(cell))] for a in range(8)]
        apex = min(corner, key=lambda k: rank[k])
        for side, face in enumerate(FACES):
            nodes = [corner[a] for a in face]
            axis, upper = side // 2, side % 2
            if cell[axis] == (cells[axis] - 1 if upper else 0):
                group = (2, 3)[upper] if axis == 2 else 4
                triangles += [(group, half) for half in halves(nodes, rank)]
            if apex not in nodes:
                # the face is seen from outside, so the apex is on its other side
                tetrahedra += [(apex, *half) for half in halves(nodes, rank)]
    least = min(volume([points[k] for k in nodes]) for nodes in tetrahedra)
    assert least > 0, f"a tetrahedron is inverted: {least}"
    return points, tetrahedra, triangles


def msh(points, tetrahedra, triangles):
    """Text of a Gmsh file; its nodes and cells count from 1."""
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(GROUPS))]
    lines += [f'{dimension} {tag} "{name}"' for dimension, tag, name in GROUPS]
    lines += ["$EndPhysicalNames", "$Nodes", str(len(points))]
    lines += [" ".join([str(k + 1), *(f"{c:.4f}".rstrip("0").rstrip(".") for c in at)]) for k, at in enumerate(points)]
    lines += ["$EndNodes", "$Elements", str(len(triangles) + len(tetrahedra))]
    cells = [(2, group, nodes) for group, nodes in triangles] + [(4, 1, nodes) for nodes in tetrahedra]
    for k, (kind, group, nodes) in enumerate(cells):
        lines.append(" ".join(map(str, [k + 1, kind, 2, group, group, *(n + 1 for n in nodes)])))
    return "\n".join(lines + ["$EndElements"]) + "\n"


def obj(scene, points, triangles):
    """Text of a Wavefront OBJ file of the triangles and their points, and of the scene that it is for."""
    used = sorted({k for _, nodes in triangles for k in nodes})
    number = {k: n + 1 for n, k in enumerate(used)}
    lines = [f"# surface of scenes/{scene}.toml, mm, by make_meshes.py"]
    lines += ["v " + " ".join(f"{c:.4f}".rstrip("0").rstrip(".") for c in points[k]) for k in used]
    return "\n".join(lines + ["f " + " ".join(str(number[k]) for k in nodes) for _, nodes in triangles]) + "\n"


def pad(across):
    """The pad with this many cells along its longest edge."""
    return mesh([max(1, round(across * size / PAD[0])) for size in PAD], cushion, 0.0)


def main():
    if sys.argv[1:2] == ["--pad"]:
        Path(sys.argv[3]).write_text(msh(*pad(int(sys.argv[2]))))
        return
    folder = Path(__file__).parent / "meshes"
    for name, cells in SIZES.items():
        made = mesh(cells, box, JITTER)
        path = folder / f"skin_{name}.msh"
        path.write_text(msh(*made))
        print(f"{path.name}: {len(made[0])} nodes, {len(made[1])} tetrahedra")
    surfaces = {
        "pad": ("pad", pad(24)),
        "bar_aslant": ("verify/bar_aslant", mesh((1, 1, 4), aslant, 0.0)),
        "cook": ("verify/cook", mesh((1, 1, 1), tapered, 0.0)),
    }
    for name, (scene, (points, _, triangles)) in surfaces.items():
        (folder / f"{name}.obj").write_text(obj(scene, points, triangles))
        print(f"{name}.obj: {len(triangles)} triangles")


if __name__ == "__main__":
    main()
