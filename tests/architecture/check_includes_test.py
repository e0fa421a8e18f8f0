"""check_includes.py fails on what it forbids: each made-up tree holds one fault, and the complaint names it."""
import pathlib
import subprocess
import sys
import tempfile

here = pathlib.Path(__file__).resolve().parent
layers = """
[ground]
base = what all use
[library] ground
lenses = lenses
[one] ground, library
one/parts = parts
one = a stage
[two] ground
two = another stage
[tests] everything
tests = tests
"""
sound = {
    "base/files.hpp": "#include <string>\n",
    "lenses/lens.hpp": '#include "base/files.hpp"\n',
    "one/parts/part.cpp": '#include "lenses/lens.hpp"\n',
    "one/stage.cpp": '#include "one/parts/part.hpp"\n#include "generated.hpp"\n',
    "one/parts/part.hpp": "",
    "two/stage.hpp": '#include "base/files.hpp"\n',
    "tests/support/fixture.hpp": '#include "two/stage.hpp"\n#include "one/parts/part.hpp"\n',
}
part = "one/parts/part.hpp"
faults = {
    "an include that runs up": (
        {"base/files.hpp": '#include "lenses/lens.hpp"\n', "lenses/lens.hpp": ""}, "",
        "base/files.hpp: includes lenses/lens.hpp, which runs up\n"),
    "one that runs up by a relative path": (
        {part: '#include "../stage.hpp"\n', "one/stage.hpp": "", "one/stage.cpp": ""}, "",
        f"{part}: includes one/stage.hpp, which runs up\n"),
    "a cycle": (
        {part: '#include "one/stage.hpp"\n', "one/stage.hpp": ""}, "",
        f"{part}: includes one/stage.hpp, which runs up, and round: one/parts -> one -> one/parts\n"),
    "a stage that sees another": (
        {"two/stage.hpp": f'#include "{part}"\n'}, "", f"two/stage.hpp: includes {part}, which leaves what [two] sees\n"),
    "a folder in no layer": ({"three/stage.cpp": ""}, "", "three/stage.cpp: its folder is no layer\n"),
    "a layer without a folder": ({}, "[four]\nfour = nothing\n", "four: is a layer, but no folder\n"),
    "a known exception that is gone": (
        {}, "known base/files.hpp -> lenses/lens.hpp\n",
        "base/files.hpp -> lenses/lens.hpp: known to run up, but does not: strike the line\n"),
}


def run(files, more_layers):
    with tempfile.TemporaryDirectory() as folder:
        for name, text in {**sound, **files}.items():
            file = pathlib.Path(folder, "tree", name)
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
        pathlib.Path(folder, "layers.txt").write_text(layers + more_layers)
        ended = subprocess.run([sys.executable, here / "check_includes.py", f"{folder}/tree", f"{folder}/layers.txt"],
                               capture_output=True, text=True)
        return ended.returncode, ended.stdout


missed = []
if run({}, "")[0] != 0:
    missed.append(f"a sound tree fails: {run({}, '')[1]}")
for name, (files, more_layers, told) in faults.items():
    status, output = run(files, more_layers)
    if status != 1 or output != told:
        missed.append(f"{name}: status {status}, told {output!r} instead of {told!r}")
sys.exit("\n".join(missed) or 0)
