"""Views of a splat drawn by Blender's own gpu module: the pictures of `core.render`, from the graphics card."""
