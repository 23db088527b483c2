"""Moving plates in Blender."""
