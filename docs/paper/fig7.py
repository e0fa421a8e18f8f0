"""Fig. 7: dashes through three plano-cylindrical spectacles, the best radius by optimisation, and their distortion."""
import csv
import json

from paper import command, measure, plane, png, surface, tan_deg

radii_mm = (40, 50, 65)


def myopic_in_x(eye):
    """A cornea steeper in the horizontal meridian: -9.1 D there, what -10 D at 10 mm corrects."""
    old = surface(eye, "cornea_anterior")
    for key in ("radius_mm", "q"):
        old.pop(key, None)
    # curvature c/a^2 along x; (1 - n) of it adds 9.09 D to 48.83
    old.update(type="ellipsoid", semi_axes_mm=[7.7 * (1 / (1 + 9.09 / 48.831)) ** 0.5, 7.7, 7.7])


def figure(f):
    eye = f.write("eye.json", f.eye("gullstrand", myopic_in_x, pupil=3))
    samples = 64 if f.quick else 256
    size = 200 if f.quick else 400
    scene = "dashes:distance_mm=inf,logmar=0.9,extent_deg=12"
    f.trace("none.png", eye=eye, scene=scene, size=f"{size}x{size}", field_mm="3.6x3.6", samples=samples)
    for radius in radii_mm:
        f.trace(f"r{radius}.png", eye=eye, scene=scene, size=f"{size}x{size}", field_mm="3.6x3.6", samples=samples,
                plano_cylinder=f"{radius}@90")

    # Sharpness as the optimiser sees it, and where it ends; 2 mm, as spherical aberration asks for more minus in a wide pupil.
    folder = f.path("correct")
    command("correct", eye=eye, output=folder, pupil=2, chart=scene, samples=16)
    found = json.loads((folder / "prescription.json").read_text())["plano_cylinder"]
    value = lambda x: x["value"] if isinstance(x, dict) else x
    f.number("best radius found by Ceres, mm", value(found["radius_mm"]), 47, 53)
    f.number("its axis, degrees", value(found["axis_deg"]), 88, 92)
    rows = [{k: v for k, v in row.items()} for row in csv.DictReader((folder / "sweep.csv").open())]
    f.write("fig7-sweep.csv", (folder / "sweep.csv").read_text())
    f.number("rows of the sharpness curve", len(rows), 5)

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
    def spans(name, **lens):
        f.trace(name, eye=eye, scene=f.path("spots.json"), size="400x400", field_mm="3x3", samples=64, pupil=1, wavelength=589.3, **lens)
        at = lambda *part: measure("dark", f.path(name), *part)
        return (at(220, 140, 160, 120)["x"] - at(20, 140, 160, 120)["x"], at(140, 220, 120, 160)["y"] - at(140, 20, 120, 160)["y"])
    bare, worn = spans("bare.png"), spans("worn.png", plano_cylinder="50@90")
    entrance_mm = command("eye", eye)["entrance_pupil"]["position_mm"]
    expected = 1 / (1 + 0.010 * (10 + entrance_mm))  # spectacle magnification of -10 D, lens to entrance pupil
    f.number("horizontal magnification through R = 50 mm", worn[0] / bare[0], expected - 0.01, expected + 0.01)
    f.number("  closed form 1/(1 - d F)", expected)
    f.number("vertical magnification", worn[1] / bare[1], 0.99, 1.01)
    f.sheet("fig7.png", 4, 260, ("none.png", "no spectacle"), *[(f"r{r}.png", f"R = {r} mm") for r in radii_mm])
