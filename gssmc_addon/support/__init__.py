"""What the folders of the Blender side share."""
