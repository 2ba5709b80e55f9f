"""Names of the columns of the matrices that the rasteriser works on.

A row is one Gaussian (of `by_entry`: one Gaussian in one tile). The names are plain numbers because
compiled kernels take those as constants; where NumPy wants a block of columns there is a slice.

Numba's cache does not see that another file has changed: after a change here, touch
`_project_numba.py` and `_raster_numba.py`.
"""

from __future__ import annotations

# What is trained (`gaussians.Parameters`).
MEAN_X, MEAN_Y, MEAN_Z = 0, 1, 2
LOG_SCALE_X, LOG_SCALE_Y, LOG_SCALE_Z = 3, 4, 5
QUAT_W, QUAT_X, QUAT_Y, QUAT_Z = 6, 7, 8, 9
OPACITY_LOGIT = 10
SH0_R, SH0_G, SH0_B = 11, 12, 13
SH1_Y_R, SH1_Z_R, SH1_X_R = 14, 17, 20
"""Red of the three harmonics of degree 1, which grow along y, z and x; green and blue follow."""

NUM_COLUMNS = (14, 23)
"""Columns of Gaussians of degree 0 and of degree 1."""

MEANS = slice(0, 3)
LOG_SCALES = slice(3, 6)
QUATS = slice(6, 10)
SH0 = slice(11, 14)
SH = slice(11, None)
"""All coefficients, RGB by RGB: degree 0, then degree 1."""
SHN = slice(14, None)
"""The coefficients of degree 1."""

# A Gaussian projected onto the picture (`splats`).
U, V = 0, 1
"""The centre, in pixels."""
CONIC_UU, CONIC_UV, CONIC_VV = 2, 3, 4
"""The inverse of the covariance on the picture, 1/px²."""
OPACITY = 5
RED, GREEN, BLUE = 6, 7, 8
DEPTH = 9
"""Of the centre, along the camera's +z, metres."""
RADIUS_U, RADIUS_V = 10, 11
"""Half the width and height of the box in which alpha reaches `alpha_min`, pixels; 0 = unseen."""
MIN_POWER = 12
"""The logarithm of alpha / opacity at which alpha is `alpha_min`."""
NUM_SPLAT_COLUMNS = 13

# The loss's gradient by what a tile saw of a Gaussian (`by_entry`).
BY_RED, BY_GREEN, BY_BLUE = 0, 1, 2
BY_OPACITY = 3
BY_U, BY_V = 4, 5
BY_CONIC_UU, BY_CONIC_UV, BY_CONIC_VV = 6, 7, 8
NUM_ENTRY_COLUMNS = 9
