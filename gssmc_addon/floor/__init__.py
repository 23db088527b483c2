"""Where the floor of a splat is and how large it is, in the scene."""
