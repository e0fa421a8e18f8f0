"""Fails on a page for developers that names what is not there: a path, an identifier, a link.

In `backticks`: a path (with a slash or an ending, from the tree's root; * stands for any text), an identifier, which
some source must hold as a word, or a command, whose paths into the tree must exist. Left out: upper-case words, which
stand for something else, and what is built.

Usage: check_names.py [TREE]   (default: this tree)
"""
import pathlib
import re
import sys

pages = ["docs/architecture.md", "docs/extending.md", "CONTRIBUTING.md"]
corpus = {".cpp", ".hpp", ".cl", ".py", ".cmake", ".txt", ".json", ".mustache"}
identifier = re.compile(r"[A-Za-z_]\w*(::[A-Za-z_]\w*)*(\(\))?")


class Tree:
    """Its files, and the text of its sources; documentation, these checks, build trees and cases left out."""

    def __init__(self, root):
        self.root = root
        entries = [entry for entry in root.iterdir() if not re.match(r"build|case|\.", entry.name)]
        self.tops = {entry.name for entry in entries if entry.is_dir()}
        self.names, texts = {entry.name for entry in entries}, []
        for file in [file for entry in sorted(entries) for file in (entry.rglob("*") if entry.is_dir() else [entry])]:
            place = file.relative_to(root).parts
            if "node_modules" in place or not file.is_file():
                continue
            self.names.add(file.name)
            if place[0] != "docs" and place[:2] != ("tests", "architecture") and file.suffix in corpus:
                texts.append(file.read_text(errors="replace"))
        self.text = "\n".join(texts)
        self.words = set(re.findall(r"\w+", self.text))

    def has(self, path):
        return any(True for _ in self.root.glob(path.rstrip("/")))


def complaint(tree, code):
    """What is wrong with one piece of code in the text; empty where nothing is."""
    if " " in code:
        gone = [part for part in code.split() if part.split("/")[0] in tree.tops and "/" in part and not tree.has(part)]
        return f"{gone[0]} is not there" if gone else ""
    if re.match(r"build[^/]*/", code):
        return ""
    if "/" in code:
        return "" if tree.has(code) else "no such file or folder"
    if re.search(r"\.[a-z]+$", code):  # a file's name alone: one of the tree, or one that a stage writes
        return "" if code in tree.names or code in tree.text else "no such file"
    if identifier.fullmatch(code) and not code.isupper():
        missing = [name for name in re.findall(r"\w+", code) if name not in tree.words]
        return f"no source holds {', '.join(missing)}" if missing else ""
    return ""


def check(root):
    """The complaints, one a line."""
    tree = Tree(root)
    complaints = []
    for page in pages:
        text = re.sub(r"^```.*?^```", "", (root / page).read_text(), flags=re.MULTILINE | re.DOTALL)
        for code in [" ".join(code.split()) for code in re.findall(r"`([^`]+)`", text)]:
            wrong = complaint(tree, code)
            if wrong:
                complaints.append(f"{page}: `{code}`: {wrong}")
        for link in re.findall(r"\]\(([^)#]+)(?:#[^)]*)?\)", text):
            if not re.match(r"[a-z]+:", link) and not (root / page).parent.joinpath(link).exists():
                complaints.append(f"{page}: the link to {link} leads nowhere")
    return complaints


if __name__ == "__main__":
    complaints = check(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2])
    print("\n".join(complaints) or f"{', '.join(pages)}: all that they name is there")
    sys.exit(1 if complaints else 0)
