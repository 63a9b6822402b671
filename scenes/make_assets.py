#!/usr/bin/env python3
"""Writes the scalpel and its paths (meshes/scalpel.obj, incision.csv, incision_shapes.csv), a dental
probe (meshes/dental_probe.obj, and its touching lines in meshes/dental_probe_lines.obj), and a suture needle
in its holder (meshes/needle.obj).

Plain Python 3, no packages, no input, no randomness: the same files on every run.

    python3 scenes/make_assets.py

Tool frame (mm): the grip is the origin, the blade lies in the x-z plane, its normal is +y.
The cutting edge rises at 45 degrees from the tip T to the heel H and faces the material in
front of it (+x, -z). The handle goes on along the same direction.

The probe bends in the x-z plane: from the tip, its lowest place, back along a hook to the shank and
the handle. Its lines run along the belly of the hook, the side that meets the skin.

The needle is three eighths of a circle in the x-z plane. The holder grips it at the origin; its tip is its
lowest place and points straight down.
"""

import csv
import math
from pathlib import Path

# --- scalpel, mm -----------------------------------------------------------------------------
TIP = (-12.0, 0.0, -14.0)  # T
HEEL = (-4.0, 0.0, -6.0)  # H
BLADE_WIDTH = 3.0  # edge to spine
BLADE_THICKNESS = 0.4
BEVEL_WIDTH = 0.6  # from the edge (no thickness) to the full thickness
POINT_LENGTH = 6.5  # along the edge, tip to full width
WEDGE_LENGTH = 2.0  # along the edge, tip to full thickness
SHANK_LENGTH = 2.0  # behind the heel, blunt, up to the handle
HANDLE_LENGTH = 45.0
HANDLE_WIDTH = 8.0  # in the blade plane
HANDLE_THICKNESS = 2.5  # along y
NECK_LENGTH = 7.0  # handle nose, from shank size to full size
# Blade and handle are two closed bodies. They do not overlap, so that inside and outside stay
# defined everywhere; the gap is too small to see.
GAP = 0.02

# --- dental probe, mm and degrees --------------------------------------------------------------
PROBE_TIP = (-8.0, 0.0, -16.0)
# From the tip on: pieces, length of each, rise of the first and of the last above the horizontal.
PROBE_RUNS = (
    (3, 0.5, 14.0, 20.0),  # point
    (7, 0.55, 28.0, 82.0),  # hook
    (2, 3.0, 82.0, 74.0),  # shank
    (2, 2.5, 66.0, 62.0),  # neck
    (1, 34.0, 62.0, 62.0),  # handle
)
# Radius of the steel after as many pieces; between two entries it grows evenly.
PROBE_RADII = ((0, 0.0), (3, 0.16), (10, 0.42), (12, 0.75), (14, 2.0), (15, 2.0))
PROBE_AROUND = 12  # facets around it
PROBE_HEADER = "# Dental probe, mm. Made by scenes/make_assets.py for the cutis project; edit the script, not this file."

# --- suture needle in its holder, mm and degrees --------------------------------------------------
NEEDLE_RADIUS = 8.0  # of the circle
NEEDLE_ARC = 135.0  # three eighths of a circle, from the tip at 0
NEEDLE_STEEL = 0.25  # radius of the wire
NEEDLE_POINT = 2.5  # length of the point along the arc
NEEDLE_PIECES = 27
NEEDLE_AROUND = 10  # facets around it
HOLDER = ((-1.0, 0.7), (0.6, 1.1), (9.0, 1.3), (12.0, 2.2), (45.0, 2.2))  # z and radius
NEEDLE_HEADER = "# Suture needle, mm. Made by scenes/make_assets.py for the cutis project; edit the script, not this file."

