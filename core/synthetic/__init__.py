"""The built-in sample: a procedural room with exact truth, and photos of it that no renderer of ours would draw."""

from .room import make_scene
from .sample import SampleFiles, make_photo, perturb_camera, sample_cameras, write_sample

__all__ = ["SampleFiles", "make_photo", "make_scene", "perturb_camera", "sample_cameras", "write_sample"]
