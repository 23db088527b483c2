"""Photographs in Blender: their images, cameras, masks and the list of them."""
