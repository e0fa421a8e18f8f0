"""check_test_places.py, check_names.py and check_hazards.py fail on what they forbid, in made-up trees."""
import pathlib
import sys
import tempfile

sys.dont_write_bytecode = True
import check_hazards  # noqa: E402
import check_names  # noqa: E402
import check_test_places  # noqa: E402

missed = []


def expect(found, told, name):
    if found != told:
        missed.append(f"{name}: told {found} instead of {told}")


def tree(folder, files):
    for name, text in files.items():
        file = pathlib.Path(folder, name)
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(text)
    return pathlib.Path(folder)


with tempfile.TemporaryDirectory() as folder:
    root = tree(folder, {"stage/lens.cpp": "", "stage/room/part.hpp": "", "tests/stage/lens_test.cpp": "",
                         "tests/stage/lens_power_test.cpp": "", "tests/stage/room_test.cpp": "",
                         "tests/stage/gone_test.cpp": "", "tests/nowhere/lens_test.cpp": ""})
    check_test_places.elsewhere = {"stage/removed_test.cpp": "why"}
    expect(check_test_places.check(root),
           ["tests/nowhere/lens_test.cpp: there is no folder nowhere",
            "tests/stage/gone_test.cpp: stage holds nothing that its name begins with",
            "tests/stage/removed_test.cpp: is excepted, but is not there"], "misplaced tests")

with tempfile.TemporaryDirectory() as folder:
    page = """Sound: `stage/lens.cpp`, `stage/*.cpp`, `lens.cpp`, `Lens::power_D`, `fit.json`, `CASE`, [lens](stage/lens.cpp).
`stage/gone.cpp`, `Lens::gone`, `gone.json`, `stage/run stage/gone --all`, [gone](gone.md)
```
`not_read`
```
"""
    root = tree(folder, {"stage/lens.cpp": 'struct Lens { double power_D; };  // "fit.json"', "PAGE.md": page})
    check_names.pages = ["PAGE.md"]
    expect(check_names.check(root),
           ["PAGE.md: `stage/gone.cpp`: no such file or folder", "PAGE.md: `Lens::gone`: no source holds gone",
            "PAGE.md: `gone.json`: no such file", "PAGE.md: `stage/run stage/gone --all`: stage/run is not there",
            "PAGE.md: the link to gone.md leads nowhere"], "gone names")

page = """| hazard | control | test |
| --- | --- | --- |
| swapped | sides | `Sides.Hold`, `Maps.*` |
| gone | none | `Sides.Gone` |
| open | none | none |
"""
expect(check_hazards.faults_of(page, ["Sides.Hold", "Maps.AreTrue"]),
       ["gone: there is no test Sides.Gone", "no test stands against: open"], "hazards")
expect(check_hazards.faults_of("", []), ["the table of hazards is empty"], "no hazards")

sys.exit("\n".join(missed) or 0)
