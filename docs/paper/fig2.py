"""Fig. 2 and section 3.1: Gullstrand's eye at full accommodation, formulas against meshes, by the paper's algorithm and ours."""
from paper import measure

paper_vertices = "973,1516,799,799,565,723,613"  # retina to anterior cornea


def figure(f):
    # A chart 92 mm away, at focus: 1000 / 10.87.
    scene = "letters:logmar=1.3,distance_mm=92,extent_deg=21"
    # the algorithm that tests every triangle is the slow one: a smaller picture of the same field for it
    side, rays = (100, 64) if f.quick else (128, 128)
    common = dict(eye="gullstrand", accommodation=10.87, scene=scene, field_mm="6x6", wavelength=589.3, pupil=3)
    def ours(out, kind, size, samples, seed, **more):
        return f.trace(out, surfaces=kind, size=f"{size}x{size}", samples=samples, seed=seed, **common, **more)
    full = 100 if f.quick else 500
    enough = 256 if f.quick else 4096
    time = {}
    for kind in ("analytic", "triangles", "smooth"):
        more = {} if kind == "analytic" else {"vertices": paper_vertices}
        time[kind] = ours(f"{kind}-500.png", kind, full, 500, 1, **more)
        f.number(f"{kind}, {full} x {full} x 500: s", time[kind]["wall_s"])
    floor = None
    for kind, seed in (("analytic", 2), ("analytic", 1), ("triangles", 3), ("smooth", 4)):
        more = {} if kind == "analytic" else {"vertices": paper_vertices}
        ours(f"{kind}-{seed}.png", kind, side, enough, seed, **more)
        if seed == 2:
            continue
        found = measure("ssim", f.path("analytic-2.png"), f.path(f"{kind}-{seed}.png"))
        if kind == "analytic":
            floor = found["msd"]
            f.number("two analytic runs, MSD (noise alone)", floor)
        else:
            f.number(f"{kind} against analytic, MSD", found["msd"], 0, 1 + 1.2 * floor)
            f.number(f"{kind} against analytic, SSIM", found["ssim"], 0.99 if f.quick else 0.999, 1)
    ours("triangles-double.png", "triangles", side, enough, 3,
         vertices=",".join(str(2 * int(n)) for n in paper_vertices.split(",")))
    double = measure("ssim", f.path("analytic-2.png"), f.path("triangles-double.png"))["ssim"]
    once = measure("ssim", f.path("analytic-2.png"), f.path("triangles-3.png"))["ssim"]
    f.number("doubling the vertices changes SSIM by", abs(double - once), 0, 0.001)

    # The paper's algorithm to the letter: 500 random rays in the paper, fewer here.
    answers = {}
    for kind, seed in (("analytic", 5), ("triangles", 6)):
        more = {} if kind == "analytic" else {"vertices": paper_vertices}
        answers[kind] = f.trace(f"paper-{kind}.png", method="paper", surfaces=kind, size=f"{side}x{side}", samples=rays, seed=seed,
                                **common, **more)
        f.number(f"paper's algorithm, {kind}: million rays a second", answers[kind]["rays_per_s"] / 1e6)
    found = measure("ssim", f.path("paper-analytic.png"), f.path("paper-triangles.png"))
    f.number(f"paper's algorithm, MSD with {rays} random rays a pixel", found["msd"])
    f.number("  noise falls with the rays: with the paper's 500", found["msd"] * rays / 500)
    f.number("paper's algorithm, SSIM", found["ssim"], 0.5, 1)
    f.sheet("fig2.png", 4, 260, ("analytic-1.png", "formulas"), ("triangles-3.png", "meshes, triangles"),
            ("smooth-4.png", "meshes, smooth"), ("paper-triangles.png", "meshes, the paper's algorithm"))
