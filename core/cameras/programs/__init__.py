"""Camera files of photogrammetry programs, a module for each: `detect` and `read`, as in the layouts of core.cameras."""
