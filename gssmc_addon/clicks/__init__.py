"""Clicks in the viewport, put on the surface that the splat shows there."""
