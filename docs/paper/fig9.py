"""Fig. 9: the standard eye, then with the cornea or the retina of one subject and of another (stand-ins for the paper's scans)."""
from paper import measure, plane, png, surface, tan_deg

# The subjects' corneas: steep meridian (radius, axis); their globes: half axes x, y, z of the retina.
subjects = {1: {"steep_mm": 7.35, "axis": 75, "retina": [11.3, 12.2, -12.0]},
            2: {"steep_mm": 7.35, "axis": 5, "retina": [12.4, 11.4, -12.0]}}


def cornea_of(subject):
    def change(eye):
        old = surface(eye, "cornea_anterior")
        old.update(type="biconic", radius_mm=[subject["steep_mm"], 7.7], q=[0, 0], axis_deg=subject["axis"])
    return change


def retina_of(subject):
    def change(eye):
        old = surface(eye, "retina")
        old.pop("radius_mm")
        old.update(type="ellipsoid", semi_axes_mm=subject["retina"])
    return change


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
    # The paper's section of a cornea 2.3 mm behind its apex: 12.72 x 12.20 mm. A sphere's is 2 sqrt(2 R d - d^2).
    section = lambda radius: 2 * (2 * radius * 2.3 - 2.3 ** 2) ** 0.5
    f.number("section at 2.3 mm of a cornea of radius 7.7 mm", section(7.7), 10.97, 10.99)
    for width in (12.72, 12.20):
        radius = ((width / 2) ** 2 + 2.3 ** 2) / (2 * 2.3)
        f.number(f"radius that a section of {width} mm means", radius)
        f.number(f"  keratometric power of {width} mm, D: outside 38 to 50, no cornea", 337.5 / radius, 0, 38)
    f.sheet("fig9.png", 5, 200, *pictures)
