"""Myopia from 0 to -10 D by Atchison's model: without and with the spectacle that its name gives."""
import math

from curves import plot
from paper import command, measure, plane, png, tan_deg

refractions_D = tuple(range(0, -11, -1))


def figure(f):
    size, n, dot_deg = (160, 200, 0.1) if f.quick else (240, 200, 0.1)
    picture = dict(scene="letters:distance_mm=inf,extent_deg=12", size=f"{size}x{size}", field_mm="3.6x3.6", pupil=3, samples=64 if f.quick else 144)
    # a dark dot on a ground of 4 degrees: rms half width of a uniform disc of blur is a quarter of its diameter
    dot = [[0.0 if math.hypot(x - n / 2 + 0.5, y - n / 2 + 0.5) < dot_deg / 4 * n else 1.0 for x in range(n)] for y in range(n)]
    png(f.path("dot.png"), dot)
    f.write("dot.json", {"objects": [dict(plane([0, 0, 1], tan_deg(2), tan_deg(2), "dot.png"), at_infinity=True)]})
    def blur_arcmin(name, **more):
        answer = f.trace(f"{name}.tiff", scene=f.path("dot.json"), size="160x160", field_mm="1x1", pupil=2, wavelength=555,
                         samples=128, **more)
        return measure("dark", f.path(f"{name}.tiff"), 0, 0, 160, 160)["rms_x"] * answer["scale"]["arcmin_per_pixel"][0]
    bare, worn, found, predicted = [], [], [], []
    own = blur_arcmin("dot-emmetropic", eye="atchison:0")
    for D in refractions_D:
        eye = f"atchison:{D}"
        optics = command("eye", eye, pupil=2)
        at_cornea = optics["refraction_D"]
        # moved to a spectacle 12 mm in front of the cornea
        f.number(f"{eye}: refraction in the spectacle plane less its name, D", at_cornea / (1 + 0.012 * at_cornea) - D, -0.05, 0.05)
        blur = math.sqrt(max(0.0, blur_arcmin(f"dot{-D}", eye=eye) ** 2 - own ** 2))
        at_pupil = at_cornea / (1 - optics["entrance_pupil"]["position_mm"] * at_cornea / 1000)
        expected = abs(at_pupil) * optics["entrance_pupil"]["diameter_mm"] * 1e-3 * 180 * 60 / math.pi / 4
        found.append((-D, blur))
        predicted.append((-D, expected))
        if D <= -2:
            f.number(f"{eye}: blur over dioptres times pupil", blur / expected, 0.95, 1.05)
            f.number(f"{eye}: with its spectacle, rms half width of the dot, arcmin", blur_arcmin(f"worn{-D}", eye=eye, spectacle=f"{D}@12"), 0, own + 0.6)
        if D % 2 == 0:
            f.trace(f"bare{-D}.png", eye=eye, **picture)
            f.trace(f"corrected{-D}.png", eye=eye, spectacle=f"{D}@12", **picture)
            bare.append((f"bare{-D}.png", f"{D} D"))
            worn.append((f"corrected{-D}.png", f"{D} D, with spectacle"))
    plot(f.path("myopia.svg"), "Blur of a distant point, entrance pupil of a 2 mm iris", "myopia, D", "rms half width, arcmin",
         ("dioptres x pupil / 4", predicted), ("measured in the picture", found, "dots"), legend_left=True)
    f.sheet("myopia.png", 6, 180, *bare, *worn)
