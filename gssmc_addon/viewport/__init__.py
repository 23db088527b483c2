"""Splats drawn in the 3D viewports."""
