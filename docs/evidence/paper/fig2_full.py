"""Section 3.1 with all of the paper's rays by the paper's algorithm, every triangle tested: nine minutes on two cores."""
from fig2 import theirs, theirs_on_regular
from paper import measure, processor_s


def figure(f):
    side, rays = (60, 32) if f.quick else (500, 500)
    theirs(f, "analytic.png", "analytic", side, rays, 5)
    theirs(f, "noise.png", "analytic", side, rays, 7)
    began = processor_s()
    theirs_on_regular(f, "triangles.png", side, rays, 6)
    f.number("triangles: processor time, s (paper 300 s on its GPU)", processor_s() - began)
    noise, found = (measure("ssim", f.path("analytic.png"), f.path(other)) for other in ("noise.png", "triangles.png"))
    f.number("formulas with other rays (noise alone): MSD", noise["msd"])
    f.number("formulas with other rays (noise alone): SSIM", noise["ssim"])
    f.number("triangles against formulas: MSD (paper 10)", found["msd"], 0, 1.2 * noise["msd"] if f.quick else 10)
    f.number("triangles against formulas: SSIM (paper 0.99)", found["ssim"], 0.94 if f.quick else 0.98, 1)
    f.sheet("fig2_full.png", 2, 500, ("analytic.png", "formulas, 500 random rays a pixel"), ("triangles.png", "meshes, every triangle tested"))
