"""Splat objects: made from files, copied out, prepared for rendering."""
