"""Fails on an include that runs up or round: the order of the folders stands in layers.txt, beside this file.

Usage: check_includes.py [TREE [LAYERS]]   (default: this tree and its layers.txt)
"""
import os
import pathlib
import re
import sys

sources = {".cpp", ".hpp", ".h", ".cl", ".in"}
included = re.compile(r'^\s*#\s*include\s+"([^"]+)"', re.MULTILINE)


class Layers:
    """Folders bottom to top, the part that each belongs to, the parts that a part sees."""

    def __init__(self, file):
        self.folders, self.part_of, self.subject, self.sees, self.known = [], {}, {}, {}, set()
        for line in file.read_text().splitlines():
            if not line.strip() or line.startswith("#"):
                continue
            if line.startswith("known "):
                self.known.add(tuple(name.strip() for name in line.removeprefix("known ").split("->")))
            elif line.startswith("["):
                part, seen = line[1:].split("]")
                self.sees[part] = [part, *(name.strip() for name in seen.split(",") if name.strip())]
            else:
                folder, subject = (text.strip() for text in line.split("="))
                self.folders.append(folder)
                self.part_of[folder] = list(self.sees)[-1]
                self.subject[folder] = subject

    def folder_of(self, file):
        """The layer of a file; folders below `tests` are one layer. None where it is in no layer."""
        folder = os.path.dirname(file)
        return "tests" if folder.split("/")[0] == "tests" else folder if folder in self.part_of else None

    def complaint(self, source, target):
        """Why `source` may not include from `target`; empty where it may."""
        if self.folders.index(target) > self.folders.index(source):
            return "runs up"
        seen = self.sees[self.part_of[source]]
        return "" if self.part_of[target] in seen or "everything" in seen else f"leaves what [{self.part_of[source]}] sees"


def source_files(tree):
    """Paths of the sources, from the tree's root; build trees, cases and hidden folders left out."""
    for folder, below, names in os.walk(tree):
        at_top = pathlib.Path(folder) == tree
        below[:] = [name for name in sorted(below)
                    if not name.startswith(".") and name != "node_modules" and not (at_top and re.match("build|case", name))]
        for name in sorted(names):
            if pathlib.Path(name).suffix in sources:
                yield (pathlib.Path(folder) / name).relative_to(tree).as_posix()


def includes_of(tree, file):
    """What a file includes of the tree; generated files and those of libraries left out."""
    for name in included.findall((tree / file).read_text()):
        for path in (name, os.path.normpath(os.path.join(os.path.dirname(file), name))):
            if (tree / path).is_file():
                yield path
                break


def way(arrows, start, end):
    """Folders from `start` to `end` along includes, the shortest way; None where there is none."""
    ways = [[start]]
    reached = {start}
    for path in ways:
        if path[-1] == end:
            return path
        for target in sorted(arrows.get(path[-1], ())):
            if target not in reached:
                reached.add(target)
                ways.append([*path, target])
    return None


def check(tree, layers):
    """The complaints about a tree, one a line."""
    complaints, arrows, found = [], {}, []
    for folder in layers.folders:
        if not (tree / folder).is_dir():
            complaints.append(f"{folder}: is a layer, but no folder")
    for file in source_files(tree):
        source = layers.folder_of(file)
        if source is None:
            complaints.append(f"{file}: its folder is no layer")
            continue
        for path in includes_of(tree, file):
            target = layers.folder_of(path)
            if target is None or target == source:
                continue
            arrows.setdefault(source, set()).add(target)
            found.append((file, path, source, target))
    known = set()
    for file, path, source, target in found:
        complaint = layers.complaint(source, target)
        if not complaint:
            continue
        if (file, path) in layers.known:
            known.add((file, path))
            continue
        back = way(arrows, target, source)
        round_trip = f", and round: {' -> '.join([source, *back])}" if back else ""
        complaints.append(f"{file}: includes {path}, which {complaint}{round_trip}")
    for file, path in sorted(layers.known - known):
        complaints.append(f"{file} -> {path}: known to run up, but does not: strike the line")
    return complaints


if __name__ == "__main__":
    here = pathlib.Path(__file__).resolve().parent
    tree = pathlib.Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else here.parent.parent
    layers = Layers(pathlib.Path(sys.argv[2]) if len(sys.argv) > 2 else here / "layers.txt")
    complaints = check(tree, layers)
    print("\n".join(complaints) or f"{len(layers.folders)} folders, every include runs down; {len(layers.known)} known exceptions")
    sys.exit(1 if complaints else 0)
