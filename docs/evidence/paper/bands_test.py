"""A number outside its band ends a run with status 1: the eye of this run ignores --wavelength, as if glass had no dispersion."""
import os
import pathlib
import subprocess
import sys
import tempfile

here = pathlib.Path(__file__).resolve().parent
commands = pathlib.Path(os.environ["EMMETROPE_BIN"])
with tempfile.TemporaryDirectory() as folder:
    bin = pathlib.Path(folder) / "bin"
    bin.mkdir()
    for command in commands.iterdir():
        (bin / command.name).symlink_to(command)
    (bin / "emmetrope-eye").unlink()
    (bin / "emmetrope-eye").write_text(f"""#!{sys.executable}
import os, sys
arguments = sys.argv[1:]
while "--wavelength" in arguments:
    at = arguments.index("--wavelength")
    del arguments[at:at + 2]
os.execv("{commands / 'emmetrope-eye'}", ["emmetrope-eye", *arguments])
""")
    (bin / "emmetrope-eye").chmod(0o755)
    ended = subprocess.run([sys.executable, here / "run", "--quick", "-o", f"{folder}/out", "chromatic"], capture_output=True, text=True,
                           env={**os.environ, "EMMETROPE_BIN": str(bin)})
    print(ended.stdout, ended.stderr)
    told = "chromatic: chromatic difference at 450 nm, D = 0 lies outside -1.119 to" in ended.stdout
    sys.exit(0 if ended.returncode == 1 and told else "run did not say that a number left its band")
