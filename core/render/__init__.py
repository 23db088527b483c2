"""CPU rasteriser for 3D Gaussian scenes, with exact INRIA semantics."""

from .processes import ProcessRenderer
from .reference import render_reference
from .renderer import Renderer
from .view import RenderedView, RenderSettings

__all__ = ["ProcessRenderer", "RenderSettings", "RenderedView", "Renderer", "render_reference"]
