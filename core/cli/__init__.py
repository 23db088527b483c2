"""The command line, the same under plain Python and inside Blender."""
