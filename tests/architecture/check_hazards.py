"""Every hazard of docs/hazards.md has a test, and the build has it.
Usage: check_hazards.py BUILD_FOLDER"""
import fnmatch
import pathlib
import re
import subprocess
import sys


def faults_of(page, tests):
    """What is wrong with the table: one line each."""
    faults = []
    rows = [line.split("|")[1:-1] for line in page.splitlines() if line.startswith("| ") and "---" not in line]
    for cells in rows[1:]:
        hazard, named = cells[0].strip(), re.findall(r"`([^`]+)`", cells[-1])
        if not named:
            faults.append(f"no test stands against: {hazard}")
        faults += [f"{hazard}: there is no test {name}" for name in named
                   if not (fnmatch.filter(tests, name) or fnmatch.filter(tests, f"*/{name}/*"))]  # of parameters
    if len(rows) < 2:
        faults.append("the table of hazards is empty")
    return faults


def main():
    root = pathlib.Path(__file__).resolve().parents[2]
    listed = subprocess.run(["ctest", "--test-dir", sys.argv[1], "-N"], capture_output=True, text=True, check=True).stdout
    tests = re.findall(r"^ *Test +#\d+: (\S+)", listed, re.MULTILINE)
    faults = faults_of((root / "docs/hazards.md").read_text(), tests)
    print("\n".join(faults) or f"{len(tests)} tests: every hazard has its own")
    sys.exit(1 if faults else 0)


if __name__ == "__main__":
    main()
