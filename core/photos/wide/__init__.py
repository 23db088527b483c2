"""Photos of wide lenses, cut into pinhole pictures."""
