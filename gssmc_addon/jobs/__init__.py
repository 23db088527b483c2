"""Work in a thread beside Blender, and the operators that wait for it."""
