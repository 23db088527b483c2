"""How many trials there are of each fault."""

# By command: batch, batch finding, batch whole, locate, map, track.
PLAN: dict[str, tuple[int, int, int, int, int, int]] = {
    "a worker killed": (12, 3, 1, 2, 1, 2),
    "the command killed": (12, 3, 1, 2, 2, 3),
    "Ctrl-C": (3, 1, 0, 1, 3, 3),
    "killed while writing": (10, 2, 0, 1, 2, 2),
    "disk full": (5, 2, 0, 1, 1, 1),
    "output read-only": (2, 1, 0, 1, 1, 1),
    "output folder vanishes": (5, 2, 0, 1, 0, 2),
    "slow disk": (2, 0, 0, 0, 0, 1),
    "clock jumps": (5, 2, 0, 1, 1, 1),
    "two runs on one output": (4, 1, 0, 1, 1, 1),
    "out of memory": (5, 2, 0, 1, 1, 1),
    "bytes damaged": (6, 3, 0, 2, 2, 2),
    "a picture that kills the decoder": (3, 2, 1, 1, 0, 1),
    "scan replaced": (5, 2, 0, 1, 1, 2),
    "picture replaced": (3, 1, 0, 0, 0, 1),
}
# Jobs inside Blender: refine, find, export.
BLENDER_PLAN: dict[str, tuple[int, int, int]] = {
    "a worker killed": (5, 2, 0),
    "the command killed": (2, 2, 1),
    "killed while writing": (0, 2, 2),
    "disk full": (0, 0, 2),
    "output read-only": (0, 0, 1),
    "output folder vanishes": (0, 0, 2),
    "clock jumps": (1, 1, 0),
    "out of memory": (1, 1, 0),
    "bytes damaged": (0, 4, 0),
    "scan replaced": (2, 0, 1),
}
