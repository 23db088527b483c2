"""Find Camera: a photo's camera without any start, by a map of the whole scan that is kept for the next photo."""
