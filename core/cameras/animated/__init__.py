"""Files of one camera that moves, frame by frame."""
