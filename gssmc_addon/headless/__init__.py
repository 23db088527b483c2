"""The command line inside Blender."""
