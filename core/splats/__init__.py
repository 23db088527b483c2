"""Splat scenes: one reader per format, one in-memory form."""

from .scene import GaussianScene

__all__ = ["GaussianScene"]