# --- path: mm, s, rad, Hz --------------------------------------------------------------------
RATE = 1000.0  # Hz
DURATION = 1.2  # s
SKIN_TOP = 2.3  # mm, z of the undeformed skin
START_X = -5.0  # mm, tip
START_Y = 0.05  # mm, tip; off the cell boundary at y = 0
START_HEIGHT = 1.5  # mm, tip above the skin
TOUCH_TIME = 0.09  # s, checked below
PRESS_DEPTH = 1.30  # mm below the undeformed top
SLICE_LENGTH = 10.0  # mm, along +x
LIFT_HEIGHT = 3.0  # mm, tip above the skin at the end
APPROACH_WINDOW = (0.0, 0.11)  # s; overlaps the next one, so the tip slows but never stops
PRESS_WINDOW = (0.04, 0.30)  # s
SLICE_WINDOW = (0.30, 0.90)  # s
LIFT_WINDOW = (0.90, 1.15)  # s
# Hand tremor of the tip: axis, amplitude mm, frequency Hz, phase rad.
TREMOR = (
    ("x", 0.008, 8.3, 0.4),
    ("x", 0.006, 11.2, 2.1),
    ("y", 0.009, 9.1, 1.3),
    ("y", 0.006, 10.7, 5.0),
    ("z", 0.007, 8.8, 3.6),
    ("z", 0.005, 11.9, 0.9),
)
# Wobble of the hand about y, about the tip: amplitude degrees, frequency Hz, phase rad.
WOBBLE = ((1.1, 1.3, 0.0), (0.4, 2.9, 1.7))
WOBBLE_WINDOW = (0.0, 0.2)  # s, fades in

# --- path of the shapes: mm, s, Hz -------------------------------------------------------------
SHAPES_RATE = 200.0  # Hz
SHAPES_DEPTH = 1.3  # mm below the undeformed top
SHAPES_LIFT = 2.0  # mm, tip above the skin between cuts
S_START, S_LENGTH, S_MIDDLE, S_HEIGHT = -5.0, 10.0, 4.0, 1.5  # along x; y of its middle, and how far it swings
CROSS_X, CROSS_Y = 0.37, (0.6, 7.4)  # a straight cut along y, across the S
FLAP_Z = 1.82  # tissue before the edge rises by up to 0.25 mm, so the dermis is parted 0.4 to 0.6 mm above its bottom, between its two rows of cells
FLAP_TIP_Y = -5.03
FLAP_X = (-16.0, -5.0)  # of the tip, before and after: far enough that the whole edge has cut
FLAP_LIFT = 1.2

HEADER = "# Scalpel, mm. Made by scenes/make_assets.py for the cutis project; edit the script, not this file."
AXES = ("x", "y", "z")


def section(width, thickness, middle, bevel=None):
    """Ring of 10 points (behind, y) around the tool's long axis, mm.

    `middle` is the distance of the ring's centre behind the edge line. With `bevel` the front is
    an edge without thickness and full thickness is reached `bevel` behind it; without, a flat bar
    with rounded sides.
    """
    front, back, half = middle - width / 2, middle + width / 2, thickness / 2
    if bevel is not None:
        step = (width - bevel) / 3
        side = [(front + bevel + i * step, half) for i in range(4)]
    else:
        round_ = min(0.16 * width, half)
        side = [
            (front + 0.3 * round_, 0.7 * half),
            (front + round_, half),
            (back - round_, half),
            (back - 0.3 * round_, 0.7 * half),
        ]
    mirrored = [(b, -y) for b, y in reversed(side)]
    return [(front, 0.0)] + side + [(back, 0.0)] + mirrored


def place(along, behind, y):
    """Point at `along` the edge from the tip and `behind` it, in the tool frame, mm."""
    r = math.sqrt(0.5)
    return (TIP[0] + r * (along - behind), TIP[1] + y, TIP[2] + r * (along + behind))


