"""Fig. 5: three pyramids seen by two eyes 62 mm apart that fixate the first, then the second; and a squinting pair."""
import json
import math

from paper import a_second, command, measure, plane, png, processor_s

apices = {"first": (0, 0, 200), "second": (-45, 8, 350)}
centre_mm, distance_mm = 13.5, 62


def sub(a, b):
    return [x - y for x, y in zip(a, b)]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def unit(a):
    return [x / math.sqrt(dot(a, a)) for x in a]


def turn(v, axis, angle):
    """Rodrigues' formula."""
    c, s, k = math.cos(angle), math.sin(angle), dot(axis, v)
    return [c * x + s * y + (1 - c) * k * z for x, y, z in zip(v, cross(axis, v), axis)]


def in_eye(point, fixated, side, deviation=0):
    """A point of the scene in the frame of an eye that fixates another one: Listing's law about the centre of rotation."""
    centre = [side * distance_mm / 2, 0, -centre_mm]
    ahead = [0, 0, 1]
    sight = unit(sub(fixated, centre))
    axis, angle = unit(cross(ahead, sight)), math.acos(sight[2])
    if deviation:
        sight = turn(unit([deviation / 100, 0, 1]), axis, angle)
        axis, angle = unit(cross(ahead, sight)), math.acos(sight[2])
    p = turn(sub(point, centre), axis, -angle)
    return [p[0], p[1], p[2] - centre_mm]


