"""The PLY family: 3DGS, 2DGS, Mip-Splatting and compressed PLY."""
