"""One file for each way to match the features of two images."""
