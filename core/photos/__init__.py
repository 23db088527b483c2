"""Photographs and moving plates: pixels, EXIF, masks, and the lens that a photo tells."""
