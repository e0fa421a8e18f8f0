"""What the stages left in a case folder."""

import json
import pathlib

from . import _emmetrope

_stages = {"fit": ("segmentation", "segment"), "biometry": ("meshing", "mesh"), "wavefront": ("raytrace", "trace"),
           "prescription": ("correction", "correct")}


def _fault(kind, status, message, remedy):
    error = kind(message)
    error.status, error.remedy = status, remedy
    return error


class Case:
    """A case folder, read as it is asked for. What the commands refuse, a file that was changed or a result of an earlier
    meshing, raises InputError. A measured number is a dictionary of value, ci95, source and image_share; one that the
    images do not support has the value None and the reason in withheld."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        if not self.folder.is_dir():
            raise _fault(_emmetrope.InputError, 3, f"{folder} is no folder", "emmetrope run makes one of a study")

    @property
    def eyes(self):
        """"od" and "os", as far as the case has them."""
        return [eye for eye in ("od", "os") if (self.folder / "meshing" / eye / "biometry.json").exists()]

    def fit(self, eye):
        """Parameters fitted to the voxels, with covariance."""
        return self._read("fit", eye)

    def biometry(self, eye):
        """Lengths, radii, keratometry."""
        return self._read("biometry", eye)

    def wavefront(self, eye):
        """Zernike terms and image quality of the eye that was traced."""
        return self._read("wavefront", eye)

    def prescription(self, eye):
        """The lens that was found, and its uncertainty."""
        return self._read("prescription", eye)

    def eye(self, eye, **options):
        """The measured eye as an optical system: Eye.from_case of this folder."""
        return _emmetrope.Eye.from_case(str(self.folder), eye, **options)

    def _read(self, name, eye):
        if eye not in ("od", "os"):
            raise _fault(_emmetrope.UsageError, 2, f'eye: "{eye}" is unknown', "give od or os")
        stage, command = _stages[name]
        _emmetrope._require_finished(str(self.folder), stage)
        file = self.folder / stage / eye / f"{name}.json"
        if not file.exists():
            raise _fault(_emmetrope.InputError, 3, f"{file} does not exist",
                         f"run emmetrope {command} {self.folder}; its stage.json has the reasons")
        return json.loads(file.read_text())
