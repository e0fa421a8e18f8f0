"""docs/pictures/architecture.svg is what its script draws of layers.txt today."""
import pathlib
import subprocess
import sys
import tempfile

pictures = pathlib.Path(__file__).resolve().parents[2] / "docs" / "pictures"
with tempfile.TemporaryDirectory() as folder:
    drawn = pathlib.Path(folder) / "architecture.svg"
    subprocess.run([sys.executable, pictures / "architecture.py", drawn], check=True)
    same = drawn.read_text() == (pictures / "architecture.svg").read_text()
sys.exit(0 if same else "docs/pictures/architecture.svg is not of today's layers.txt: run docs/pictures/architecture.py")