def sweep(start, rings, end):
    """Closed triangle mesh through `rings`, from the point `start` to the point `end`."""
    count = len(rings[0][1])
    points = [place(*start)]
    for along, ring in rings:
        points += [place(along, b, y) for b, y in ring]
    points.append(place(*end))
    first = [1 + r * count for r in range(len(rings))]
    last = len(points) - 1
    triangles = []
    for k in range(count):
        n = (k + 1) % count
        triangles.append((0, first[0] + k, first[0] + n))
        for r in range(len(rings) - 1):
            a, b = first[r] + k, first[r] + n
            c, d = first[r + 1] + k, first[r + 1] + n
            triangles += [(a, c, d), (a, d, b)]
        triangles.append((last, first[-1] + n, first[-1] + k))
    if volume(points, triangles) < 0:
        triangles = [(a, c, b) for a, b, c in triangles]
    return points, triangles


def volume(points, triangles):
    """Enclosed volume, mm3; positive for outward normals."""
    total = 0.0
    for a, b, c in triangles:
        (ax, ay, az), (bx, by, bz), (cx, cy, cz) = points[a], points[b], points[c]
        total += ax * (by * cz - bz * cy) + ay * (bz * cx - bx * cz) + az * (bx * cy - by * cx)
    return total / 6.0


def check_closed(name, points, triangles):
    """Every directed edge is met by its reverse exactly once, and normals point outward."""
    edges = set()
    for a, b, c in triangles:
        for edge in ((a, b), (b, c), (c, a)):
            assert edge not in edges, f"{name}: directed edge {edge} occurs twice"
            edges.add(edge)
    open_edges = [e for e in edges if (e[1], e[0]) not in edges]
    assert not open_edges, f"{name}: {len(open_edges)} edges without their reverse"
    assert volume(points, triangles) > 0, f"{name}: normals point inward"
    used = {i for t in triangles for i in t}
    assert used == set(range(len(points))), f"{name}: points without a triangle"


def blade():
    edge_length = math.dist(TIP, HEEL)
    rings = []
    for along in (WEDGE_LENGTH, 4.0, POINT_LENGTH, 9.0, edge_length):
        width = BLADE_WIDTH * min(1.0, along / POINT_LENGTH)
        rings.append((along, section(width, BLADE_THICKNESS, width / 2, BEVEL_WIDTH)))
    blunt = section(0.9 * BLADE_WIDTH, BLADE_THICKNESS, 0.5 * BLADE_WIDTH)
    for along in (edge_length + 0.4, edge_length + SHANK_LENGTH):
        rings.append((along, blunt))
    return sweep((0.0, 0.0, 0.0), rings, (edge_length + SHANK_LENGTH, 0.5 * BLADE_WIDTH, 0.0))


def handle():
    start = math.dist(TIP, HEEL) + SHANK_LENGTH + GAP
    middle = 0.5 * BLADE_WIDTH
    shape = (  # along from the handle's start mm, width and thickness as fractions
        (0.0, 0.45, 0.50),
        (0.5, 0.52, 0.72),
        (NECK_LENGTH / 2, 0.80, 0.95),
        (NECK_LENGTH, 1.0, 1.0),
        (0.6 * HANDLE_LENGTH, 1.0, 1.0),
        (HANDLE_LENGTH - 1.0, 1.0, 1.0),
        (HANDLE_LENGTH, 0.88, 0.6),
    )
    rings = [
        (start + along, section(w * HANDLE_WIDTH, t * HANDLE_THICKNESS, middle))
        for along, w, t in shape
    ]
    return sweep((start, middle, 0.0), rings, (start + HANDLE_LENGTH, middle, 0.0))


def write_scalpel(path):
    lines, base = [HEADER], 1
    for name, (points, triangles) in (("blade", blade()), ("handle", handle())):
        check_closed(name, points, triangles)
        lines.append(f"g {name}")
        lines += ["v " + " ".join(number(c) for c in p) for p in points]
        lines += [f"f {a + base} {b + base} {c + base}" for a, b, c in triangles]
        base += len(points)
        print(f"{name}: {len(triangles)} triangles, {volume(points, triangles):.2f} mm3")
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")


