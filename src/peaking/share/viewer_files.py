"""The viewer's page in the built web client: what it needs, for folders and for single files."""

from __future__ import annotations

import re
from pathlib import Path

from peaking.errors import ToolMissing

PAGE, ASSETS = "view.html", "assets"
BUNDLES = "viewer"
"""Folder of the viewer as one script; `web/vite.viewer.config.ts` writes it."""
LIGHT_FIELD, ALL = "viewer_light_field", "viewer_all"
OF_SPLATS = "splats-"
"""How the name begins of the large part that shows Gaussians, and that nothing else needs."""


def page(client_dir: Path) -> str:
    """Return the viewer's page.

    Raises:
        ToolMissing: The web client is not built.
    """
    return _read(client_dir / PAGE)


def assets(client_dir: Path, *, with_splats: bool = True) -> dict[str, bytes]:
    """Return what the page needs beside it, by name: what it names, what that names, and so on.

    Args:
        client_dir: The built web client.
        with_splats: Whether Gaussians will be shown.

    Raises:
        ToolMissing: The web client is not built.
    """
    folder = client_dir / ASSETS
    left = {path.name: path for path in folder.iterdir()} if folder.is_dir() else {}
    if not with_splats:
        left = {name: path for name, path in left.items() if not name.startswith(OF_SPLATS)}
    found: dict[str, bytes] = {}
    waiting = [page(client_dir).encode()]
    while waiting:
        text = waiting.pop()
        # Names hold a hash of the content: they stand in no other file by chance.
        for name in [name for name in left if name.encode() in text]:
            data = left.pop(name).read_bytes()
            found[f"{ASSETS}/{name}"] = data
            waiting.append(data)
    return dict(sorted(found.items()))


def bundle(client_dir: Path, name: str) -> str:
    """Return the viewer as one classic script.

    Raises:
        ToolMissing: The web client is not built.
    """
    return _read(client_dir / BUNDLES / f"{name}.js")


def styles(client_dir: Path, name: str) -> str:
    """Return all styles of the page, and of a bundle.

    Raises:
        ToolMissing: The web client is not built.
    """
    linked = re.findall(r'<link[^>]*rel="stylesheet"[^>]*href="\./([^"]+)"', page(client_dir))
    paths = [client_dir / one for one in linked]
    own = client_dir / BUNDLES / f"{name}.css"
    return "\n".join([_read(path) for path in [*paths, own] if path != own or own.is_file()])


def _read(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8")
    except OSError as error:
        raise ToolMissing(f"{path}: the web client is not built; run: make client") from error
