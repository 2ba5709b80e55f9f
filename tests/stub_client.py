"""A built web client that is as small as can be: what shares take from the real one."""

from __future__ import annotations

from pathlib import Path

PAGE = """<!doctype html>
<html lang="en">
  <head>
    <meta charset="utf-8" />
    <title>peaking</title>
    <script type="module" crossorigin src="./assets/view-abc.js"></script>
    <link rel="modulepreload" crossorigin href="./assets/dom-def.js">
    <link rel="stylesheet" crossorigin href="./assets/base-012.css">
  </head>
  <body>
    <main id="view"></main>
  </body>
</html>
"""
FILES = {
    "view.html": PAGE,
    "index.html": "<p>capture</p>",
    "assets/view-abc.js": "import './dom-def.js'; import('./light_field_layer-345.js');",
    "assets/dom-def.js": "const worker = new URL('decode_worker-678.js', import.meta.url);",
    "assets/light_field_layer-345.js": "import('./splats-9ab.js');",
    "assets/splats-9ab.js": "export const many = 1;",
    "assets/decode_worker-678.js": "self.onmessage = null;",
    "assets/base-012.css": "body { margin: 0 }",
    "assets/index-cde.js": "capture();",
    "viewer/viewer_light_field.js": "(() => { const end = '</script>'; show(end); })();",
    "viewer/viewer_light_field.css": ".strip { margin: 0 }",
    "viewer/viewer_all.js": "(() => { showAll(); })();",
}


def write_client(folder: Path) -> Path:
    """Write the client; return its folder."""
    for name, text in FILES.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    return folder
