"""How much of anything is read that came from elsewhere: checked before it is decoded.

A few bytes can claim a picture that fills the memory, or make a decoder work for minutes. These are
all limits there are; docs/protocol.md has them as a table. They admit what cameras and phones make.
"""

from __future__ import annotations

# Pictures: photos, depth maps, masks.

MAX_PICTURE_BYTES = 2**29
"""Of a file."""

MAX_PIXELS = 2**27
"""134 megapixels; decoding one with 16 bits and four channels takes 1 GiB."""

MAX_SCANS = 200
"""Of a JPEG; progressive ones have about 10."""

MAX_SCAN_PIXELS = 2**31
"""Scans times pixels of a JPEG: a decoder walks over all pixels in every scan (0.6 ns for each)."""

MAX_SEGMENTS = 10_000
"""Of a JPEG; 600 kB of metadata have 10."""

MAX_CHUNKS = 2**17
"""Of a PNG or WebP."""

DECODER_MEMORY_BYTES = 4 * 2**30
"""Of the process that decodes what is neither JPEG, PNG nor WebP, libraries included."""

DECODER_SECONDS = 60
"""For the same."""

DECODINGS_AT_ONCE = 2
"""Of photos that a server is asked for: thumbnails, and pictures of a recording."""

# Multi-plane images (docs/mpi-format.md).

MAX_MPI_BYTES = 256 * 2**20
MAX_MPI_SIDE_PX = 16384
MAX_MPI_PIXELS = 2**24
"""4096 x 4096: `peaking render` at the size of its camera takes 1.3 GB."""
MAX_PLANES = 1024
MAX_TILES = 2**16
"""A picture of 4096 x 4096 pixels, 64 MiB of texels."""
MAX_PLACES = 2**25
"""Planes x rows x columns of tiles; a table of them takes 128 MiB."""

# Traces of phones' cameras (docs/trace.md); wire.MAX_TRACE_BYTES is for their files.

MAX_TRACE_INDEX_BYTES = 8_000_000
"""Of trace.json; 4,000 frames have 5 MB."""

MAX_TRACE_PICTURE_BYTES = 4_000_000
MAX_TRACE_UNPACKED_BYTES = 2**27
"""Of all that is in a trace, which is held in memory."""

# Archives (zip), which are unpacked into the user's cache.

MAX_ARCHIVE_FILES = 200_000
MAX_ARCHIVE_BYTES = 2**36
"""Of all files in it, unpacked."""

MAX_ARCHIVE_RATIO = 200
"""Unpacked over packed: pictures hardly shrink, depth of a wall does by 100."""

# Other files.

MAX_TRANSFORMS_BYTES = 2**26
"""Of a transforms.json; 50,000 frames take 25 to 60 MB."""

MAX_TRANSFORMS_VALUES = 2**21
"""Numbers, texts, lists and objects of a transforms.json; 50,000 frames have 1.6 million."""

MAX_TRANSFORMS_DEPTH = 64

TRANSFORMS_MEMORY_BYTES = 2**30
"""That reading a transforms.json takes, whatever stands in it."""

MAX_TEXT_BYTES = 2**28
"""Of a file of poses or intrinsics as text; 100,000 poses take 20 MB."""

MAX_XML_BYTES = 2**27
"""Of a file of cameras as XML; 10,000 of Metashape's take 15 MB."""

MAX_XML_DEPTH = 64

MAX_POINTS_BYTES = 2**30
"""Of a point cloud (.ply)."""

MAX_MODEL_BYTES = 2**32
"""Of a binary file of a COLMAP model; 10,000 pictures with 10,000 features each have 2.4 GB."""

MAX_ASCII_POINTS_BYTES = 2**28
"""The same, of text: 5 million points with colours."""

POINTS_MEMORY_BYTES = 2**26
"""That reading a point cloud takes, however large it is."""

MAX_SPLAT_BYTES = 2**32
"""Of 3D Gaussians (.ply)."""

MAX_GAUSSIANS = 2**24
"""The same; those of degree 1 take 1.5 GB."""

MAX_CHECKPOINT_BYTES = 2**30
"""Of a network's checkpoint, unpacked."""

MAX_CHECKPOINT_PICKLE_BYTES = 2**22
"""The same, of what names its tensors: one byte may make an object of 100. AdaMPI's has 0.1 MB."""
