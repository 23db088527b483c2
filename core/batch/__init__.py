"""Many photos: what is to be done, what came of it, and the processes that do it."""
