"""Tracking a plate in Blender: every frame, its errors, and the frames that the user pinned."""
