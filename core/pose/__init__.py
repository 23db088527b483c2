"""From matches to a camera pose: two-view, coarse multi-view, fine epipolar, the loop and its verdict."""
