"""The conclusion's outlook: real time, motion of eye and object, a keratometer in, refractive surgery out."""
import os

from paper import command, measure, plane, png, processor_s, surface


def figure(f):
    # A picture of 32 rays a pixel, the map of the eye kept: what 992 rays more cost all cores, by 31; the first run
    # compiles the kernels.
    size, samples = (150, 32) if f.quick else (500, 32)
    cost_s = []
    for rays in (samples, samples, 32 * samples):
        before = processor_s()
        f.trace("frame.png", eye="navarro", surfaces="fast", scene="letters:distance_mm=inf", size=f"{size}x{size}", samples=rays, wavelength=589.3)
        cost_s.append(processor_s() - before)
    frame_s = (cost_s[2] - cost_s[1]) / 31 / os.cpu_count()
    f.number(f"pictures a second, fast mode, {size} x {size} x {samples}, {os.cpu_count()} cores, by processor time", 1 / frame_s, None if f.quick else 5)
    f.number("million rays a second, by processor time", size * size * samples / frame_s / 1e6)
    f.number("a single picture from nothing: processor time, s", cost_s[1])

    still = dict(eye="navarro", size="240x240", field_mm="3x3", samples=64 if f.quick else 256)
    f.write("ball.json", {"objects": [dict(plane([0, 0, 2000], 150, 150, "card.png"), motion_mm=[-60, 0, 0])]})
    png(f.path("card.png"), [[0.0 if (x // 8 + y // 8) % 2 else 1.0 for x in range(64)] for y in range(64)])
    f.write("card.json", {"objects": [plane([0, 0, 2000], 150, 150, "card.png")]})
    f.trace("still.png", scene=f.path("card.json"), **still)
    f.trace("object.png", scene=f.path("ball.json"), **still)
    f.trace("eye.png", scene=f.path("card.json"), motion="0,1.7", **still)
    smear = {name: measure("smear", f.path(name + ".png")) for name in ("object", "eye")}
    from_horizontal = abs((smear["object"]["direction_deg"] + 90) % 180 - 90)
    f.number("object moved to the right: smear, degrees from horizontal", from_horizontal, 0, 3)
    f.number("eye moved up: smear, degrees", smear["eye"]["direction_deg"], 87, 93)

    # A keratometer's reading in: an eye of axial length 24.39 mm and K 45.5 / 43.0 at 90 and 180; surgery out: the cornea
    # whose two meridians make it emmetropic, by Newton's steps on each radius.
    readings_D, n = {90: 45.5, 180: 43.0}, 337.5
    def with_radii(horizontal, vertical):
        def change(eye):
            surface(eye, "cornea_anterior").update(type="biconic", radius_mm=[horizontal, vertical], q=[-0.2, -0.2], axis_deg=0)
        return change
    def refraction(name, radii):
        file = f.write(name, f.eye("gullstrand", with_radii(*radii), pupil=4))
        r = command("eye", file)["refraction"]
        return file, r["M_D"] + r["J0_D"], r["M_D"] - r["J0_D"]
    radii = [n / readings_D[180], n / readings_D[90]]
    before, x_D, y_D = refraction("before.json", radii)
    f.number("before: refraction in the horizontal meridian, D", x_D)
    f.number("before: in the vertical meridian, D", y_D)
    for _ in range(4):
        _, x_D, y_D = refraction("step.json", radii)
        # d(power)/dR = -376 / R^2 D a mm
        radii = [r - D * r * r / 376 for r, D in zip(radii, (x_D, y_D))]
    after, x_D, y_D = refraction("after.json", radii)
    f.number("after: horizontal, D", x_D, -0.01, 0.01)
    f.number("after: vertical, D", y_D, -0.01, 0.01)
    f.number("radius before, vertical, mm", n / readings_D[90])
    f.number("radius after, vertical, mm", radii[1])
    # Ablation over 6 mm (Munnerlyn et al. 1988, with the conics' own sags): nothing is taken at the rim of the vertical meridian
    def sag(radius, q=-0.2):
        return 9 / radius / (1 + (1 - (1 + q) * 9 / radius ** 2) ** 0.5)
    change_um = {"horizontal": 1000 * (sag(radii[0]) - sag(n / readings_D[180])), "vertical": 1000 * (sag(radii[1]) - sag(n / readings_D[90]))}
    depth_um = f.number("depth of the ablation over 6 mm at the centre, um", -min(0, *change_um.values()))
    f.number("  at its deepest, um", depth_um + max(0, *change_um.values()))
    dioptres = 376 * (readings_D[90] / n - 1 / radii[1])
    f.number("depth over Munnerlyn's parabola S^2 D / (8 (n - 1))", depth_um / (36 * dioptres / (8 * 0.376)), 1, 1.2)
    picture = dict(scene="letters:distance_mm=inf,extent_deg=12", size="240x240", field_mm="3.6x3.6", samples=64 if f.quick else 256)
    f.trace("before.png", eye=before, **picture)
    f.trace("after.png", eye=after, **picture)
    f.sheet("conclusion.png", 5, 220, ("still.png", "still"), ("object.png", "object moves 1.7 degrees"), ("eye.png", "eye moves 1.7 degrees"),
            ("before.png", "before surgery"), ("after.png", "after"))
