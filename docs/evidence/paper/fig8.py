"""Fig. 8: an orbit MR image and the meshes made from it in the same frame: the phantom, or the study that EMMETROPE_STUDY names."""
import gzip
import json
import math
import os
import struct

from paper import command, here, patient, png

colours = {"cornea_anterior": (1.0, 0.8, 0.0), "cornea_posterior": (1.0, 0.4, 0.0), "lens_anterior": (0.1, 1.0, 0.2),
           "lens_posterior": (0.0, 0.7, 1.0), "retina": (1.0, 0.1, 0.2)}


def nifti(file):
    """Size, voxel values and the rows of voxel-to-RAS of a stack."""
    raw = gzip.decompress(file.read_bytes())
    size = struct.unpack_from("<8h", raw, 40)[1:4]
    code = {2: "B", 4: "h", 512: "H", 8: "i", 16: "f", 64: "d"}[struct.unpack_from("<h", raw, 70)[0]]
    offset = int(struct.unpack_from("<f", raw, 108)[0])
    values = struct.unpack_from(f"<{size[0] * size[1] * size[2]}{code}", raw, offset)
    return size, values, [struct.unpack_from("<4f", raw, 280 + 16 * i) for i in range(3)]


def ply(file):
    """Vertices (LPS) and triangles of a binary PLY of doubles."""
    raw = file.read_bytes()
    end = raw.index(b"end_header\n") + 11
    header = raw[:end].decode().split("\n")
    count = {line.split()[1]: int(line.split()[2]) for line in header if line.startswith("element")}
    kinds = [line.split()[1] for line in header if line.startswith("property") and "list" not in line]
    record = struct.Struct("<" + "".join({"double": "d", "float64": "d", "float": "f", "float32": "f"}[k] for k in kinds))
    vertices = [record.unpack_from(raw, end + i * record.size)[:3] for i in range(count["vertex"])]
    at = end + count["vertex"] * record.size
    return vertices, [struct.unpack_from("<3i", raw, at + 13 * i + 1) for i in range(count["face"])]


def inverse(rows):
    """Voxel from RAS."""
    (a, b, c, x), (d, e, g, y), (h, i, k, z) = rows
    det = a * (e * k - g * i) - b * (d * k - g * h) + c * (d * i - e * h)
    m = [[(e * k - g * i) / det, (c * i - b * k) / det, (b * g - c * e) / det],
         [(g * h - d * k) / det, (a * k - c * h) / det, (c * d - a * g) / det],
         [(d * i - e * h) / det, (b * h - a * i) / det, (a * e - b * d) / det]]
    return lambda p: [sum(r[q] * (p[q] - (x, y, z)[q]) for q in range(3)) for r in m]


def edge_distance(part, point, middle, pixel):
    """How far, mm, the image's edge (half way from the vitreous to what lies behind it) is outside a point of the retina's mesh; both in
    pixels of the part. None where the vitreous does not end within 2 mm."""
    length = math.hypot(point[0] - middle[0], point[1] - middle[1])
    outward = [(point[c] - middle[c]) / length for c in (0, 1)]
    def value(mm):
        x, y = (point[c] + outward[c] * mm / pixel for c in (0, 1))
        i, j = math.floor(x), math.floor(y)
        if not (0 <= i < len(part[0]) - 1 and 0 <= j < len(part) - 1):
            return 0
        u, v = x - i, y - j
        return (1 - v) * ((1 - u) * part[j][i] + u * part[j][i + 1]) + v * ((1 - u) * part[j + 1][i] + u * part[j + 1][i + 1])
    inside = sum(value(-mm) for mm in (2, 2.5, 3)) / 3
    outside = min(value(0.1 * step) for step in range(21))
    steps = [0.1 * step for step in range(-20, 20)]
    return next((mm for mm in steps if value(mm) > (inside + outside) / 2 >= value(mm + 0.1)), None)


