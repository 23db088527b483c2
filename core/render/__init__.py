"""CPU rasteriser for 3D Gaussian scenes, with exact INRIA semantics."""

from .view import RenderedView, RenderSettings

__all__ = ["RenderSettings", "RenderedView"]
