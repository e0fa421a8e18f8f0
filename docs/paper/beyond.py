"""What the paper could not do: gradient index, every eye's wavefront, the uncertainty of a picture, myopia from 0 to -10 D."""
import json

from paper import command, measure

eyes = ("gullstrand", "gullstrand-emsley", "le-grand", "navarro", "escudero-sanz-navarro", "liou-brennan", "atchison:-4", "arizona",
        "bennett-rabbetts")


def figure(f):
    size = 120 if f.quick else 240
    picture = dict(scene="letters:distance_mm=inf,extent_deg=12", size=f"{size}x{size}", field_mm="3.6x3.6", samples=48 if f.quick else 192)
    # Gradient index: Liou and Brennan's published power and length, and the picture beside a homogeneous lens's.
    grin = command("eye", "liou-brennan")
    f.number("Liou-Brennan: power through its gradient, D (published 60.35)", grin["power_D"], 60.34, 60.36)
    f.trace("grin.png", eye="liou-brennan", pupil=6, **picture)
    f.trace("homogeneous.png", eye="gullstrand-emsley", pupil=6, **picture)

    # The wavefront of every eye, 4 mm iris.
    rows = ["eye,wavelength_nm,entrance_pupil_mm,M_D,c40_um,rms_um,strehl,mtf_10cpd,mtf_30cpd"]
    for name in eyes[:3] if f.quick else eyes:
        folder = name.replace(":", "")
        f.trace(folder, eye=name, pupil=4, scene="letters", size="8x8", samples=16)
        w = json.loads((f.path(folder) / "wavefront.json").read_text())
        at = lambda cpd: min(zip(w["mtf"]["cpd"], w["mtf"]["tangential"]), key=lambda pair: abs(pair[0] - cpd))[1]
        M = command("eye", name)["refraction_D"]
        rows.append(f"{name},{w['wavelength_nm']:g},{w['pupil_mm']:.3f},{M:.3f},{w['zernike_um'][12]:.4f},{w['rms_um']:.4f},{w['strehl']:.4f},"
                    f"{at(10):.3f},{at(30):.3f}")
    f.write("beyond-wavefronts.csv", "\n".join(rows) + "\n")
    c40 = {row.split(",")[0]: float(row.split(",")[4]) * (4 / float(row.split(",")[2])) ** 4 for row in rows[1:]}
    f.number("Gullstrand: c40 at a 4 mm entrance pupil, um (0.1158)", c40["gullstrand"], 0.10, 0.125)

    # Uncertainty: a refraction known to +-0.7 D (95 %), the eye at its middle and at both ends.
    for label, lens in (("sharpest", "0@12"), ("blurriest", "0.7@12")):
        f.trace(f"{label}.png", eye="navarro", spectacle=lens, **picture)

    shots = []
    for D in (0, -5, -10) if f.quick else range(0, -11, -2):
        f.trace(f"myopia{-D}.png", eye=f"atchison:{D}", **picture)
        shots.append((f"myopia{-D}.png", f"{D} D"))
    f.sheet("beyond.png", 5, 200, ("grin.png", "gradient index, 6 mm"), ("homogeneous.png", "homogeneous lens, 6 mm"),
            ("sharpest.png", "refraction 0 D"), ("blurriest.png", "at its interval's end, 0.7 D"), *shots)
