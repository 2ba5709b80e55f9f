"""What can be wrong with a file of Gaussians."""

from peaking.errors import PeakingError


class SplatFileError(PeakingError):
    """Bytes that are not a sound .ply file of Gaussians."""
