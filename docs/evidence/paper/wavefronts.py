"""Wavefront and MTF of every named eye behind an entrance pupil of 4 mm, in one table, and what each lets through."""
import json

from curves import plot
from paper import command

eyes = ("gullstrand", "gullstrand-emsley", "le-grand", "bennett-rabbetts", "navarro", "escudero-sanz-navarro", "arizona", "liou-brennan",
        "atchison:0")
# Primary spherical aberration over 4 mm from an independent trace of the published surfaces, um.
c40_um = {"gullstrand": 0.1158, "le-grand": 0.1162, "navarro": 0.0421, "escudero-sanz-navarro": 0.0423, "arizona": 0.0374}


def figure(f):
    size = 100 if f.quick else 240
    rows, curves, pictures = ["eye,wavelength_nm,M_D,c40_um,rms_um,strehl,mtf_10cpd,mtf_30cpd"], [], []
    for name in eyes:
        stem = name.replace(":", "")
        iris_mm = 16 / command("eye", name, pupil=4)["entrance_pupil"]["diameter_mm"]
        for _ in range(2):  # the rays' pupil is narrower than the paraxial one
            f.trace(stem, eye=name, pupil=iris_mm, scene="letters", size="8x8", samples=16)
            wave = json.loads((f.path(stem) / "wavefront.json").read_text())
            iris_mm *= 4 / wave["pupil_mm"]
        mtf = dict(zip(wave["mtf"]["cpd"], wave["mtf"]["tangential"]))
        rows.append(f"{name},{wave['wavelength_nm']:g},{command('eye', name)['refraction_D']:.3f},{wave['zernike_um'][12]:.4f},"
                    f"{wave['rms_um']:.4f},{wave['strehl']:.4f},{mtf[10]:.3f},{mtf[30]:.3f}")
        if name in c40_um:
            f.number(f"{name}: c40 over {c40_um[name]} um", wave["zernike_um"][12] / c40_um[name], 0.995, 1.005)
        curves.append((name, list(mtf.items())))
        # twice the size of 0 logMAR, with diffraction
        f.trace(f"{stem}.png", eye=name, pupil=iris_mm, scene="letters:logmar=0.3,distance_mm=inf,extent_deg=1", size=f"{size}x{size}",
                field_mm="0.3x0.3", samples=64 if f.quick else 256, diffraction=True, wavelength=wave["wavelength_nm"])
        pictures.append((f"{stem}.png", name))
    f.write("wavefronts.csv", "\n".join(rows) + "\n")
    plot(f.path("wavefronts.svg"), "Entrance pupil 4 mm, far object, the eye's own wavelength", "cycles per degree", "modulation transfer", *curves,
         x=(0, 60), y=(0, 1))
    f.sheet("wavefronts.png", 3, 240, *pictures)
