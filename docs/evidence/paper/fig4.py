"""Fig. 4 and its movie: three models from near to far; the eye turns by Listing's law and accommodates from one to the next."""
import math

from paper import a_second, degrees, measure, processor_s

# Stand-ins for the paper's scanned bunny, teapot and the like: tubes and bodies of revolution, some thousand vertices each.


def grid(point, nu, nv):
    """A closed-in-v sheet of points as OBJ vertices and faces."""
    vertices = [point(i / (nu - 1), j / nv) for i in range(nu) for j in range(nv)]
    faces = [(i * nv + j, (i + 1) * nv + j, (i + 1) * nv + (j + 1) % nv, i * nv + (j + 1) % nv)
             for i in range(nu - 1) for j in range(nv)]
    return vertices, faces


def body(profile, centre=(0, 0, 0), nu=40, nv=48):
    """Of revolution about y: profile(t) gives radius and height."""
    def point(t, a):
        r, y = profile(t)
        return (centre[0] + r * math.cos(2 * math.pi * a), centre[1] + y, centre[2] + r * math.sin(2 * math.pi * a))
    return grid(point, nu, nv)


def tube(path, radius, nu=80, nv=20):
    def point(t, a):
        p, q = path(t), path(t + 1e-4)
        d = [y - x for x, y in zip(p, q)]
        n = math.sqrt(sum(x * x for x in d))
        d = [x / n for x in d]
        side = (d[1], -d[0], 0) if abs(d[2]) < 0.9 else (0, d[2], -d[1])
        n = math.sqrt(sum(x * x for x in side))
        side = [x / n for x in side]
        up = (d[1] * side[2] - d[2] * side[1], d[2] * side[0] - d[0] * side[2], d[0] * side[1] - d[1] * side[0])
        c, s, r = math.cos(2 * math.pi * a), math.sin(2 * math.pi * a), radius(t)
        return tuple(x + r * (c * y + s * z) for x, y, z in zip(p, side, up))
    return grid(point, nu, nv)


def obj(file, parts):
    lines, first = [], 1
    for vertices, faces in parts:
        lines += ["v %.5f %.5f %.5f" % v for v in vertices]
        lines += ["f " + " ".join(str(first + k) for k in face) for face in faces]
        first += len(vertices)
    file.write_text("\n".join(lines) + "\n")
    return first - 1


def ball(r, centre, stretch=1.0):
    return body(lambda t: (r * math.sin(math.pi * t) + 1e-6, -stretch * r * math.cos(math.pi * t)), centre)


