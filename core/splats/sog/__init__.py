"""SOG, PlayCanvas' spatially ordered Gaussians: versions 1 and 2, in one archive or as files in a folder."""
