"""What `peaking doctor` writes: doctor.csv and report.html, for programs and for people."""

from __future__ import annotations

import html
from collections import Counter
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import UInt8

from peaking.audit.contents_check import Surprise
from peaking.audit.examination import Examination, Finding
from peaking.datasets import Recording
from peaking.output import encode_jpeg
from peaking.reports.csv_table import csv_text
from peaking.reports.page import html_page, jpeg_image, resource

COLUMNS = (
    *("index", "name", "finding", "severity", "words"),
    *("points", "error_px", "corrected_px", "moved_m", "turned_deg", "unlike_share"),
)
THUMBNAIL_PX = 240
HEADINGS = {
    "blurred": "Blurred",
    "dark": "Too dark",
    "clipped": "Over-exposed",
    "exposure": "Otherwise exposed",
    "pose": "Pose does not fit",
    "swapped": "Swapped",
    "lost": "Fits to no other",
    "moved": "Something moved",
    "duplicate": "Taken twice",
}
AGAIN = ("blurred", "dark", "clipped", "moved", "lost")
"""What is mended by taking the picture again."""
_RED = np.array([225, 29, 46], np.float32)


def findings_csv(recording: Recording, found: Examination) -> str:
    """Return a row for each finding, and one for each picture without."""
    rows: list[tuple[object, ...]] = []
    for i, name in enumerate(recording.names):
        pose = found.poses[i] if found.poses else None
        facts: tuple[object, ...] = (None,) * 5
        if pose is not None:
            numbers = (pose.error_px, pose.corrected_px, pose.moved_m, pose.turned_deg)
            facts = (pose.points, *(None if n is None else round(n, 4) for n in numbers))
        surprise = found.surprises.get(i)
        unlike = None if surprise is None else round(surprise.wrong_share, 4)
        said: Sequence[Finding | None] = found.of(i) or [None]
        for finding in said:
            what = ("", None, "") if finding is None else _cells(finding)
            rows.append((i, name, *what, *facts, unlike))
    return csv_text([COLUMNS, *rows])


def _cells(finding: Finding) -> tuple[str, float, str]:
    return finding.kind, round(finding.severity, 2), finding.words


def again(found: Examination) -> list[int]:
    """Return the pictures to take again."""
    return sorted({finding.frame for finding in found.findings if finding.kind in AGAIN})


def report_page(recording: Recording, found: Examination) -> str:
    """Return the page: what is wrong with all, and pictures of what is wrong with single ones."""
    counts = Counter(finding.kind for finding in found.findings)
    spoilt = len({finding.frame for finding in found.findings})
    parts = [
        f'<header><div><p class="kind">Doctor</p><h1>{html.escape(recording.name)}</h1>'
        f'<p class="note">{spoilt} of {len(recording)} pictures have something to look at.</p>'
        '</div><nav><a href="doctor.csv">All pictures (CSV)</a></nav></header>\n'
    ]
    if found.whole is not None:
        parts.append(
            f'<section><h2>All pictures</h2><p>{html.escape(found.whole.words)}</p><p class="note">'
            f"Points are {found.whole.error_px:.1f} px from where pictures see them, and would be "
            f"{found.whole.mended_px:.1f} px.</p></section>\n"
        )
    parts += [f'<p class="note">Not checked: {html.escape(n)}.</p>\n' for n in found.not_checked]
    names = [recording.names[i] for i in again(found)]
    if names:
        items = "".join(f"<li>{html.escape(name)}</li>" for name in names)
        parts.append(f"<section><h2>To take again ({len(names)})</h2><ul>{items}</ul></section>\n")
    for kind, heading in HEADINGS.items():
        if counts[kind]:
            figures = "".join(
                _figure(recording, found, finding)
                for finding in sorted(found.findings, key=lambda f: -f.severity)
                if finding.kind == kind
            )
            parts.append(
                f'<section><h2>{heading} ({counts[kind]})</h2><div class="thumbs">{figures}</div>'
                "</section>\n"
            )
    style = resource("peaking.best_frames", "report.css")
    return html_page(f"{recording.name}: what is wrong", "".join(parts), style=style)


def _figure(recording: Recording, found: Examination, finding: Finding) -> str:
    rgb = recording.read(finding.frame).rgb
    height, width = rgb.shape[:2]
    shrink = min(1.0, THUMBNAIL_PX / max(height, width))
    size_px = max(1, round(width * shrink)), max(1, round(height * shrink))
    small = np.asarray(cv2.resize(rgb, size_px, interpolation=cv2.INTER_AREA), dtype=np.uint8)
    if finding.kind == "moved":
        small = _marked(small, found.surprises[finding.frame])
    name = html.escape(recording.names[finding.frame])
    image = jpeg_image(encode_jpeg(small, quality=80), name)
    return (
        f"<figure>{image}<figcaption><b>{name}</b><span>{html.escape(finding.words)}</span>"
        "</figcaption></figure>"
    )


def _marked(rgb: UInt8[np.ndarray, "h w 3"], surprise: Surprise) -> UInt8[np.ndarray, "h w 3"]:
    """Return a picture with what others do not show in red."""
    size_px = rgb.shape[1], rgb.shape[0]
    marked = cv2.resize(
        surprise.marked.astype(np.uint8), size_px, interpolation=cv2.INTER_NEAREST
    ).astype(np.bool_)
    mixed = rgb.astype(np.float32)
    mixed[marked] = 0.4 * mixed[marked] + 0.6 * _RED
    return mixed.astype(np.uint8)
