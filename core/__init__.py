"""GS-SMC engine: the exact camera of a photograph inside a 3D Gaussian Splatting scan. Plain Python; never imports bpy."""
