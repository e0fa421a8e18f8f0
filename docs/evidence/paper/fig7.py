"""Fig. 7: dashes and dots through three plano-cylindrical spectacles, the best radius by optimisation, and their distortion."""
import csv
import json
import math
import random

from curves import plot
from paper import command, measure, plane, png, surface, tan_deg

radii_mm = (40, 50, 65)
# A cornea steeper in the horizontal meridian: -9.1 D there, what -10 D at 10 mm corrects.
cornea_mm = [7.7 / (1 + 9.09 / 48.831), 7.7]


def astigmatic(q):
    """Gullstrand's eye with that cornea, its conic constants q along x and y."""
    return lambda eye: surface(eye, "cornea_anterior").update(type="biconic", radius_mm=cornea_mm, q=q, axis_deg=0)


def without_aberration(f, pupil_mm):
    """The conic constants at which the eye's primary spherical aberration and secondary astigmatism vanish: Newton's steps."""
    def terms(q):
        f.trace("wave", eye=f.write("wave.json", f.eye("gullstrand", astigmatic(q), pupil=pupil_mm)), scene="letters", size="8x8", samples=16)
        return json.loads((f.path("wave") / "wavefront.json").read_text())["zernike_um"][12:14]
    q, h = [-0.5, -0.5], 0.05
    for _ in range(3):
        c = terms(q)
        (a, d), (b, e) = ([(v - w) / h for v, w in zip(terms(moved), c)] for moved in ([q[0] + h, q[1]], [q[0], q[1] + h]))
        q = [q[0] - (e * c[0] - b * c[1]) / (a * e - b * d), q[1] - (a * c[1] - d * c[0]) / (a * e - b * d)]
    f.number("primary spherical aberration left, um", terms(q)[0], -1e-3, 1e-3)
    return q


