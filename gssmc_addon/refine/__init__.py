"""Refine Camera: prepared from the scene, watched, and written back."""
