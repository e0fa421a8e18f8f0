"""What the figures' scripts share: running commands, drawing textures, checking numbers against their bands."""
import json
import math
import os
import pathlib
import resource
import struct
import subprocess
import sys
import zlib

here = pathlib.Path(__file__).resolve().parent
build = pathlib.Path(os.environ.get("EMMETROPE_BIN", here.parents[2] / "build" / "bin"))


class Figure:
    """A figure's folder, its numbers, and whether they lie in their bands."""

    def __init__(self, name, work, quick):
        self.name, self.quick = name, quick
        self.folder = pathlib.Path(work) / name
        self.folder.mkdir(parents=True, exist_ok=True)
        self.numbers, self.failures = {}, []

    def path(self, name):
        return self.folder / name

    def number(self, name, value, low=None, high=None):
        """Keeps a number; with a band it must lie in it."""
        if name in self.numbers:
            sys.exit(f"{self.name}: two numbers are called \"{name}\"")
        good = (low is None or value >= low) and (high is None or value <= high)
        band = [low, high] if (low, high) != (None, None) else None
        self.numbers[name] = {"value": value, "band": band} if band else {"value": value}
        mark = "" if good else "   OUTSIDE"
        print(f"  {name}: {value:.5g}" + (f"   band {low} to {high}{mark}" if band else ""), flush=True)
        if not good:
            self.failures.append(f"{self.name}: {name} = {value:.5g} lies outside {low} to {high}")
        return value

    def trace(self, out, *arguments, **options):
        """emmetrope trace ... -o OUT; keywords become flags. Returns its JSON."""
        return command("trace", *arguments, "-o", self.path(out), **options)

    def write(self, name, value):
        self.path(name).write_text(value if isinstance(value, str) else json.dumps(value))
        return self.path(name)

    def eye(self, name, change=None, **options):
        """A schematic eye as a file, its JSON changed on the way."""
        file = self.path(name.replace(":", "_") + "-base.json")
        command("eye", name, "-o", file, **options)
        eye = json.loads(file.read_text())
        if change:
            change(eye)
        return eye

    def sheet(self, out, columns, width, *labelled):
        """Pictures of this figure side by side: (file, label) pairs."""
        measure("sheet", self.path(out), columns, width, *[f"{self.path(file)}={label}" for file, label in labelled])


def patient(f, study=None):
    """A case folder of that study, else of the sample phantom, which is segmented and meshed once for all figures of a run."""
    case = f.path("case") if study else f.folder.parent / "case"
    command("segment", study or here.parents[2] / "data_samples" / "sample" / "dicom", "-o", case)
    command("mesh", case)
    return case


def processor_s():
    """Of all commands run so far."""
    return sum(resource.getrusage(resource.RUSAGE_CHILDREN)[:2])


def a_second(count, since_s):
    """How many of count things, made since that processor_s(), all cores make a second when nothing else runs on them."""
    return count * os.cpu_count() / (processor_s() - since_s)


def run(arguments):
    done = subprocess.run([str(a) for a in arguments], capture_output=True, text=True)
    if done.returncode not in (0, 8):  # 8: one eye of two
        sys.exit(f"{' '.join(str(a) for a in arguments)}\nended with status {done.returncode}:\n{done.stderr}")
    return done.stdout


def command(name, *arguments, **options):
    """An emmetrope command with --json --quiet."""
    flags = []
    for key, value in options.items():
        flags += ["--" + key.replace("_", "-")] + ([] if value is True else [value])
    answer = run([build / f"emmetrope-{name}", *arguments, *flags, "--json", "--quiet"])
    return json.loads(answer) if answer.strip() else {}


def measure(*arguments):
    return json.loads(run([build / "emmetrope-paper-measure", *arguments]))


def surface(eye, name):
    return next(s for s in eye["surfaces"] if s["name"] == name)


def png(file, rows):
    """Writes rows of linear light (numbers or triples, 0 to 1) as an sRGB PNG."""
    def encoded(v):
        v = min(1.0, max(0.0, v))
        return round(255 * (12.92 * v if v <= 0.0031308 else 1.055 * v ** (1 / 2.4) - 0.055))
    table = [encoded(i / 1023) for i in range(1024)]
    def byte(v):
        return table[round(1023 * min(1.0, max(0.0, v)))]
    colour = isinstance(rows[0][0], tuple)
    raw = bytearray()
    for row in rows:
        raw.append(0)
        raw += bytes(byte(c) for pixel in row for c in (pixel if colour else (pixel,)))
    def chunk(kind, data):
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
    header = struct.pack(">IIBBBBB", len(rows[0]), len(rows), 8, 2 if colour else 0, 0, 0, 0)
    pathlib.Path(file).write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) +
                                   chunk(b"IDAT", zlib.compress(bytes(raw), 9)) + chunk(b"IEND", b""))


def plane(centre, half_width, half_height, picture, **more):
    return {"type": "plane", "centre_mm": centre, "right_mm": [-half_width, 0, 0], "up_mm": [0, half_height, 0],
            "picture": picture, **more}


def degrees(radians):
    return radians * 180 / math.pi


def tan_deg(angle):
    return math.tan(angle * math.pi / 180)
