"""Proxies: meshes that stand for a splat where Blender needs a surface. What other parts use of them is in `objects`."""
