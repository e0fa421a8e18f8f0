"""Fig. 9: the standard eye, then with the cornea or the retina of one subject and of another (stand-ins for the paper's scans)."""
import math

from curves import plot
from paper import command, measure, plane, png, surface, tan_deg

# The subjects' corneas: steep meridian (radius, axis), conic constant; their globes: half axes x, y, z of the retina.
subjects = {1: {"steep_mm": 7.35, "axis": 75, "q": -0.26, "retina": [11.3, 12.2, -12.0]},
            2: {"steep_mm": 7.35, "axis": 5, "q": -0.15, "retina": [12.4, 11.4, -12.0]}}


def cornea_of(subject):
    def change(eye):
        old = surface(eye, "cornea_anterior")
        old.update(type="biconic", radius_mm=[subject["steep_mm"], 7.7], q=[subject["q"]] * 2, axis_deg=subject["axis"])
    return change


def retina_of(subject):
    def change(eye):
        old = surface(eye, "retina")
        old.pop("radius_mm")
        old.update(type="ellipsoid", semi_axes_mm=subject["retina"])
    return change


def axial_radius_mm(eye, height_mm, axis_deg):
    """Of the cornea at that distance from the apex: from where its normal, told by the refraction of a ray, meets the axis."""
    c, s = math.cos(math.radians(axis_deg)), math.sin(math.radians(axis_deg))
    at = f"{height_mm * c},{height_mm * s}"
    l, m, n = command("ray", eye=eye, **{"from": f"{at},10", "to": f"{at},0"})["hits"][0]["direction"]
    across, along = 1.376 * (l * c + m * s), 1.376 * n + 1  # the change of index x direction is along the normal
    return height_mm * math.hypot(across, along) / abs(across)


def figure(f):
    n, dots = 300, 10
    texture = [[0.0 if ((x % (n // dots)) - n // dots / 2 + 0.5) ** 2 + ((y % (n // dots)) - n // dots / 2 + 0.5) ** 2 < 9 else 1.0
                for x in range(n)] for y in range(n)]
    png(f.path("dots.png"), texture)
    half = tan_deg(5)
    f.write("far.json", {"objects": [dict(plane([0, 0, 1], half, half, "dots.png"), at_infinity=True)]})
    f.write("near.json", {"objects": [plane([0, 0, 92], 92 * half, 92 * half, "dots.png")]})
    cases = [("standard", None), ("cornea 1", cornea_of(subjects[1])), ("retina 1", retina_of(subjects[1])),
             ("cornea 2", cornea_of(subjects[2])), ("retina 2", retina_of(subjects[2]))]
    pictures = []
    for state, scene, options in (("relaxed", "far.json", {}), ("accommodated", "near.json", {"accommodation": 10.87})):
        smear = {}
        for name, change in cases:
            stem = f"{state}-{name.replace(' ', '-')}"
            eye = f.write(stem + ".json", f.eye("gullstrand", change, pupil=3, **options))
            size = 160 if f.quick else 300
            f.trace(stem + ".png", eye=eye, scene=f.path(scene), size=f"{size}x{size}", field_mm="2.6x2.6",
                    samples=64 if f.quick else 256)
            smear[name] = measure("smear", f.path(stem + ".png"))
            pictures.append((stem + ".png", f"{state}, {name}"))
        for k in subjects:
            axis = subjects[k]["axis"]
            off = (smear[f"cornea {k}"]["direction_deg"] - axis + 90) % 180 - 90
            f.number(f"{state}: smear by cornea {k}, degrees from its steep meridian at {axis}", off, -5, 5)
            f.number(f"{state}: coherence of the smear, cornea {k}", smear[f"cornea {k}"]["coherence"], 0.1, 1)
            f.number(f"{state}: coherence by retina {k} over that by cornea {k}", smear[f"retina {k}"]["coherence"] / smear[f"cornea {k}"]["coherence"], 0, 0.3)
    # Flattening from the apex: a conic's axial radius is sqrt(R^2 - Q h^2).
    heights, curves = [0.5 * k for k in range(1, 9)], []
    for label, stem, axis, radius, q in [("standard eye", "relaxed-standard", 0, 7.7, 0)] + [
            (f"subject {k}, steep meridian", f"relaxed-cornea-{k}", s["axis"], s["steep_mm"], s["q"]) for k, s in subjects.items()]:
        curves.append((label, [(h, axial_radius_mm(f.path(stem + ".json"), h, axis)) for h in heights]))
        worst = max(abs(r - math.sqrt(radius ** 2 - q * h ** 2)) for h, r in curves[-1][1])
        f.number(f"{label}: axial radius traced against sqrt(R^2 - Q h^2), mm at most", worst, 0, 1e-3)
        f.number(f"{label}: flattening from the apex to 4 mm, mm", curves[-1][1][-1][1] - radius)
    plot(f.path("fig9.svg"), "Flattening of the corneas from the apex", "distance from the apex, mm", "axial radius, mm", *curves, y=(7.2, 8.2), legend_left=True)
    # The paper's section of a cornea 2.3 mm behind its apex: 12.72 x 12.20 mm. A sphere's is 2 sqrt(2 R d - d^2).
    section = lambda radius: 2 * (2 * radius * 2.3 - 2.3 ** 2) ** 0.5
    f.number("section at 2.3 mm of a cornea of radius 7.7 mm", section(7.7), 10.97, 10.99)
    for width in (12.72, 12.20):
        # a conic's sagitta d at half width h: h^2 = 2 R d - (1 + Q) d^2
        radius = {q: ((width / 2) ** 2 + (1 + q) * 2.3 ** 2) / (2 * 2.3) for q in (0, -0.5)}
        f.number(f"radius that a section of {width} mm means, sphere", radius[0])
        f.number(f"  keratometric power of {width} mm, D, sphere: outside 38 to 50", 337.5 / radius[0], 0, 38)
        f.number(f"  the same, Q = -0.5{': outside 38 to 50, no cornea' if width > 12.5 else ''}", 337.5 / radius[-0.5], 0, 38 if width > 12.5 else 40)
    f.sheet("fig9.png", 5, 200, *pictures)
