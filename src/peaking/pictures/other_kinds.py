"""Decodes a picture of any kind from stdin to stdout, with little memory and time.

`decoding` starts this as a process of its own. The first line says type and shape, the pixels
follow.
"""

from __future__ import annotations

import resource
import sys

from peaking.limits import DECODER_MEMORY_BYTES, DECODER_SECONDS


def main() -> None:
    """Decode, or end with 1."""
    resource.setrlimit(resource.RLIMIT_AS, (DECODER_MEMORY_BYTES, DECODER_MEMORY_BYTES))
    resource.setrlimit(resource.RLIMIT_CPU, (DECODER_SECONDS, DECODER_SECONDS))
    resource.setrlimit(resource.RLIMIT_CORE, (0, 0))

    import cv2
    import numpy as np

    cv2.setNumThreads(1)
    how = cv2.IMREAD_UNCHANGED | cv2.IMREAD_IGNORE_ORIENTATION
    stored = cv2.imdecode(np.frombuffer(sys.stdin.buffer.read(), np.uint8), how)
    if stored is None:
        raise SystemExit(1)
    head = " ".join([stored.dtype.str, *map(str, stored.shape)])
    sys.stdout.buffer.write(head.encode() + b"\n")
    sys.stdout.buffer.write(np.ascontiguousarray(stored).data.cast("B"))


if __name__ == "__main__":
    main()
