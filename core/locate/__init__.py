"""Finding a photo's camera without any start pose: viewpoints from the splat, a map of landmarks, and hypotheses from it."""

from .build import MapStep, build_map
from .cache import MapCache, MapPlace
from .file import MapFileError, map_key, read_map, scan_digest, write_map
from .find import FindProgress, FindReport, find_camera, iterate_finding
from .hypotheses import Hypothesis
from .landmarks import LandmarkMap, MapView
from .locate import Located, PhotoLens, locate
from .settings import MapSettings

__all__ = [
    "FindProgress",
    "FindReport",
    "Hypothesis",
    "LandmarkMap",
    "Located",
    "MapCache",
    "MapFileError",
    "MapPlace",
    "MapSettings",
    "MapStep",
    "MapView",
    "PhotoLens",
    "build_map",
    "find_camera",
    "iterate_finding",
    "locate",
    "map_key",
    "read_map",
    "scan_digest",
    "write_map",
]
