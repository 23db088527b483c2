"""Pins: pairs of a pixel of the photo and a point of the splat, set by hand, and the camera that they place."""
