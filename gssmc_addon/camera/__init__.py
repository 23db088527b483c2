"""Blender cameras: read, written, keyed, brought in and out."""
