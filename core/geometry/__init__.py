"""Cameras, poses, rotations, and the one place where axes are turned."""