def figure(f):
    case = patient(f, os.environ.get("EMMETROPE_STUDY"))
    eye = "od" if (case / "meshing" / "od" / "retina.ply").exists() else "os"
    meshes = {name: ply(case / "meshing" / eye / f"{name}.ply") for name in colours}
    def middle(name):
        vertices = meshes[name][0]
        return [sum(v[k] for v in vertices) / len(vertices) for k in range(3)]
    front, globe = middle("cornea_anterior"), middle("retina")
    # the stack whose slices run most nearly along the eye's axis
    fit = json.loads((case / "segmentation" / eye / "fit.json").read_text())
    # where the head lay in each stack: the meshes stand where it lay in the first
    shift = {stack["name"]: stack["shift_lps_mm"] for stack in fit["stacks"]}
    best = None
    for file in sorted((case / "segmentation").glob("stack?.nii.gz")):
        stack = file.name.split(".")[0]
        if stack not in shift:
            continue
        size, values, rows = nifti(file)
        from_ras = inverse(rows)
        to_voxel = lambda p, from_ras=from_ras, shift=shift[stack]: from_ras([shift[0] - p[0], shift[1] - p[1], p[2] - shift[2]])
        at, ahead = (to_voxel(p) for p in (globe, front))
        pixel = sum(r[0] ** 2 for r in rows) ** 0.5
        across = abs(at[2] - ahead[2])
        if all(0 <= p[k] < size[k] for p in (at, ahead) for k in range(3)) and (best is None or across < best[0]):
            k = round((at[2] + ahead[2]) / 2)
            best = (across, pixel, file.name, size, values, to_voxel, k, [(p + q) / 2 for p, q in zip(at, ahead)])
    _, pixel, name, size, values, to_voxel, k, at = best
    half, scale = int(20 / pixel), 4
    i0, j0 = max(0, round(at[0]) - half), max(0, round(at[1]) - half)
    i1, j1 = min(size[0], i0 + 2 * half), min(size[1], j0 + 2 * half)
    part = [[values[(k * size[1] + j) * size[0] + i] for i in range(i0, i1)] for j in range(j0, j1)]
    top = sorted(v for row in part for v in row)[int(0.995 * (i1 - i0) * (j1 - j0))]
    rows = [[(min(1.0, max(0.0, part[j // scale][i // scale] / top)) ** 2.2,) * 3 for i in range(scale * (i1 - i0))]
            for j in range(scale * (j1 - j0))]
    png(f.path("image.png"), rows)
    points, distances = 0, []
    (xf, yf, _), (xg, yg, _) = (to_voxel(p) for p in (front, globe))
    # the globe's middle, half way between its ends
    globe_middle = [(xf + xg) / 2 - i0, (yf + yg) / 2 - j0]
    for surface, (vertices, triangles) in meshes.items():
        voxels = [to_voxel(v) for v in vertices]
        for triangle in triangles:
            cut = []
            for a, b in ((0, 1), (1, 2), (2, 0)):
                p, q = voxels[triangle[a]], voxels[triangle[b]]
                if (p[2] - k) * (q[2] - k) < 0:
                    t = (k - p[2]) / (q[2] - p[2])
                    cut.append([p[c] + t * (q[c] - p[c]) for c in (0, 1)])
            if len(cut) != 2:
                continue
            points += 1
            if surface == "retina":
                distances.append(edge_distance(part, [(cut[0][c] + cut[1][c]) / 2 - (i0, j0)[c] for c in (0, 1)], globe_middle, pixel))
            for s in range(21):
                x, y = (scale * (cut[0][c] + s / 20 * (cut[1][c] - cut[0][c]) - (i0, j0)[c] + 0.5) for c in (0, 1))
                if 0 <= x < len(rows[0]) and 0 <= y < len(rows):
                    rows[int(y)][int(x)] = colours[surface]
    png(f.path("meshes.png"), rows)
    across, down = xf - xg, yf - yg
    side = ("on the left" if across < 0 else "on the right") if abs(across) > abs(down) else ("at the top" if down < 0 else "at the bottom")
    f.sheet("fig8.png", 2, 420, ("image.png", f"slice along the axis, {name.split('.')[0]}, front of the eye {side}"),
            ("meshes.png", "the meshes in the same frame"))
    found = sorted(abs(d) for d in distances if d is not None)
    f.number("share of the retina's mesh with an edge of the image within 2 mm", len(found) / len(distances), 0.7)
    f.number("the image's edge from the retina's mesh, median distance, mm", found[len(found) // 2], 0, 0.25)
    f.number(f"pieces of mesh in the slice of {name} along the axis", points, 50)
    biometry = json.loads((case / "meshing" / eye / "biometry.json").read_text())
    length = biometry["axial_length_mm"]
    if "EMMETROPE_STUDY" not in os.environ:
        truth = json.loads((here.parent.parent / "data_samples" / "sample" / "truth.json").read_text())
        true = truth[eye]["axial_length_mm"] if eye in truth else truth["eyes"][eye]["axial_length_mm"]
        f.number("axial length less the phantom's true one, mm", length["value"] - true, -0.1, 0.1)
        for k in ("horizontal_mm", "vertical_mm"):
            width = biometry["astigmatism"]["section_2p3mm"][k]
            f.number(f"cornea's section 2.3 mm behind its apex, {k}", width["value"], 10, 12)
            f.number(f"cornea's section less the phantom's true one, {k}", width["value"] - truth["eyes"][eye]["astigmatism"]["section_2p3mm"][k],
                     width["ci95"][0] - width["value"], width["ci95"][1] - width["value"])
    f.number("axial length, mm", length["value"], 20, 32)
