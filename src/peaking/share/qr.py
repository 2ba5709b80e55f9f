"""QR codes of addresses, on a page and in a terminal."""

from __future__ import annotations

import io

import segno


def qr_svg(address: str) -> bytes:
    """Return a QR code as an SVG picture."""
    out = io.BytesIO()
    segno.make(address, error="m", micro=False).save(out, kind="svg", scale=4, light="#fff")
    return out.getvalue()


def qr_text(address: str) -> str:
    """Return a QR code of characters."""
    out = io.StringIO()
    segno.make(address, error="m", micro=False).terminal(out, compact=True)
    return out.getvalue()
