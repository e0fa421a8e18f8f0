"""Regular triangle sheets of exact vertex counts, as the paper's validation needs them: vertices in rings on a sphere."""
import math


def sphere_sheet(file, radius_mm, position_mm, semi_diameter_mm, vertices):
    """A cap of a sphere as a PLY in the eye's frame; ring k of n has its share k / sum(k) of the vertices beside the pole."""
    rings = max(1, round((-1 + math.sqrt(1 + 4 * (vertices - 1) / 3)) / 2))
    first = [0] + [1 + round((vertices - 1) * k * (k + 1) / (rings * (rings + 1))) for k in range(rings + 1)]
    points, angles = [], []
    for k in range(rings + 1):
        count, r = first[k + 1] - first[k], semi_diameter_mm * k / rings
        depth = position_mm + radius_mm - math.copysign(math.sqrt(radius_mm ** 2 - r ** 2), radius_mm)
        for i in range(count):
            angles.append((i + 0.5 * (k % 2)) * 2 * math.pi / count)
            points.append((r * math.cos(angles[-1]), r * math.sin(angles[-1]), -depth))
    # between two rings: round both, each time along the ring whose next vertex comes first
    faces = []
    for k in range(rings):
        inner, outer = first[k + 1] - first[k], first[k + 2] - first[k + 1]
        next_angle = lambda ring, count, at: angles[ring + (at + 1) % count] + 2 * math.pi * ((at + 1) // count)
        i = o = 0
        while i < (inner if inner > 1 else 0) or o < outer:
            a, b = first[k] + i % inner, first[k + 1] + o % outer
            if inner == 1 or i >= inner or (o < outer and next_angle(first[k + 1], outer, o) <= next_angle(first[k], inner, i)):
                faces.append((a, b, first[k + 1] + (o + 1) % outer))
                o += 1
            else:
                faces.append((a, b, first[k] + (i + 1) % inner))
                i += 1
    file.write_text(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty double x\nproperty double y\nproperty double z\n"
                    f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
                    + "".join("%.9f %.9f %.9f\n" % p for p in points) + "".join("3 %d %d %d\n" % t for t in faces))


def meshed(f, eye, counts, stem):
    """An eye of spheres with each as a regular sheet: counts by surface, its file's name. As far out as a 3 mm pupil needs."""
    for surface in eye["surfaces"]:
        if surface["name"] not in counts:
            continue
        file = f.path(f"{stem}-{surface['name']}.ply")
        radius = surface.pop("radius_mm")
        reach = 5.5 if surface["name"] == "retina" else min(3.5, 0.98 * abs(radius))
        sphere_sheet(file, radius, surface.pop("position_mm"), reach, counts[surface["name"]])
        for key in ("q", "semi_diameter_mm"):
            surface.pop(key, None)
        surface.update(type="mesh", file=file.name)
    return f.write(f"{stem}.json", eye)
