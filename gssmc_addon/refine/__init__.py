"""Refine Camera: gathered from the scene, watched, and written back."""
