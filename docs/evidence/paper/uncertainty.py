"""The uncertainty of a patient's picture: the sharpest and the blurriest eye within the 95 % interval of the sample phantom's right eye."""
import json
import math
import random
import shutil

from paper import command, degrees, here, patient


def cholesky(c):
    low = [[0.0] * len(c) for _ in c]
    for i, row in enumerate(c):
        for j in range(i + 1):
            rest = row[j] - sum(low[i][k] * low[j][k] for k in range(j))
            low[i][j] = math.sqrt(max(rest, 0.0)) if i == j else (rest / low[j][j] if low[j][j] > 0 else 0.0)
    return low


class MeasuredEye:
    """The eye of a case's optics.json as formulas, with its parameters moved."""

    def __init__(self, f, case, stem):
        optics = json.loads((case / "meshing" / "od" / "optics.json").read_text())
        self.f, self.stem, self.eye = f, stem, optics["eye"]
        self.names, self.values, self.covariance = optics["parameters"], optics["values"], optics["covariance"]

    def moved(self, name, change):
        """Its file, with every parameter moved by its share of change."""
        p = {n: v + d for n, v, d in zip(self.names, self.values, change)}
        by = dict(zip(self.names, change))
        eye = json.loads(json.dumps(self.eye))
        front, back, iris, lens_front, lens_back, retina = eye["surfaces"]
        j = math.hypot(p["cornea_j0_per_mm"], p["cornea_j45_per_mm"])
        for surface, ratio in ((front, 1), (back, p["cornea_back_ratio"])):
            surface["radius_mm"] = [ratio / (p["cornea_c_per_mm"] + j), ratio / (p["cornea_c_per_mm"] - j)]
            surface["axis_deg"] = degrees(math.atan2(p["cornea_j45_per_mm"], p["cornea_j0_per_mm"])) / 2 % 180
            surface["q"] = [q + by["cornea_q"] for q in surface["q"]]
        back["position_mm"] = p["cornea_thickness_mm"]
        iris["position_mm"] = p["anterior_chamber_depth_mm"]
        # the lens is tilted about its middle, first about x, then about y
        a, b = (math.radians(p[f"lens_tilt_{k}_deg"]) for k in "xy")
        along = (math.sin(b) * math.cos(a), -math.sin(a), math.cos(b) * math.cos(a))
        for surface, half in ((lens_front, p["lens_thickness_mm"] / 2), (lens_back, -p["lens_thickness_mm"] / 2)):
            surface["tilt_deg"] = [p["lens_tilt_x_deg"], p["lens_tilt_y_deg"]]
            surface["decentre_mm"] = [p["lens_decentre_x_mm"] + half * along[0], p["lens_decentre_y_mm"] + half * along[1]]
            surface["position_mm"] = p["anterior_chamber_depth_mm"] + p["lens_thickness_mm"] / 2 - half * along[2]
        lens_front.update(radius_mm=p["lens_anterior_radius_mm"], q=p["lens_anterior_q"])
        lens_back.update(radius_mm=-p["lens_posterior_radius_mm"], q=p["lens_posterior_q"])
        retina["position_mm"] = p["optical_axial_length_mm"]
        eye["media"]["lens"]["index"] = p["lens_index"]
        return self.f.write(f"{self.stem}-{name}.json", eye)

    def refraction(self, change):
        r = command("eye", self.moved("step", change))["refraction"]
        return [r["M_D"], r["J0_D"], r["J45_D"]]


def figure(f):
    case = patient(f)
    command("trace", case, size="64x64", samples=16, laterality="od")
    command("correct", case, laterality="od")
    found = json.loads((case / "correction" / "od" / "prescription.json").read_text())
    known = f.path("case-keratometry")
    shutil.copytree(case, known, dirs_exist_ok=True)
    command("mesh", known, keratometry="od:42.50@8/45.00@98+-0.25", laterality="od")
    truth = json.loads((here.parent.parent / "data_samples" / "sample" / "truth.json").read_text())["eyes"]["od"]["optics"]
    r = command("eye", f.write("truth.json", truth))["refraction"]
    true_D = math.sqrt(r["M_D"] ** 2 + r["J0_D"] ** 2 + r["J45_D"] ** 2)
    size, draws = (160, 2000) if f.quick else (300, 4000)
    shown = []
    def look(picture, file):
        f.trace(picture, eye=file, scene="letters:distance_mm=inf,extent_deg=12", size=f"{size}x{size}", field_mm="3.6x3.6", pupil=3,
                samples=64 if f.quick else 256)
    look("truth.png", f.path("truth.json"))
    for stem, folder in (("mri", case), ("keratometer", known)):
        eye = MeasuredEye(f, folder, stem)
        still = [0.0] * len(eye.values)
        centre = eye.refraction(still)
        slopes = []
        for k in range(len(still)):
            step = math.sqrt(eye.covariance[k][k])
            ends = [eye.refraction(still[:k] + [s * step] + still[k + 1:]) for s in (-1, 1)]
            slopes.append([(b - a) / (2 * step) for a, b in zip(*ends)])
        low, rng = cholesky(eye.covariance), random.Random(1)
        drawn = []
        for _ in range(draws):
            z = [rng.gauss(0, 1) for _ in still]
            change = [sum(r * v for r, v in zip(row[:i + 1], z)) for i, row in enumerate(low)]
            r = [c + sum(d * s[k] for d, s in zip(change, slopes)) for k, c in enumerate(centre)]
            drawn.append((math.sqrt(sum(x * x for x in r)), r, change))
        drawn.sort(key=lambda eye: eye[0])
        mean = sum(r[0] for _, r, _ in drawn) / draws
        sigma = math.sqrt(sum((r[0] - mean) ** 2 for _, r, _ in drawn) / draws)
        f.number(f"{stem}: standard deviation of M, D", sigma)
        if stem == "mri":
            low_D, high_D = found["M_D"]["ci95"]
            at_spectacle = 1 / (1 + 0.001 * found["vertex_distance_mm"] * mean) ** 2  # d M/(1 + v M) / dM
            f.number("mri: half the 95 % interval of M over that of emmetrope correct", 1.96 * sigma * at_spectacle / ((high_D - low_D) / 2),
                     0.95, 1.05)
        picks = {"sharpest": drawn[round(0.025 * draws)], "blurriest": drawn[round(0.975 * draws)]}
        cases = [("sharpest", *picks["sharpest"]), ("best estimate", math.sqrt(sum(x * x for x in centre)), centre, still),
                 ("blurriest", *picks["blurriest"])]
        f.number(f"{stem}: the phantom's true blur, D, within the interval", true_D, cases[0][1], cases[2][1])
        for label, blur, linear, change in cases:
            file = eye.moved(label.replace(" ", "-"), change)
            f.number(f"{stem}, {label}: length of (M, J0, J45), D", blur)
            exact = command("eye", file)["refraction"]
            f.number(f"{stem}, {label}: M traced less M by slopes, D", exact["M_D"] - linear[0], -0.25, 0.25)
            look(picture := f"{stem}-{label.replace(' ', '-')}.png", file)
            shown.append((picture, f"{'MRI' if stem == 'mri' else 'keratometer'}, {label}: {blur:.1f} D"))
        shown.append(("truth.png", f"the true eye: {true_D:.1f} D"))
    f.sheet("uncertainty.png", 4, 240, *shown)