def probe_line():
    """Centre line from the tip to the handle's end, and the radius there, mm."""
    points, radii = [PROBE_TIP], [0.0]
    for pieces, length, first, last in PROBE_RUNS:
        for k in range(pieces):
            rise = math.radians(first + (last - first) * k / max(1, pieces - 1))
            x, _, z = points[-1]
            points.append((x + length * math.cos(rise), 0.0, z + length * math.sin(rise)))
            n = len(points) - 1
            after = next(i for i, entry in enumerate(PROBE_RADII) if entry[0] >= n)
            (start, small), (end, large) = PROBE_RADII[after - 1], PROBE_RADII[after]
            radii.append(small + (large - small) * (n - start) / (end - start))
    return points, radii


def across(points, k):
    """Unit vector across the line at its point k, in the x-z plane, towards the belly."""
    a, b = points[max(0, k - 1)], points[min(len(points) - 1, k + 1)]
    length = math.dist(a, b)
    return ((b[2] - a[2]) / length, 0.0, -(b[0] - a[0]) / length)


def tube(line, radii, around, aside):
    """Closed tube around a line in the x-z plane, a point at its first place if the radius is 0 there; `aside(k)` lies across it."""
    vertices, triangles = [line[0]], []
    rings = [k for k in range(len(line)) if radii[k] > 0.0]
    for k in rings:
        out = aside(k)
        for n in range(around):
            turn = 2.0 * math.pi * n / around
            a, b = radii[k] * math.cos(turn), radii[k] * math.sin(turn)
            vertices.append((line[k][0] + a * out[0], b, line[k][2] + a * out[2]))
    vertices.append(line[-1])
    last = len(vertices) - 1

    def at(ring, n):
        return 1 + ring * around + n % around

    for n in range(around):
        triangles.append((0, at(0, n), at(0, n + 1)))
        for ring in range(len(rings) - 1):
            a, b, c, d = at(ring, n), at(ring, n + 1), at(ring + 1, n), at(ring + 1, n + 1)
            triangles += [(a, c, d), (a, d, b)]
        triangles.append((last, at(len(rings) - 1, n + 1), at(len(rings) - 1, n)))
    if volume(vertices, triangles) < 0:
        triangles = [(a, c, b) for a, b, c in triangles]
    return vertices, triangles


def write_probe(shape, lines):
    points, radii = probe_line()
    vertices, triangles = tube(points, radii, PROBE_AROUND, lambda k: across(points, k))
    check_closed("probe", vertices, triangles)
    text = [PROBE_HEADER, "g probe"]
    text += ["v " + " ".join(number(c) for c in p) for p in vertices]
    text += [f"f {a + 1} {b + 1} {c + 1}" for a, b, c in triangles]
    shape.write_text("\n".join(text) + "\n", encoding="ascii", newline="\n")
    belly = [
        tuple(c + r * d for c, d in zip(p, across(points, k)))
        for k, (p, r) in enumerate(zip(points, radii))
    ]
    assert min(belly, key=lambda p: p[2]) == PROBE_TIP, "the tip is not the lowest place"
    text = [PROBE_HEADER.replace("probe, mm", "probe's touching lines, mm")]
    text += ["v " + " ".join(number(c) for c in p) for p in belly]
    text.append("l " + " ".join(str(k + 1) for k in range(len(belly))))
    lines.write_text("\n".join(text) + "\n", encoding="ascii", newline="\n")
    print(f"probe: {len(triangles)} triangles, {volume(vertices, triangles):.2f} mm3, {len(belly) - 1} lines")


def needle():
    """The needle from its tip on, and the holder."""
    line, radii, out = [], [], []
    for k in range(NEEDLE_PIECES + 1):
        angle = math.radians(NEEDLE_ARC * k / NEEDLE_PIECES)
        outward = (math.cos(angle), 0.0, math.sin(angle))
        line.append((NEEDLE_RADIUS * outward[0], 0.0, NEEDLE_RADIUS * (outward[2] - 1.0)))
        radii.append(NEEDLE_STEEL * min(1.0, NEEDLE_RADIUS * angle / NEEDLE_POINT))
        out.append(outward)
    holder = [(0.0, 0.0, z) for z, _ in HOLDER]
    bodies = [("needle", tube(line, radii, NEEDLE_AROUND, lambda k: out[k]))]
    bodies.append(("holder", tube(holder, [r for _, r in HOLDER], NEEDLE_AROUND, lambda k: (1.0, 0.0, 0.0))))
    assert min(line, key=lambda p: p[2]) == line[0], "the tip is not the lowest place"
    return line[0], bodies


