"""Fig. 2 and section 3.1: Gullstrand's eye at full accommodation, formulas against meshes, by the paper's algorithm and ours."""
from paper import measure, processor_s
from sheets import meshed

paper_vertices = {"retina": 973, "lens_posterior": 1516, "nucleus_posterior": 799, "nucleus_anterior": 799, "lens_anterior": 565,
                  "cornea_posterior": 723, "cornea_anterior": 613}
# Letters 92 mm away, at focus: 1000 / 10.87.
picture = dict(scene="letters:logmar=1.3,distance_mm=92,extent_deg=21", field_mm="6x6", wavelength=589.3, pupil=3)
gullstrand = dict(eye="gullstrand", accommodation=10.87, **picture)


def vertices(times=1):
    return ",".join(str(times * n) for n in paper_vertices.values())


def regular(f, times=1):
    """The eye with regular meshes, as the paper's must have been."""
    counts = {name: times * n for name, n in paper_vertices.items()}
    return meshed(f, f.eye("gullstrand", accommodation=10.87, pupil=3), counts, f"regular{times}")


def theirs(f, out, kind, side, rays, seed, **eye):
    return f.trace(out, method="paper", surfaces=kind, size=f"{side}x{side}", samples=rays, seed=seed, **{**gullstrand, **eye})


def theirs_on_regular(f, out, side, rays, seed, times=1):
    return f.trace(out, method="paper", surfaces="triangles", size=f"{side}x{side}", samples=rays, seed=seed, eye=regular(f, times), **picture)


def figure(f):
    side, rays = (100, 256) if f.quick else (500, 500)
    def ours(out, kind, seed, times=1):
        more = {} if kind == "analytic" else {"vertices": vertices(times)}
        return f.trace(out, surfaces=kind, size=f"{side}x{side}", samples=rays, seed=seed, **gullstrand, **more)
    compare = lambda name: measure("ssim", f.path("reference.png"), f.path(name))
    ours("reference.png", "analytic", 2)
    noise = None
    for kind, seed in (("analytic", 1), ("triangles", 3), ("smooth", 4)):
        began = processor_s()
        ours(f"{kind}.png", kind, seed)
        paper_s = 10 if kind == "analytic" else 300
        f.number(f"{kind}, {side} x {side} x {rays}: processor time, s (paper {paper_s} s on its GPU)", processor_s() - began)
        found = compare(f"{kind}.png")
        noise = noise or found["msd"]
        against = "formulas with other rays (noise alone)" if kind == "analytic" else "formulas"
        # two pictures' noise, and 1 for the meshes (the paper has up to 10)
        f.number(f"{kind} against {against}: MSD", found["msd"], 0, 1 + 1.2 * noise)
        f.number(f"{kind} against {against}: SSIM", found["ssim"], 0.99 if f.quick else 0.999, 1)
        if kind != "analytic":
            ours(f"{kind}-double.png", kind, seed, 2)
            f.number(f"{kind}: doubling the vertices changes SSIM by", compare(f"{kind}-double.png")["ssim"] - found["ssim"], -0.001, 0.001)

    # The paper's algorithm to the letter, on a smaller picture with fewer rays; fig2_full has all of them.
    side, rays = (48, 48) if f.quick else (160, 100)
    theirs(f, "paper-analytic.png", "analytic", side, rays, 5)
    theirs(f, "paper-noise.png", "analytic", side, rays, 7)
    theirs_on_regular(f, "paper-regular.png", side, rays, 6)
    theirs(f, "paper-irregular.png", "triangles", side, rays, 6, vertices=vertices())
    theirs_on_regular(f, "paper-double.png", side, rays, 6, 2)  # the same random rays
    noise, found, irregular, double = (measure("ssim", f.path("paper-analytic.png"), f.path(f"paper-{other}.png"))
                                       for other in ("noise", "regular", "irregular", "double"))
    f.number("paper's algorithm, formulas with other rays (noise alone): MSD", noise["msd"])
    f.number("paper's algorithm, formulas with other rays (noise alone): SSIM", noise["ssim"])
    f.number("paper's algorithm, regular meshes against formulas: MSD", found["msd"], 0, 1.2 * noise["msd"])
    f.number("paper's algorithm, regular meshes against formulas: SSIM", found["ssim"], noise["ssim"] - 0.005, 1)
    at_500 = noise["msd"] * rays / 500
    f.number("paper's algorithm: MSD with 500 rays, as noise falls with their number (paper 10)", at_500 + found["msd"] - noise["msd"], 0, 10)
    f.number("paper's algorithm: doubling the vertices changes SSIM by", double["ssim"] - found["ssim"], -0.001, 0.001)
    f.number("paper's algorithm, irregular meshes: MSD beyond noise, by plain means of normals", irregular["msd"] - noise["msd"], 10)
    crop = "" if f.quick else "@120,120,260,260"
    small = "" if f.quick else "@38,38,84,84"
    f.sheet("fig2.png", 3, 320, (f"analytic.png{crop}", "formulas"), (f"triangles.png{crop}", "irregular meshes, triangles"),
            (f"smooth.png{crop}", "irregular meshes, smooth"), (f"paper-analytic.png{small}", f"paper's algorithm, {rays} rays: formulas"),
            (f"paper-regular.png{small}", "paper's algorithm: regular meshes"), (f"paper-irregular.png{small}", "paper's algorithm: irregular meshes"))
