"""The optics of human eyes: exact rays, wavefronts, refractions and retinal images, on numpy arrays.

Lengths are in mm, angles in degrees, powers in dioptres and wavelengths in nm, as names say. The eye's frame has +z out
of the eye, its origin at the corneal apex, +x to the patient's left and +y up. For research use; not a medical device.
"""

from ._emmetrope import *  # noqa: F401,F403
