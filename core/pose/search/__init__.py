"""The loop of views around a start: multi-view consistency, then epipolar refinement."""