def write_needle(path):
    tip, bodies = needle()
    lines, base = [NEEDLE_HEADER], 1
    for name, (points, triangles) in bodies:
        check_closed(name, points, triangles)
        lines.append(f"g {name}")
        lines += ["v " + " ".join(number(c) for c in p) for p in points]
        lines += [f"f {a + base} {b + base} {c + base}" for a, b, c in triangles]
        base += len(points)
    path.write_text("\n".join(lines) + "\n", encoding="ascii", newline="\n")
    print(f"needle: tip at {tip}, {base - 1} vertices")


def number(value):
    """8 significant digits, no negative zero."""
    return f"{0.0 if abs(value) < 1e-12 else value:.8g}"


def minimum_jerk(window, time):
    """0 before the window, 1 after; 10u^3 - 15u^4 + 6u^5 between (Flash and Hogan 1985)."""
    u = min(1.0, max(0.0, (time - window[0]) / (window[1] - window[0])))
    return u**3 * (10.0 + u * (6.0 * u - 15.0))


def tip_path(time):
    """Tip in the world, mm, without tremor; moves with overlapping windows add up."""
    x = START_X + SLICE_LENGTH * minimum_jerk(SLICE_WINDOW, time)
    height = START_HEIGHT * (1.0 - minimum_jerk(APPROACH_WINDOW, time))
    height -= PRESS_DEPTH * minimum_jerk(PRESS_WINDOW, time)
    height += (PRESS_DEPTH + LIFT_HEIGHT) * minimum_jerk(LIFT_WINDOW, time)
    return [x, START_Y, SKIN_TOP + height]


def pose(time):
    """Grip position, mm, and rotation (x, y, z, w): the tip stays on its path while the hand wobbles."""
    tip = tip_path(time)
    for axis, amplitude, frequency, phase in TREMOR:
        tip[AXES.index(axis)] += amplitude * math.sin(2.0 * math.pi * frequency * time + phase)
    degrees = sum(a * math.sin(2.0 * math.pi * f * time + p) for a, f, p in WOBBLE)
    angle = math.radians(degrees) * minimum_jerk(WOBBLE_WINDOW, time)
    c, s = math.cos(angle), math.sin(angle)
    turned = (c * TIP[0] + s * TIP[2], TIP[1], c * TIP[2] - s * TIP[0])
    grip = [tip[i] - turned[i] for i in range(3)]
    return grip + [0.0, math.sin(angle / 2.0), 0.0, math.cos(angle / 2.0)]


def write_incision(path):
    with path.open("w", encoding="ascii", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["time_s", "x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"])
        for i in range(round(DURATION * RATE) + 1):
            rows.writerow([number(v) for v in [i / RATE] + pose(i / RATE)])
    touch = next(i / RATE for i in range(1000) if tip_path(i / RATE)[2] <= SKIN_TOP)
    assert abs(touch - TOUCH_TIME) < 0.005, f"the tip touches at {touch} s, wanted {TOUCH_TIME} s"
    print(f"path: {round(DURATION * RATE) + 1} rows, touch at {touch:.3f} s")


def turned_by(q, v):
    """A vector turned by a quaternion (x, y, z, w)."""
    x, y, z, w = q
    t = [2.0 * (y * v[2] - z * v[1]), 2.0 * (z * v[0] - x * v[2]), 2.0 * (x * v[1] - y * v[0])]
    return [
        v[0] + w * t[0] + y * t[2] - z * t[1],
        v[1] + w * t[1] + z * t[0] - x * t[2],
        v[2] + w * t[2] + x * t[1] - y * t[0],
    ]


