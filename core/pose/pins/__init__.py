"""Cameras placed by hand: pairs of a pixel of the photo and a point of the scan."""
