"""A place in one HTML file that opens from the disk: nothing in it is fetched.

A page from the disk may neither fetch nor start module workers. So scripts are classic and inside
the page, and so are the files of the place: as base64, in elements that browsers do not run.
"""

from __future__ import annotations

import base64
import html
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from peaking.share import viewer_files
from peaking.share.place import Place

_LOADED = re.compile(
    r'\s*<(?:script\b[^>]*\bsrc=[^>]*></script>|link\b[^>]*\brel="(?:stylesheet|modulepreload)"[^>]*/?>)'
)
_TITLE = re.compile(r"<title>.*?</title>", re.DOTALL)
_END_OF_SCRIPT = re.compile(r"<(/script|!--)", re.IGNORECASE)


def page_with_place(place: Place, files: Mapping[str, bytes], client_dir: Path) -> bytes:
    """Return the page.

    Args:
        place: What is shown.
        files: All that it names.
        client_dir: The built web client.

    Raises:
        ToolMissing: The web client is not built.
    """
    name = bundle_of(place)
    page = with_title(_LOADED.sub("", viewer_files.page(client_dir)), place.title)
    style = viewer_files.styles(client_dir, name).replace("</style", "<\\/style")
    head, _, rest = page.partition("</head>")
    body, _, end = rest.rpartition("</body>")
    json = place.to_json().decode().replace("<", "\\u003c")
    parts = [
        head,
        f"<style>{style}</style>\n</head>",
        body,
        f'<script type="application/json" id="place">{json}</script>\n',
        *(_inlined(name, data) for name, data in files.items() if not _is_waited_for(name)),
        f"<script>{_within_page(viewer_files.bundle(client_dir, name))}</script>\n",
        *(_inlined(name, files[name]) for name in _nearest_first(place, files)),
        "</body>",
        end,
    ]
    return "".join(parts).encode()


def _is_waited_for(name: str) -> bool:
    return name.endswith(".mpi")


def _nearest_first(place: Place, files: Mapping[str, bytes]) -> list[str]:
    """Return the images that come after the script, in the order in which they are looked at.

    The page shows the first of them while the browser still reads the others.
    """
    start = place.views[place.start].camera.position_m if place.views else np.zeros(3)
    away_m = {
        view.mpi: float(np.linalg.norm(view.camera.position_m - start))
        for view in place.views
        if view.mpi is not None
    }
    waited_for = [name for name in files if _is_waited_for(name)]
    return sorted(waited_for, key=lambda name: away_m.get(name, np.inf))


def bundle_of(place: Place) -> str:
    """Return the name of the script that shows a place: the small one for a light field alone."""
    return viewer_files.LIGHT_FIELD if place.splat is None else viewer_files.ALL


def packed_bytes(size: int) -> int:
    """Return how many bytes a file of a size takes in the page, its element included."""
    return 4 * -(-size // 3) + len(_inlined("photos/00000.jpg", b""))


def with_title(page: str, title: str) -> str:
    """Return a page with another title, as those see it who are sent its address."""
    return _TITLE.sub(lambda _: f"<title>{html.escape(title)}</title>", page, count=1)


def _inlined(name: str, data: bytes) -> str:
    content = base64.b64encode(data).decode()
    return f'<script type="text/plain" data-file="{html.escape(name)}">{content}</script>\n'


def _within_page(script: str) -> str:
    r"""Return a script that does not end its element, nor hides its end (`<!--`).

    In a classic script both stand in strings, regular expressions or comments alone, and there
    `\x3c` is the same as `<`.
    """
    return _END_OF_SCRIPT.sub(r"\\x3c\1", script)
