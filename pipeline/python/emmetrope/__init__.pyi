from typing import Any, Dict, List, Optional, Tuple

import pathlib

import numpy
import xarray
from numpy.typing import ArrayLike, NDArray

from . import commands as commands
from . import labels as labels

ray_states: Tuple[str, ...]

class Error(RuntimeError):
    status: int
    remedy: str

class UsageError(Error): ...
class InputError(Error): ...
class UnsupportedError(Error): ...
class OutputError(Error): ...
class NoResultError(Error): ...
class DeviceError(Error): ...

class PowerVector:
    M_D: float
    J0_D: float
    J45_D: float
    def __init__(self, M_D: float = 0, J0_D: float = 0, J45_D: float = 0) -> None: ...
    def sphero_cylinder(self) -> Tuple[float, float, float]: ...

class CardinalPoints:
    power_D: float
    object_focal_mm: float
    image_focal_mm: float
    object_principal_mm: float
    image_principal_mm: float
    object_nodal_mm: float
    image_nodal_mm: float

class Eye:
    name: str
    reference_wavelength_nm: float
    axial_length_mm: float
    surface_names: List[str]
    def __init__(
        self,
        name_or_file: str,
        accommodation_D: float = 0,
        accommodation_parameter: Optional[float] = None,
        pupil_mm: Optional[float] = None,
        laterality: str = "od",
    ) -> None: ...
    @staticmethod
    def from_case(
        case_folder: str,
        laterality: str = "od",
        pupil_mm: float = 4,
        age_years: Optional[float] = None,
        lens_index: Optional[float] = None,
        lens_core: bool = False,
        retinal_depth_mm: Optional[float] = None,
    ) -> Eye: ...
    @staticmethod
    def from_dict(dictionary: Dict[str, Any], folder: str = ".") -> Eye: ...
    def to_dict(self) -> Dict[str, Any]: ...
    def write(self, file: str) -> List[str]: ...
    def with_pupil(self, pupil_mm: float) -> Eye: ...
    def with_spectacle(self, lens: str) -> Eye: ...
    def cardinal_points(self, wavelength_nm: Optional[float] = None) -> CardinalPoints: ...
    def entrance_pupil(self, wavelength_nm: Optional[float] = None) -> Tuple[float, float]: ...
    def refraction(self, wavelength_nm: Optional[float] = None) -> PowerVector: ...
    def retina_seeing(
        self, horizontal_deg: float, vertical_deg: float, wavelength_nm: Optional[float] = None
    ) -> Optional[NDArray[numpy.float64]]: ...
    def line_of_sight(
        self, x_mm: float, y_mm: float, wavelength_nm: Optional[float] = None
    ) -> Optional[NDArray[numpy.float64]]: ...

def schematic_eyes() -> List[str]: ...

class Rays:
    position_mm: NDArray[numpy.float64]
    direction: NDArray[numpy.float64]
    opl_mm: NDArray[numpy.float64]
    state: NDArray[numpy.uint8]
    surface: NDArray[numpy.int32]

def trace_rays(
    eye: Eye,
    origin_mm: ArrayLike,
    direction: ArrayLike,
    wavelength_nm: Optional[float] = None,
    threads: int = 0,
) -> Rays: ...
def ray_path(
    eye: Eye, origin_mm: ArrayLike, direction: ArrayLike, wavelength_nm: Optional[float] = None
) -> List[Dict[str, Any]]: ...

class ImageQuality:
    strehl: float
    vsotf: float
    cpd: NDArray[numpy.float64]
    mtf_tangential: NDArray[numpy.float64]
    mtf_sagittal: NDArray[numpy.float64]

class Wavefront:
    wavelength_nm: float
    pupil_mm: float
    pupil_position_mm: float
    pupil_rim_mm: NDArray[numpy.float64]
    zernike_um: NDArray[numpy.float64]
    line_of_sight_deg: NDArray[numpy.float64]
    rms_um: float
    higher_order_rms_um: float
    spot_rms_arcmin: float
    fit_residual_rms_um: float
    paraxial: PowerVector
    minimum_rms_wavefront: PowerVector
    minimum_rms_spot: PowerVector
    def image_quality(self, lens_in_pupil: PowerVector = ...) -> ImageQuality: ...
    def point_spread(
        self, lens_in_pupil: PowerVector = ...
    ) -> Tuple[NDArray[numpy.float32], float, bool]: ...
    def at_vertex(self, in_pupil: PowerVector, vertex_distance_mm: float = 12) -> PowerVector: ...

