"""One file for each way to find and describe keypoints."""
