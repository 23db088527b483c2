"""What Blender is told of: properties, preferences, menus."""
