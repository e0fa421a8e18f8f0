"""The abstract's chromatic aberration: longitudinal, against measurements and the model's own curve; and coloured fringes."""
from curves import plot
from paper import command, measure

# Thibos et al. 1992, chromatic eye: D(w) = 1.68524 - 633.46 / (w - 214.102); Navarro's eye as its dispersion formulas give it.
navarro_D = {450: -1.114, 486.1: -0.685, 550: -0.201, 656.3: 0.255, 700: 0.385}


def thibos_D(nm):
    return 1.68524 - 633.46 / (nm - 214.102)


def figure(f):
    refraction = lambda nm: command("eye", "navarro", wavelength=nm)["refraction_D"]
    zero = refraction(589.3)
    curve = [(nm, refraction(nm) - zero, thibos_D(nm) - thibos_D(589.3)) for nm in range(400, 701, 20)]
    f.write("chromatic.csv", "wavelength_nm,navarro_D,thibos_1992_D\n" + "".join("%d,%.4f,%.4f\n" % row for row in curve))
    plot(f.path("chromatic.svg"), "Chromatic difference of refraction, zero at 589.3 nm", "wavelength, nm", "refraction, D",
         ("Navarro's eye, traced", [row[:2] for row in curve]), ("Thibos et al. 1992", [(row[0], row[2]) for row in curve], "dots"), y=(-2.5, 1))
    for nm, model in navarro_D.items():
        value = f.number(f"chromatic difference at {nm} nm, D", refraction(nm) - zero, model - 0.005, model + 0.005)
        f.number(f"  at {nm} nm, from Thibos 1992", value - (thibos_D(nm) - thibos_D(589.3)), -0.15, 0.15)
    size = 200 if f.quick else 360
    common = dict(eye="navarro", pupil=6, scene="letters:logmar=1.1,distance_mm=inf,extent_deg=8", size=f"{size}x{size}",
                  field_mm="2x2", samples=64 if f.quick else 512)
    f.trace("grey.png", wavelength=589.3, **common)
    f.trace("white.png", **common)
    f.trace("myopic.png", spectacle="1@12", **common)
    grey, white = (measure("colour", f.path(name))["mean_difference"] for name in ("grey.png", "white.png"))
    f.number("red less blue, monochromatic, grey levels", grey, 0, 0.01)
    f.number("red less blue, white light", white, 1)
    f.sheet("chromatic.png", 3, 300, ("grey.png", "589 nm"), ("white.png", "white light, 6 mm pupil"),
            ("myopic.png", "white light, 1 D myopic"))