def s_curve(u):
    """Tip on the S at 0..1, mm, and the direction there, rad."""
    phase = 2.0 * math.pi * u
    slope = S_HEIGHT * 2.0 * math.pi / S_LENGTH * math.cos(phase)
    return (S_START + S_LENGTH * u, S_MIDDLE + S_HEIGHT * math.sin(phase)), math.atan(slope)


def shapes_keys():
    """(duration s, tip mm, turn about z rad, roll about x rad) of the path's corners; the S is longer than its ends."""
    over, under = SKIN_TOP + SHAPES_LIFT, SKIN_TOP - SHAPES_DEPTH
    (x, y), turn = s_curve(0.0)
    keys = [(0.0, (x, y, over), turn, 0.0), (0.2, (x, y, under), turn, 0.0)]
    (x, y), turn = s_curve(1.0)
    keys += [(0.8, (x, y, under), turn, 0.0), (0.15, (x, y, over), turn, 0.0)]
    right, (low, high) = math.pi / 2.0, CROSS_Y
    keys += [(0.2, (CROSS_X, low, over), right, 0.0), (0.15, (CROSS_X, low, under), right, 0.0)]
    keys += [(0.5, (CROSS_X, high, under), right, 0.0), (0.15, (CROSS_X, high, over), right, 0.0)]
    outside, inside = FLAP_X
    far = SKIN_TOP + 12.0  # room for the blade to roll over
    keys += [(0.25, (outside, FLAP_TIP_Y, far), 0.0, right), (0.15, (outside, FLAP_TIP_Y, FLAP_Z), 0.0, right)]
    keys += [(0.6, (inside, FLAP_TIP_Y, FLAP_Z), 0.0, right)]
    keys += [(0.25, (inside, FLAP_TIP_Y, FLAP_Z + FLAP_LIFT), 0.0, right)]
    return keys


def shapes_pose(time):
    """Grip position, mm, and rotation: each key is reached at rest; along the S the blade follows the curve."""
    keys = shapes_keys()
    start, number = 0.0, 1
    while number + 1 < len(keys) and time > start + keys[number][0]:
        start += keys[number][0]
        number += 1
    (_, tip, turn, roll), (duration, to_tip, to_turn, to_roll) = keys[number - 1], keys[number]
    u = minimum_jerk((start, start + duration), time)
    if number == 2:
        (x, y), turn = s_curve(u)
        tip = (x, y, tip[2])
    else:
        tip = [a + u * (b - a) for a, b in zip(tip, to_tip)]
        turn, roll = turn + u * (to_turn - turn), roll + u * (to_roll - roll)
    # about x, then about z
    cx, sx, cz, sz = math.cos(roll / 2), math.sin(roll / 2), math.cos(turn / 2), math.sin(turn / 2)
    rotation = [cz * sx, sz * sx, sz * cx, cz * cx]
    offset = turned_by(rotation, TIP)
    return [a - b for a, b in zip(tip, offset)] + rotation


def write_shapes(path):
    duration = sum(key[0] for key in shapes_keys())
    count = round(duration * SHAPES_RATE) + 1
    with path.open("w", encoding="ascii", newline="") as file:
        rows = csv.writer(file, lineterminator="\n")
        rows.writerow(["time_s", "x_mm", "y_mm", "z_mm", "qx", "qy", "qz", "qw"])
        for i in range(count):
            rows.writerow([number(v) for v in [i / SHAPES_RATE] + shapes_pose(i / SHAPES_RATE)])
    print(f"shapes: {count} rows, {duration:.2f} s")


def main():
    here = Path(__file__).resolve().parent
    (here / "meshes").mkdir(exist_ok=True)
    write_scalpel(here / "meshes" / "scalpel.obj")
    write_probe(here / "meshes" / "dental_probe.obj", here / "meshes" / "dental_probe_lines.obj")
    write_needle(here / "meshes" / "needle.obj")
    write_incision(here / "incision.csv")
    write_shapes(here / "incision_shapes.csv")


if __name__ == "__main__":
    main()
