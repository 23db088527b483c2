"""What several stages use: matches, the lens as an unknown, least squares, the photo at working size."""
