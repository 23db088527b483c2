"""A scan prepared for drawing: its spatial order, its blocks, and the file that all processes of a machine map."""