def figure(f):
    teapot = [body(lambda t: (0.75 * math.sin(math.pi * (0.12 + 0.78 * t)) + 0.05, 1.2 * t - 0.6), nu=50),
              body(lambda t: (0.42 * math.cos(math.pi / 2 * t) + 1e-6, 0.6 + 0.18 * math.sin(math.pi / 2 * t))),
              ball(0.1, (0, 0.85, 0)),
              tube(lambda t: (0.6 + 0.7 * t, -0.2 + 0.65 * t * t + 0.1 * t, 0), lambda t: 0.17 - 0.1 * t),
              tube(lambda t: (-0.65 - 0.4 * math.sin(math.pi * t), 0.35 - 0.7 * t, 0), lambda t: 0.07)]
    rabbit = [ball(0.6, (0, -0.2, 0), 1.1), ball(0.36, (0.25, 0.62, 0.2)), ball(0.16, (-0.55, -0.45, -0.3)),
              tube(lambda t: (0.15 - 0.1 * t, 0.85 + 0.75 * t, 0.1 - 0.2 * t), lambda t: 0.1 * math.sin(math.pi * (0.1 + 0.88 * t)) + 0.01),
              tube(lambda t: (0.4 + 0.12 * t, 0.85 + 0.7 * t, 0.1 - 0.1 * t), lambda t: 0.1 * math.sin(math.pi * (0.1 + 0.88 * t)) + 0.01)]
    def trefoil(t):
        a = 2 * math.pi * t
        return (0.4 * (math.sin(a) + 2 * math.sin(2 * a)), 0.4 * (math.cos(a) - 2 * math.cos(2 * a)), -0.4 * math.sin(3 * a))
    knot = [tube(trefoil, lambda t: 0.2, nu=240, nv=24)]
    models = [("rabbit", rabbit, (28, -8, 220), 55, [0.55, 0.4, 0.3], 20), ("teapot", teapot, (-45, 5, 450), 100, [0.3, 0.5, 0.6], -25),
              ("knot", knot, (60, 45, 1500), 260, [0.7, 0.35, 0.15], 15)]
    objects, counts = [], []
    for name, parts, place, size, colour, turn in models:
        counts.append(obj(f.path(name + ".obj"), parts))
        objects.append({"type": "mesh", "file": name + ".obj", "size_mm": size, "position_mm": list(place), "colour": colour,
                        "rotate_deg": [10, turn, 0], "specular": 0.35, "shininess": 30})
    f.number("fewest vertices of a model", min(counts), 2000)
    f.write("scene.json", {"background": [0.75, 0.8, 0.85], "ambient": [0.2, 0.2, 0.22], "objects": objects,
                           "lights": [{"type": "directional", "direction": [-0.6, -1, 0.8], "colour": [0.85, 0.82, 0.78]}]})

    # Three fixations with smooth turns between them.
    frames = 6 if f.quick else 120
    def fixated(s):
        """The point looked at: 0 to 1 over the movie."""
        hold = 0.15
        leg = (1 - 3 * hold) / 2
        for k in (0, 1):
            start = hold + k * (hold + leg)
            if s < start:
                return models[k][2]
            if s < start + leg:
                t = (s - start) / leg
                t = t * t * (3 - 2 * t)
                a, b = models[k][2], models[k + 1][2]
                # even in vergence, as the eye accommodates
                z = 1 / ((1 - t) / a[2] + t / b[2])
                return tuple(z * ((1 - t) * p / a[2] + t * q / b[2]) for p, q in zip(a[:2], b[:2])) + (z,)
        return models[2][2]
    rows, began, worst = ["frame,x_mm,y_mm,z_mm,gaze_horizontal_deg,gaze_vertical_deg,accommodation_D,wall_s"], processor_s(), 0
    for k in range(frames):
        x, y, z = fixated(k / (frames - 1))
        accommodation = 1000 / math.sqrt(x * x + y * y + z * z)
        answer = f.trace(f"frame{k:03d}.png", eye="navarro", accommodation=f"{accommodation:.4f}", pupil=4, scene=f.path("scene.json"),
                         fixate=f"{x:.4f},{y:.4f},{z:.4f}", size="320x240", field_mm="7x5.25", samples=16 if f.quick else 64)
        h, v = answer["gaze_deg"]
        worst = max(worst, abs(h - degrees(math.atan(x / (z + 13.5)))), abs(v - degrees(math.atan(y / (z + 13.5)))))
        rows.append(f"{k},{x:.3f},{y:.3f},{z:.3f},{h:.4f},{v:.4f},{accommodation:.4f},{answer['wall_s']:.3f}")
    f.number("frames a second, each from nothing, by processor time", a_second(frames, began))
    f.write("fig4.csv", "\n".join(rows) + "\n")
    f.number("gaze against geometry, degrees at most", worst, 0, 1e-3)
    f.number("frames", frames, 6 if f.quick else 120)
    measure("movie", f.path("fig4.avi"), 24, *[f.path(f"frame{k:03d}.png") for k in range(frames)])
    f.sheet("fig4.png", 3, 320, *[(f"frame{k:03d}.png", f"{name} fixated")
                                  for k, name in ((0, "rabbit"), (frames // 2, "teapot"), (frames - 1, "knot"))])
