"""Numbers of the INRIA rasteriser that the fast renderer and its slow twin share."""

from __future__ import annotations

LOWPASS_PX2 = 0.3  # added to the diagonal of the 2D covariance, so that no Gaussian falls between pixel centres
JACOBIAN_MARGIN = 0.3  # the Jacobian is taken at most this many half fields of view beyond the image border
ALPHA_MIN = 1.0 / 255.0  # a weaker contribution to a pixel is skipped
ALPHA_MAX = 0.99
TRANSMITTANCE_MIN = 1e-4  # a pixel ends before its transmittance would fall below this

# Real spherical harmonics, as INRIA's code has them.
SH_C0 = 0.28209479177387814
SH_C1 = 0.4886025119029199
SH_C2 = (1.0925484305920792, -1.0925484305920792, 0.31539156525252005, -1.0925484305920792, 0.5462742152960396)
SH_C3 = (
    -0.5900435899266435,
    2.890611442640554,
    -0.4570457994644658,
    0.3731763325901154,
    -0.4570457994644658,
    1.445305721320277,
    -0.5900435899266435,
)