def dashes_and_dots(cells=12, side=60):
    """A grid of strokes in random directions and of dots; linear light."""
    rng, size = random.Random(1), cells * side
    rows = [[1.0] * size for _ in range(size)]
    for cell in range(cells * cells):
        x0, y0 = cell % cells * side + side / 2, cell // cells * side + side / 2
        angle, dot = rng.uniform(0, math.pi), (cell + cell // cells) % 3 == 0
        half = 0 if dot else 18
        for y in range(int(y0 - 26), int(y0 + 26)):
            for x in range(int(x0 - 26), int(x0 + 26)):
                u, v = x + 0.5 - x0, y + 0.5 - y0
                along, across = u * math.cos(angle) + v * math.sin(angle), v * math.cos(angle) - u * math.sin(angle)
                if math.hypot(max(0.0, abs(along) - half), across) < (7 if dot else 4):
                    rows[y][x] = 0.0
    return rows


def figure(f):
    size, samples = (200, 64) if f.quick else (400, 256)
    png(f.path("texture.png"), dashes_and_dots())
    scene = f.write("dashes.json", {"objects": [dict(plane([0, 0, 1], tan_deg(6), tan_deg(6), "texture.png"), at_infinity=True)]})
    eyes = {"no aberration": f.write("eye.json", f.eye("gullstrand", astigmatic(without_aberration(f, 3)), pupil=3)),
            "Gullstrand's aberration": f.write("aberrated.json", f.eye("gullstrand", astigmatic([0, 0]), pupil=3))}
    look = dict(eye=eyes["no aberration"], size=f"{size}x{size}", field_mm="3.6x3.6", samples=samples, scene=scene)
    f.trace("none.png", **look)
    for radius in radii_mm:
        f.trace(f"r{radius}.png", plano_cylinder=f"{radius}@90", **look)

    # Sharpness of the image against radius, and the optimum found by Ceres.
    curves = []
    for label, eye in eyes.items():
        folder = f.path("correct-" + eye.stem)
        command("correct", eye=eye, output=folder, pupil=3, chart=scene, samples=16)
        answer = json.loads((folder / "prescription.json").read_text())
        found, check = answer["plano_cylinder"], answer["wavefront_check"]
        points = [(float(row["radius_mm"]), float(row["gradient_energy"])) for row in csv.DictReader((folder / "sweep.csv").open())]
        curves.append((f"{label}: best {found['radius_mm']:.1f} mm", points))
        f.write(f"fig7-sweep-{eye.stem}.csv", (folder / "sweep.csv").read_text())
        # the horizontal meridian's lens by the wavefront, brought from the prescription's vertex distance to 10 mm
        def radius_by(criterion):
            power = sum(check[criterion][k] for k in ("M_D", "J0_D"))
            return -500 * (1 / power - 0.001 * (answer["vertex_distance_mm"] - 10))
        if label == "no aberration":
            f.number("no aberration: best radius found by Ceres, mm (paper 50)", found["radius_mm"], 49, 51)
            f.number("no aberration: its axis, degrees", found["axis_deg"], 89, 91)
            at = lambda radius: min(points, key=lambda p: abs(p[0] - radius))[1]
            for radius in (40, 65):
                f.number(f"no aberration: sharpness at 50 mm over that at {radius}", at(50) / at(radius), 1.5)
        else:
            # the lens that flattens the wavefront and the lens of the smallest spot share out the aberration otherwise
            f.number("Gullstrand's aberration: best radius found by Ceres, mm", found["radius_mm"], radius_by("minimum_rms_spot"),
                     radius_by("minimum_rms_wavefront"))
            f.number("Gullstrand's aberration: what the pupil's centre alone asks for, mm", radius_by("paraxial"), 49.5, 50.5)
    plot(f.path("fig7.svg"), "Sharpness through a plano-cylinder, 3 mm pupil", "radius of its back surface, mm",
         "sharpness (mean MTF squared)", *curves, x=(20, 100), y=(0, 1))

    # Distortion: two dark spots 6 degrees apart along x and along y, with and without a lens.
    n = 256
    spots = [[1.0] * n for _ in range(n)]
    for sx, sy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        for y in range(n):
            for x in range(n):
                if ((x - n / 2 + 0.5) / n * 8 - 3 * sx) ** 2 + ((y - n / 2 + 0.5) / n * 8 - 3 * sy) ** 2 < 0.3 ** 2:
                    spots[y][x] = 0.0
    png(f.path("spots.png"), spots)
    f.write("spots.json", {"objects": [dict(plane([0, 0, 1], tan_deg(4), tan_deg(4), "spots.png"), at_infinity=True)]})
    eye = eyes["no aberration"]
    def spans(name, **lens):
        f.trace(name, eye=eye, scene=f.path("spots.json"), size="400x400", field_mm="3x3", samples=64, pupil=1, wavelength=589.3, **lens)
        at = lambda *part: measure("dark", f.path(name), *part)
        return (at(220, 140, 160, 120)["x"] - at(20, 140, 160, 120)["x"], at(140, 220, 120, 160)["y"] - at(140, 20, 120, 160)["y"])
    bare = spans("bare.png")
    entrance_mm = command("eye", eye)["entrance_pupil"]["position_mm"]
    for radius in radii_mm:
        worn = spans(f"worn{radius}.png", plano_cylinder=f"{radius}@90")
        expected = 1 / (1 + 0.5 / radius * (10 + entrance_mm))  # spectacle magnification, lens to entrance pupil
        f.number(f"R = {radius} mm: horizontal magnification over 1/(1 - d F) = {expected:.4f}", worn[0] / bare[0] / expected, 0.99, 1.01)
        f.number(f"R = {radius} mm: vertical magnification", worn[1] / bare[1], 0.99, 1.01)
    f.sheet("fig7.png", 4, 300, ("none.png", "no spectacle"), *[(f"r{r}.png", f"R = {r} mm") for r in radii_mm])
