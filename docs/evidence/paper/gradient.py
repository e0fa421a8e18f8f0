"""A gradient-index lens: Liou and Brennan's, and the same eye with the homogeneous lens that keeps its focus."""
import json

from curves import plot
from paper import command


def crossing_mm(f, eye, height):
    """Depth at which a ray that comes in parallel to the axis meets it."""
    hit = command("ray", eye=eye, **{"from": f"{height},0,10", "to": f"{height},0,0"})["hits"][-1]
    (x, _, z), (l, _, n) = hit["position_mm"], hit["direction"]
    return x * n / l - z


def figure(f):
    f.number("Liou-Brennan: power through its gradient, D (published 60.35)", command("eye", "liou-brennan")["power_D"], 60.34, 60.36)
    # Depths at which parallel rays meet the axis, by an independent Runge-Kutta integration of the published gradient.
    for height, depth in ((1, 23.9256), (2, 23.8541), (3, 23.7409)):
        f.number(f"ray at {height} mm: where it meets the axis, less {depth} mm", crossing_mm(f, "liou-brennan", height) - depth, -0.001, 0.001)

    # One homogeneous lens within the same outer surfaces, its index such that far objects stay in focus.
    eye = f.eye("liou-brennan", pupil=6 / 1.133)
    front, back = eye["media"].pop("lens_front"), eye["media"].pop("lens_back")
    middle = next(s for s in eye["surfaces"] if s.get("medium_after") == "lens_back")
    eye["surfaces"].remove(middle)
    next(s for s in eye["surfaces"] if s.get("medium_after") == "lens_front")["medium_after"] = "lens"
    def refraction_D(index):
        eye["media"]["lens"] = {"index": index, "polynomial": front["polynomial"]}
        return command("eye", f.write("homogeneous.json", eye))["refraction_D"]
    low, high = 1.42, 1.48
    for _ in range(30):
        index = (low + high) / 2
        low, high = (index, high) if refraction_D(index) > 0 else (low, index)
    f.number("equivalent index of the homogeneous lens", index, 1.44, 1.46)
    f.number("its refraction left, D", refraction_D(index), -1e-3, 1e-3)
    gradient = f.write("gradient.json", f.eye("liou-brennan", pupil=6 / 1.133))

    size = 160 if f.quick else 320
    curves, c40 = [], {}
    for label, file in (("gradient", gradient), ("homogeneous", f.path("homogeneous.json"))):
        f.trace(f"{label}.png", eye=file, scene="letters:distance_mm=inf,extent_deg=8", size=f"{size}x{size}", field_mm="2.4x2.4",
                samples=64 if f.quick else 256)
        f.trace(label, eye=file, scene="letters", size="8x8", samples=16)
        wave = json.loads((f.path(label) / "wavefront.json").read_text())
        c40[label] = wave["zernike_um"][12]
        f.number(f"{label}: c40 over a {wave['pupil_mm']:.2f} mm pupil, um", c40[label])
        curves.append((label, list(zip(wave["mtf"]["cpd"], wave["mtf"]["tangential"]))))
    f.number("spherical aberration: homogeneous over gradient", c40["homogeneous"] / c40["gradient"], 1.2)
    plot(f.path("gradient.svg"), "Liou and Brennan's eye, 6 mm pupil, 555 nm", "cycles per degree", "modulation transfer", *curves, x=(0, 30), y=(0, 1))
    # the index on the axis
    def on_axis(medium, z):
        return sum(t["coefficient"] * z ** t["depth_power"] for t in medium["grin"] if t["radius_power"] == 0)
    thickness = middle["position_mm"] - next(s for s in eye["surfaces"] if s["name"] == "lens_anterior")["position_mm"]
    end = next(s for s in eye["surfaces"] if s["name"] == "lens_posterior")["position_mm"] - middle["position_mm"]
    steps = [k / 40 for k in range(41)]
    profile = [(thickness * t, on_axis(front, thickness * t)) for t in steps] + [(thickness + end * t, on_axis(back, end * t)) for t in steps]
    plot(f.path("gradient-index.svg"), "Refractive index along the lens's axis", "depth behind the lens's front, mm", "index",
         ("gradient", profile), ("homogeneous", [(0, index), (thickness + end, index)]), y=(1.36, 1.48))
    f.sheet("gradient.png", 2, 320, ("gradient.png", "gradient index, 6 mm pupil"), ("homogeneous.png", "homogeneous lens, 6 mm pupil"))
