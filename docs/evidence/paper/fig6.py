"""Fig. 6: an astigmatic dial seen by eyes whose cornea is an ellipsoid, at two asymmetry ratios."""
import math

from curves import plot
from paper import command, measure, surface

ratios = (1.02, 1.04)


def ellipsoid(alpha, horizontal):
    """A cornea stretched by alpha along one meridian; that meridian is flatter and out of focus."""
    axes = [7.7 * alpha, 7.7, 7.7] if horizontal else [7.7, 7.7 * alpha, 7.7]
    def change(eye):
        old = surface(eye, "cornea_anterior")
        for key in ("radius_mm", "q"):
            old.pop(key, None)
        old.update(type="ellipsoid", semi_axes_mm=axes)
    return change


def figure(f):
    size, field, pupil = (400, 3.6, 1.5) if f.quick else (600, 3.6, 1.5)
    cases = [("emmetropic", 1, True)] + [(f"{'horizontal' if h else 'vertical'} {a}", a, h) for h in (True, False) for a in ratios]
    rms, eyes, entrance, arcmin = {}, {}, {}, {}
    for name, alpha, horizontal in cases:
        file = f.write(name.replace(" ", "-") + ".json", f.eye("gullstrand", ellipsoid(alpha, horizontal), pupil=pupil))
        picture = name.replace(" ", "-") + ".png"
        answer = f.trace(picture, eye=file, scene="dial:distance_mm=inf,logmar=0.6,extent_deg=11", size=f"{size}x{size}",
                         field_mm=f"{field}x{field}", wavelength=589.3, samples=128 if f.quick else 256)
        arcmin[name] = answer["scale"]["arcmin_per_pixel"][0]
        degree = 60 / arcmin[name]
        strokes = measure("strokes", f.path(picture), 15, 3.0 * degree, 4.6 * degree, 22 / arcmin[name])["strokes"]
        rms[name] = {s["angle_deg"]: s["rms"] * arcmin[name] for s in strokes}
        optics = command("eye", file)
        eyes[name], entrance[name] = optics["refraction"], optics["entrance_pupil"]["diameter_mm"]
    curves = []
    for name, alpha, horizontal in cases[1:]:
        flat = 0 if horizontal else 90  # the meridian out of focus; its own strokes stay clear
        f.number(f"{name}: stroke along {flat} against the emmetropic eye's", rms[name][flat] / rms["emmetropic"][flat], 0.9, 1.15)
        f.number(f"{name}: stroke across it, against the emmetropic eye's", rms[name][flat + 90 if flat == 0 else 0] / rms["emmetropic"][0], 1.3)
        worst, model, seen = 0, [], []
        for angle in rms[name]:
            # rays through the pupil point p miss by P p; across a stroke, n, their second moment over the disc is
            # |P n|^2 radius^2 / 4
            across = (angle + 90) * math.pi / 180
            r, n = eyes[name], (math.cos(across), math.sin(across))
            power = math.hypot((r["M_D"] + r["J0_D"]) * n[0] + r["J45_D"] * n[1],
                               r["J45_D"] * n[0] + (r["M_D"] - r["J0_D"]) * n[1])
            predicted = power * entrance[name] / 2 * 1e-3 * 180 * 60 / math.pi / 2
            found = math.sqrt(max(0, rms[name][angle] ** 2 - rms["emmetropic"][angle] ** 2))
            model.append((angle, predicted))
            seen.append((angle, found))
            if predicted < 1:  # arcmin: lost in the stroke's own width
                continue
            worst = max(worst, abs(found / predicted - 1), key=abs)
        f.number(f"{name}: blur across strokes against the predicted dioptres, largest departure", worst, 0, 0.10)
        curves += [(f"{name}", model), ("", seen, "dots")]
    plot(f.path("fig6.svg"), "Blur across the strokes of the dial: predicted (lines), measured (rings)", "direction of the stroke, degrees", "rms half width, arcmin", *curves,
         x=(0, 165), y=(0, 1.5 * max(p[1] for curve in curves for p in curve[1])))
    for h in ("horizontal", "vertical"):
        across = 90 if h == "horizontal" else 0
        f.number(f"{h}: blur grows with alpha", rms[f"{h} {ratios[1]}"][across] / rms[f"{h} {ratios[0]}"][across], 1.2)
    f.sheet("fig6.png", 5, 240, *[(name.replace(" ", "-") + ".png", f"{name.split()[0]} astigmatism, {alpha}" if alpha > 1 else name)
                                  for name, alpha, _ in cases])
