"""How photo, splat and CG lie over each other in the viewport, and how the cameras of many photos are kept out of the way."""
