#!/usr/bin/env python3
"""Draws architecture.svg, beside this file, from tests/architecture/layers.txt. A box may use what it stands on.

Usage: docs/pictures/architecture.py [OUTPUT]   (default: architecture.svg beside this file)
"""
import html
import pathlib
import sys
import textwrap

here = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(here.parent.parent / "tests" / "architecture"))
sys.dont_write_bytecode = True
from check_includes import Layers  # noqa: E402

layers = Layers(here.parent.parent / "tests" / "architecture" / "layers.txt")
# In the order in which a case meets them, with what each leaves for the next: the only words that layers.txt has not.
stages = {
    "phantom": "DICOM study",
    "segmentation": "fit.json",
    "meshing": "meshes, optics.json",
    "trace": "wavefront.json",
    "correction": "prescription.json",
    "report": "HTML, PDF, DICOM",
}
colours = {"ground": "#e8e4da", "tracer's library": "#dbe6f1", "driver": "#ece2ee", "phantom": "#eef0e2"}
stage_colour, line, faint = "#e3efe3", "#4a4a4a", "#5a5a5a"
margin, gap, column, row, inset = 16, 12, 188, 46, 8
width = 2 * margin + len(stages) * column + (len(stages) - 1) * gap

drawing = []


def box(x, y, w, h, fill, stroke=line):
    drawing.append(f'<rect x="{x}" y="{y}" width="{w}" height="{h}" rx="4" fill="{fill}" stroke="{stroke}"/>')


def text(x, y, words, size=12, weight="normal", colour="#1a1a1a", anchor="start"):
    drawing.append(f'<text x="{x}" y="{y}" font-size="{size}" font-weight="{weight}" fill="{colour}" '
                   f'text-anchor="{anchor}">{html.escape(words)}</text>')


def room(x, y, w, folder, name):
    """A folder with what is in it."""
    box(x, y, w, row - 4, "#ffffff", "#9a9a9a")
    text(x + 6, y + 14, name, weight="bold")
    for i, words in enumerate(textwrap.wrap(layers.subject[folder], int((w - 12) / 5.3))[:2]):
        text(x + 6, y + 26 + 11 * i, words, 10, colour=faint)


def rooms_of(part):
    """Its folders; of segmentation those of reading too, which only the report sees besides."""
    parts = {part, "reading"} if part == "segmentation" else {part}
    return [folder for folder in layers.folders if layers.part_of[folder] in parts]


def short(folder):
    """A folder's name less its part's: eye/surfaces, scene."""
    return folder.split("/", 1)[1]


def head_of(folders):
    return min(folders, key=len) if len(folders) > 1 else folders[0]


def stack(part, x, bottom, title, fill, height):
    """A part as a column: its folders bottom to top, its title above them."""
    box(x, bottom - height, column, height, fill)
    text(x + inset, bottom - height + 18, title, 13, "bold")
    for i, folder in enumerate(rooms_of(part)):
        room(x + inset, bottom - inset - (i + 1) * row + 4, column - 2 * inset, folder, folder.split("/")[-1])


def shelf(part, x, w, bottom, title, fill, columns):
    """A part as a shelf: its folders from left to right, the lowest row first. Returns its top."""
    folders = rooms_of(part)
    rows = -(-len(folders) // columns)
    height = rows * row + 26 + inset
    box(x, bottom - height, w, height, fill)
    text(x + inset, bottom - height + 18, title, 13, "bold")
    cell = (w - 2 * inset + 6) / columns
    for i, folder in enumerate(folders):
        left = x + inset + (i % columns) * cell
        room(left, bottom - inset - (i // columns + 1) * row + 4, cell - 6, folder, short(folder))
    return bottom - height


def draw():
    on_library = [name for name in stages if "tracer's library" in layers.sees[name]]
    tallest = max(len(rooms_of(name)) for name in on_library)
    library_rows = -(-len(rooms_of("tracer's library")) // 4)
    ground_rows = -(-len(rooms_of("ground")) // 6)
    ground_height, library_height = ground_rows * row + 26 + inset, library_rows * row + 26 + inset
    top_of_stages = margin + 36 + gap + 50
    top_of_library = top_of_stages + tallest * row + 34 + inset
    top_of_ground = top_of_library + library_height + gap
    height = top_of_ground + ground_height + margin + 22

    tops = [("pipeline/driver", "all stages of a study"), ("pipeline/follow", "growth over visits"),
            ("pipeline/cohort", "many studies, sweeps"), ("pipeline/pacs", "archives")]
    wide = (width - 2 * margin - (len(tops) - 1) * gap) / len(tops)
    for place, (name, what) in enumerate(tops):
        x = margin + place * (wide + gap)
        box(x, margin, wide, 36, colours["driver"])
        text(x + inset, margin + 23, name, 13, "bold")
        text(x + inset + 8.2 * len(name), margin + 23, what, 11, colour=faint)

    for i, (name, leaves) in enumerate(stages.items()):
        x = margin + i * (column + gap)
        high = name in on_library
        bottom = top_of_library - gap if high else top_of_ground - gap
        folder = head_of(rooms_of(name))
        stack(name, x, bottom, folder, colours.get(name, stage_colour), bottom - top_of_stages)
        # What it leaves, on the way to the next.
        y = margin + 36 + gap + 22
        last = i + 1 == len(stages)
        text(x + column - (0 if last else 26), y, leaves, 11, "bold", anchor="end")
        if not last:
            drawing.append(f'<path d="M{x + column - 20} {y - 4} h{gap + 34}" stroke="{line}" stroke-width="1.5" '
                           'marker-end="url(#head)"/>')

    first = list(stages).index(on_library[0])
    x = margin + first * (column + gap)
    shelf("tracer's library", x, width - margin - x, top_of_ground - gap, "raytrace: the tracer's library",
          colours["tracer's library"], 4)
    shelf("ground", margin, width - 2 * margin, top_of_ground + ground_height, "the ground: pipeline/base and pipeline/eye",
          colours["ground"], 6)
    text(margin, height - margin + 2, "A box uses what it stands on and what lies below that; inside a box, a folder "
         "uses those below it and to its left. Stages meet in files only. Tests see everything.", 11, colour=faint)
    return "\n".join([
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{width}" height="{height}" viewBox="0 0 {width} {height}" '
        'font-family="DejaVu Sans, Verdana, sans-serif">',
        "<title>What stands on what: the layers of Emmetrope</title>",
        f'<defs><marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        f'<path d="M0 0 8 4 0 8z" fill="{line}"/></marker></defs>',
        f'<rect width="{width}" height="{height}" fill="#ffffff"/>', *drawing, "</svg>", ""])


if __name__ == "__main__":
    output = pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else here / "architecture.svg"
    output.write_text(draw())
