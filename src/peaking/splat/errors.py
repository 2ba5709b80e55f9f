"""What can be wrong with files of Gaussians and with pictures to make some of."""

from peaking.errors import PeakingError


class SplatFileError(PeakingError):
    """Bytes that are not a sound .ply file of Gaussians."""


class CamerasNotFound(PeakingError):
    """COLMAP could not say where the pictures were taken."""
