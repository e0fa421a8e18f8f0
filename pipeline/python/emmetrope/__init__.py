"""The optics of human eyes: exact rays, wavefronts, refractions and retinal images, on numpy arrays.

Lengths are in mm, angles in degrees, powers in dioptres and wavelengths in nm, as names say. The eye's frame has +z out
of the eye, its origin at the corneal apex, +x to the patient's left and +y up. For research use; not a medical device.

`commands` runs the stages on studies and cases, `Case` reads what they left.
"""

from ._emmetrope import *  # noqa: F401,F403
from . import commands, labels
from .cases import Case

Picture.to_xarray = labels.picture  # noqa: F405
Irradiance.to_xarray = labels.irradiance  # noqa: F405
