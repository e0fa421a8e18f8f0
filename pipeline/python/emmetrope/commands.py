"""The commands as functions: options as keywords, the answer of --json as a dictionary.

    commands.run("study", "case", age=40, keratometry=["od:43.25@175/44.75@85+-0.25"])

A keyword is the option's name with underscores for hyphens; True gives a flag, a list repeats the option, a tuple is
its numbers with commas. What there is,
and in which units, `emmetrope NAME --help` says. Each runs in a process of its own, as the command does: its notes go to
standard error (quiet=True: none), and a fault in it is an exception here. Status 8, a partial result, is none.
"""

import json
import pathlib
import shutil
import subprocess

from . import _emmetrope

_exceptions = {2: _emmetrope.UsageError, 3: _emmetrope.InputError, 4: _emmetrope.UnsupportedError,
               5: _emmetrope.OutputError, 6: _emmetrope.NoResultError, 7: _emmetrope.DeviceError}
_done, _partial = 0, 8


def _error(status, message, remedy=""):
    error = _exceptions.get(status, _emmetrope.Error)(message)
    error.status, error.remedy = status, remedy
    return error


def _program(name):
    """Beside the module in a build tree or below a prefix, else on the PATH."""
    for folder in pathlib.Path(__file__).resolve().parents:
        if (folder / "bin" / f"emmetrope-{name}").exists():
            return folder / "bin" / f"emmetrope-{name}"
    found = shutil.which(f"emmetrope-{name}")
    if found is None:
        raise _error(1, f"emmetrope-{name} is neither beside the module nor on the PATH", "install Emmetrope's programs")
    return found


def _options(keywords):
    for name, value in keywords.items():
        option = "--" + name.replace("_", "-")
        for one in value if isinstance(value, list) else [value]:
            if isinstance(one, bool) or type(one).__name__ == "bool_":  # numpy's is none of Python's
                if one:
                    yield option
            elif isinstance(one, tuple):
                yield f"{option}={','.join(map(str, one))}"
            elif one is not None:
                yield f"{option}={one}"


def _run(name, *places, **options):
    if any(place is None for place in places):
        raise _error(2, f"{name}: None is no path")
    line = [_program(name), *_options(options), "--json", "--", *map(str, places)]
    ended = subprocess.run(line, stdout=subprocess.PIPE, text=True)
    try:
        answer = json.loads(ended.stdout)
    except ValueError:
        raise _error(ended.returncode or 2, f"emmetrope-{name} ended with status {ended.returncode} and no answer") from None
    if ended.returncode in (_done, _partial):
        return answer
    fault = answer.get("error", {})
    message = fault.get("message") or "; ".join(answer.get("reasons", [])) or f"emmetrope-{name} failed"
    raise _error(ended.returncode, message, fault.get("remedy", ""))


def inventory(study, **options):
    """The series of a study and what is wrong with them."""
    return _run("inventory", study, **options)


def segment(study, case, **options):
    """Finds the eyes in a study and fits each to its voxels, into a case folder."""
    return _run("segment", study, output=case, **options)


def mesh(case, **options):
    """Surface meshes and biometry of each eye."""
    return _run("mesh", case, **options)


def trace(case=None, **options):
    """What the eyes of a case see, or (without one) eye="navarro", output="folder"."""
    return _run("trace", *([] if case is None else [case]), **options)


def correct(case=None, **options):
    """The lens that makes the retinal images of a case sharpest, or (without one) of eye="navarro", output="folder"."""
    return _run("correct", *([] if case is None else [case]), **options)


def report(case, **options):
    """The clinical report of a case."""
    return _run("report", case, **options)


def view(case=None, **options):
    """A page in which the eyes of a case look at charts, or (without one) eye="navarro", output="eye.html"."""
    return _run("view", *([] if case is None else [case]), **options)


def deidentify(case, **options):
    """A case's DICOM objects without identity, by the profile of DICOM PS3.15; output="folder"."""
    return _run("deidentify", case, **options)


def run(study, case, **options):
    """All stages, resuming what is done."""
    return _run("run", study, output=case, **options)


def phantom(folder, **options):
    """A synthetic study (FOLDER/dicom) with known truth (FOLDER/truth.json, which is the answer)."""
    return _run("phantom", output=folder, **options)