def wavefront(
    eye: Eye,
    retina_mm: ArrayLike = (0, 0),
    wavelength_nm: Optional[float] = None,
    order: int = 8,
    stiles_crawford_per_mm2: float = 0,
    entrance_pupil_mm: Optional[float] = None,
) -> Wavefront: ...

def write_field(
    eye: Eye,
    folder: str,
    reach_deg: float = 60,
    step_deg: float = 5,
    wavelength_nm: Optional[float] = None,
    stiles_crawford_per_mm2: float = 0,
    threads: int = 0,
) -> None: ...

class Picture:
    linear: NDArray[numpy.float32]
    seen: NDArray[numpy.bool_]
    axes: Dict[str, NDArray[numpy.float64]]
    states: Dict[str, int]
    rays: int
    samples: int
    wall_s: float
    device: str
    def write_png(self, file: str) -> None: ...
    def to_xarray(self) -> xarray.DataArray: ...

class Irradiance:
    wavelength_nm: List[float]
    irradiance: NDArray[numpy.float32]
    photons: NDArray[numpy.float32]
    cones: NDArray[numpy.float32]
    trolands: NDArray[numpy.float32]
    axes: Dict[str, NDArray[numpy.float64]]
    seen: NDArray[numpy.bool_]
    transmittance: List[float]
    white_radiance: List[float]
    pupil_area_mm2: float
    white_trolands: float
    rays: int
    def to_xarray(self) -> xarray.Dataset: ...

class Tracer:
    device_name: str
    def __init__(self, device: str = "", threads: int = 0) -> None: ...
    def picture(
        self,
        eye: Eye,
        scene: str = "letters",
        size: Tuple[int, int] = (500, 500),
        field_mm: Optional[Tuple[float, float]] = None,
        centre_mm: ArrayLike = (0, 0),
        samples: int = 128,
        wavelength_nm: Optional[float] = None,
        seed: int = 1,
        field_deg: Optional[Tuple[float, float]] = None,
        projection: Optional[str] = None,
    ) -> Picture: ...
    def irradiance(
        self,
        eye: Eye,
        scene: str = "letters",
        size: Tuple[int, int] = (500, 500),
        field_mm: Optional[Tuple[float, float]] = None,
        centre_mm: ArrayLike = (0, 0),
        samples: int = 128,
        seed: int = 1,
        field_deg: Optional[Tuple[float, float]] = None,
        projection: Optional[str] = None,
        luminance_cd_m2: float = 100,
        bands_nm: Tuple[float, float, float] = (400, 700, 10),
        media_age_years: Optional[float] = None,
    ) -> Irradiance: ...

def correct(
    tracer: Tracer,
    eye: Eye,
    vertex_distance_mm: float = 12,
    pupil_mm: float = 3,
    criterion: str = "gradient-energy",
    wavelength_nm: float = 589.3,
    retina_mm: ArrayLike = (0, 0),
    seed: int = 1,
) -> Dict[str, Any]: ...

def sharpest_lens(
    tracer: Tracer,
    eye: Eye,
    vertex_distance_mm: float = 12,
    pupil_mm: float = 3,
    criterion: str = "gradient-energy",
    wavelength_nm: float = 589.3,
    retina_mm: ArrayLike = (0, 0),
    seed: int = 1,
) -> Tuple[PowerVector, float]: ...

class Sharpness:
    images: int
    def __init__(
        self,
        tracer: Tracer,
        eye: Eye,
        vertex_distance_mm: float = 12,
        pupil_mm: float = 3,
        criterion: str = "gradient-energy",
        wavelength_nm: float = 589.3,
        retina_mm: ArrayLike = (0, 0),
        seed: int = 1,
    ) -> None: ...
    def __call__(self, lens_D: ArrayLike) -> Tuple[float, NDArray[numpy.float64]]: ...

class Case:
    folder: pathlib.Path
    eyes: List[str]
    def __init__(self, folder: str) -> None: ...
    def fit(self, eye: str) -> Dict[str, Any]: ...
    def biometry(self, eye: str) -> Dict[str, Any]: ...
    def wavefront(self, eye: str) -> Dict[str, Any]: ...
    def prescription(self, eye: str) -> Dict[str, Any]: ...
    def eye(self, eye: str, **options: Any) -> Eye: ...