def movie(f):
    """Both eyes' pictures side by side while they turn from the first apex to the second and back, and accommodate."""
    frames, hold = (4, 1) if f.quick else (72, 12)
    turning = frames // 2 - hold
    rows, began = ["frame,x_mm,y_mm,z_mm,od_horizontal_deg,od_vertical_deg,os_horizontal_deg,os_vertical_deg,accommodation_D"], processor_s()
    for k in range(frames):
        t = min(1.0, max(0, k % (frames // 2) - hold + 1) / turning)
        t = t * t * (3 - 2 * t)
        a, b = (apices[name] for name in (("first", "second") if k < frames // 2 else ("second", "first")))
        z = 1 / ((1 - t) / a[2] + t / b[2])  # even in vergence
        x, y = (z * ((1 - t) * a[i] / a[2] + t * b[i] / b[2]) for i in (0, 1))
        D = 1000 / z
        answer = f.trace(f"turn{k:03d}.png", eye="navarro", accommodation=f"{D:.4f}", pupillary_distance=distance_mm, fixate=f"{x:.4f},{y:.4f},{z:.4f}",
                         scene="pyramids", size="240x240", field_mm="8x8", samples=16 if f.quick else 48)
        gaze = [answer["eyes"][eye]["gaze_deg"] for eye in ("od", "os")]
        rows.append(f"{k},{x:.3f},{y:.3f},{z:.3f}," + ",".join(f"{v:.4f}" for pair in gaze for v in pair) + f",{D:.4f}")
        measure("sheet", f.path(f"pair{k:03d}.png"), 2, 240, f"{f.path(f'turn{k:03d}-od.png')}=right eye", f"{f.path(f'turn{k:03d}-os.png')}=left eye")
    f.write("fig5.csv", "\n".join(rows) + "\n")
    f.number("movie: pairs of pictures a second, each from nothing, by processor time", a_second(frames, began))
    measure("movie", f.path("fig5.avi"), 24, *[f.path(f"pair{k:03d}.png") for k in range(frames)])


def figure(f):
    size, field = (400, 8) if f.quick else (600, 8)
    samples = 64 if f.quick else 256
    pixel = field / size
    # The pyramids' sides look different to each eye; what is measured are dark squares in the places of two apices.
    png(f.path("black.png"), [[0.0, 0.0], [0.0, 0.0]])
    f.write("marks.json", {"objects": [plane(list(p), p[2] / 150, p[2] / 150, "black.png") for p in apices.values()]})

    def centroid(picture, x, y):
        reach = 20
        found = measure("dark", f.path(picture), round(x) - reach, round(y) - reach, 2 * reach + 1, 2 * reach + 1)
        return found["x"] + 0.5, found["y"] + 0.5

    for name, D in (("first", 5), ("second", 2.86)):
        eye = f.path(f"eye-{name}.json")
        command("eye", "navarro", "-o", eye, accommodation=D)
        pupil_mm = command("eye", eye)["entrance_pupil"]["position_mm"]
        def place(point, fixated, side, deviation=0):
            """Its pixel: the chief ray through the entrance pupil, traced to the retina by the host."""
            p = in_eye(point, fixated, side, deviation)
            hits = command("ray", eye=eye, **{"from": ",".join(map(str, p)), "to": f"0,0,{-pupil_mm}"})["hits"]
            x, y, _ = hits[-1]["position_mm"]
            return size / 2 + x / pixel, size / 2 + y / pixel
        fixated = apices[name]
        at = ",".join(map(str, fixated))
        f.trace(f"{name}.png", eye=eye, pupillary_distance=distance_mm, fixate=at, scene="pyramids", size=f"{size}x{size}",
                field_mm=f"{field}x{field}", samples=samples)
        f.trace(f"marks-{name}.png", eye=eye, pupillary_distance=distance_mm, fixate=at, scene=f.path("marks.json"),
                size=f"{size}x{size}", field_mm=f"{field}x{field}", samples=samples, wavelength=589.3)
        expected, found = {}, {}
        for point, apex in apices.items():
            for side, eye_name in ((-1, "od"), (1, "os")):
                expected[point, side] = place(apex, fixated, side)
                found[point, side] = centroid(f"marks-{name}-{eye_name}.png", *expected[point, side])
        other = "second" if name == "first" else "first"
        f.number(f"fixating the {name}: its own disparity, pixels", found[name, 1][0] - found[name, -1][0], -0.5, 0.5)
        disparity = found[other, 1][0] - found[other, -1][0]
        f.number(f"fixating the {name}: disparity of the {other}, mm on the retina", disparity * pixel)
        f.number(f"fixating the {name}: disparity of the {other} over that of geometry", disparity / (expected[other, 1][0] - expected[other, -1][0]), 0.98, 1.02)
    movie(f)
    # a left eye 15 prism dioptres outward sees the first pyramid displaced
    eye = f.path("eye-first.json")
    f.trace("squint.png", eye=eye, pupillary_distance=distance_mm, fixate="0,0,200", strabismus="os:15,0", scene="pyramids",
            size=f"{size}x{size}", field_mm=f"{field}x{field}", samples=samples)
    f.trace("marks-squint.png", eye=eye, pupillary_distance=distance_mm, fixate="0,0,200", strabismus="os:15,0",
            scene=f.path("marks.json"), size=f"{size}x{size}", field_mm=f"{field}x{field}", samples=samples, wavelength=589.3)
    p = in_eye(apices["first"], apices["first"], 1, 15)
    pupil_mm = command("eye", eye)["entrance_pupil"]["position_mm"]
    hit = command("ray", eye=eye, **{"from": ",".join(map(str, p)), "to": f"0,0,{-pupil_mm}"})["hits"][-1]["position_mm"]
    found = centroid("marks-squint-os.png", size / 2 + hit[0] / pixel, size / 2)[0] - size / 2
    f.number("15 prism dioptres: displacement of what the other eye fixates over that of geometry", found * pixel / hit[0], 0.98, 1.02)
    f.sheet("fig5.png", 2, 300, ("first-od.png", "first fixated, right eye"), ("first-os.png", "left eye"),
            ("second-od.png", "second fixated, right eye"), ("second-os.png", "left eye"),
            ("squint-od.png", "first fixated, right eye"), ("squint-os.png", "left eye 15 prism dioptres outward"))
