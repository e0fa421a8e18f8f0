"""Fails on a test that lies elsewhere than what it tests: tests/FOLDER/NAME_test.cpp tests FOLDER/NAME.cpp (or .hpp).

NAME may go on with what of the file is tested (tracer_light_test.cpp); it may be FOLDER's own or that of a room in it,
where these are tested as a whole. What lies elsewhere with a reason stands in `elsewhere`.

Usage: check_test_places.py [TREE]   (default: this tree)
"""
import pathlib
import sys

elsewhere = {
    "end_to_end": "all stages, by their commands",
    "studies": "the studies' own arithmetic",
    "correction/prescription/phantom_refraction_test.cpp": "segmentation to refraction, on phantoms",
    "data_samples/phantom/sample_test.cpp": "the committed sample and the page about phantoms",
    "pipeline/report/browser_test.cpp": "the page in a browser",
    "pipeline/report/numbers_test.cpp": "the same numbers in every medium",
    "pipeline/report/parts_test.cpp": "small parts of several rooms",
    "raytrace/device/gpu_form_test.cpp": "the kernels in the form that a GPU runs",
    "segmentation/orientation_test.cpp": "reading and finding together",
    "segmentation/storage_test.cpp": "reading, finding, edges and fit together",
    "segmentation/intake/real_scans_test.cpp": "reading as a whole, on scans that are not in the tree",
}


def is_tested(folder, name):
    """Whether a test's name, less `_test`, begins with that of a file or room of the folder, or of the folder."""
    subjects = {folder.name}
    for entry in folder.iterdir():
        if entry.is_dir() or entry.suffix in (".cpp", ".hpp"):
            subjects.add(entry.stem.removesuffix("_main"))
    return any(name == subject or name.startswith(subject + "_") for subject in subjects)


def check(tree):
    """The complaints, one a line."""
    complaints, used = [], set()
    for test in sorted((tree / "tests").rglob("*_test.cpp")):
        place = test.relative_to(tree / "tests")
        reason = next((key for key in elsewhere if place.as_posix() == key or place.parts[0] == key), None)
        folder = tree / place.parent
        if reason:
            used.add(reason)
        elif not folder.is_dir():
            complaints.append(f"tests/{place}: there is no folder {place.parent}")
        elif not is_tested(folder, place.stem.removesuffix("_test")):
            complaints.append(f"tests/{place}: {place.parent} holds nothing that its name begins with")
    complaints += [f"tests/{key}: is excepted, but is not there" for key in sorted(set(elsewhere) - used)]
    return complaints


if __name__ == "__main__":
    complaints = check(pathlib.Path(sys.argv[1]) if len(sys.argv) > 1 else pathlib.Path(__file__).resolve().parents[2])
    print("\n".join(complaints) or "every test mirrors its source")
    sys.exit(1 if complaints else 0)
