"""Questionnaires as data: what is asked, how it is answered, and how the answers are scored.

The built-in ones are the TOML files beside this one. `scores` (in `scoring.py`) turns answers into
numbers by the published rules; `problems` says what is missing or out of range in a filled-in form.
"""

from __future__ import annotations

import functools
import math
import tomllib
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from peaking.errors import StudyError

FOLDER = Path(__file__).parent

Answer = int | float | str | list[str] | None
"""What one item was answered with; None when it was left out."""

Slug = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_-]{0,39}$(?!\n)")]
Words = Annotated[str, Meta(max_length=2000)]


class Choice(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One of the answers to choose from."""

    value: Slug
    text: Words


class Item(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """One question."""

    id: Slug
    text: Words
    kind: Literal["scale", "rating", "choice", "choices", "number", "text"]
    """`scale`: 1 … points; `rating`: 0 … 100 by 5; `choice`: one; `choices`: several."""
    points: Annotated[int, Meta(ge=2, le=11)] = 7
    """Of a `scale`."""
    low: Words = ""
    """What the lower end of a `scale` or `rating` means."""
    high: Words = ""
    choices: list[Choice] = []
    smallest: float = 0.0
    """Of a `number`."""
    largest: float = 1e6
    optional: bool = False
    help: Words = ""
    reversed: bool = False
    """Agreement speaks against the thing asked about; scoring turns it round."""


class Questionnaire(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A form that is filled in at once."""

    name: Slug
    title: Words
    items: Annotated[list[Item], Meta(min_length=1)]
    instruction: Words = ""
    scoring: Literal["items", "mean", "sus", "harus", "nasa_tlx", "nasa_rtlx"] = "items"
    """`items`: each item by itself; `mean`: their mean too, reversed ones turned round."""
    prefix: str | None = None
    """Before the names of its items in tables; by default the questionnaire's name."""
    source: Words = ""
    """Where it was published."""

    def item(self, item_id: str) -> Item:
        """Return an item by its id."""
        return next(item for item in self.items if item.id == item_id)


@functools.cache
def built_in_names() -> tuple[str, ...]:
    """Return the names of the built-in questionnaires."""
    return tuple(sorted(path.stem for path in FOLDER.glob("*.toml")))


@functools.cache
def built_in(name: str) -> Questionnaire:
    """Return a built-in questionnaire, such as `sus`.

    Raises:
        ValueError: There is none of this name.
    """
    if name not in built_in_names():
        raise ValueError(f"need one of {', '.join(built_in_names())}, got {name!r}")
    path = FOLDER / f"{name}.toml"
    try:
        found = msgspec.convert(tomllib.loads(path.read_text("utf-8")), Questionnaire)
    except (tomllib.TOMLDecodeError, msgspec.ValidationError) as error:
        raise StudyError(path, str(error), remedy="install peaking again") from error
    return found


def check_questionnaire(questionnaire: Questionnaire) -> str | None:
    """Return what is wrong with a definition, or None."""
    for item_id, count in Counter(item.id for item in questionnaire.items).items():
        if count > 1:
            return f"the item {item_id!r} stands there {count} times"
    for item in questionnaire.items:
        if item.kind in ("choice", "choices") and len(item.choices) < 2:
            return f"the item {item.id!r} needs at least 2 choices"
        if item.kind == "number" and not item.smallest < item.largest:
            return f"the item {item.id!r} needs smallest < largest"
    if questionnaire.scoring in built_in_names():
        wanted = [item.id for item in built_in(questionnaire.scoring).items]
        if [item.id for item in questionnaire.items] != wanted:
            return f"scoring {questionnaire.scoring!r} needs the items {', '.join(wanted)}"
    return None


def problems(questionnaire: Questionnaire, answers: Mapping[str, Answer]) -> dict[str, str]:
    """Return what is wrong with a filled-in form: a message per item, empty when it is complete.

    Messages are keys of the page's texts: `unanswered`, `not-a-number`, `out-of-range`,
    `not-a-choice`, `too-long`, `unknown`.
    """
    found = {item_id: "unknown" for item_id in answers if not _has(questionnaire, item_id)}
    for item in questionnaire.items:
        problem = _problem(item, answers.get(item.id))
        if problem is not None:
            found[item.id] = problem
    return found


MAX_TEXT = 10_000


def _problem(item: Item, answer: Answer) -> str | None:
    if answer is None or answer == "" or answer == []:
        return None if item.optional else "unanswered"
    match item.kind:
        case "scale" | "rating" | "number":
            if isinstance(answer, bool) or not isinstance(answer, int | float):
                return "not-a-number"
            if not math.isfinite(answer):
                return "not-a-number"
            return None if _in_range(item, float(answer)) else "out-of-range"
        case "choice":
            return None if answer in [c.value for c in item.choices] else "not-a-choice"
        case "choices":
            values = {c.value for c in item.choices}
            sound = isinstance(answer, list) and set(answer) <= values
            return None if sound else "not-a-choice"
        case "text":
            if not isinstance(answer, str):
                return "not-a-choice"
            return None if len(answer) <= MAX_TEXT else "too-long"


def _in_range(item: Item, answer: float) -> bool:
    match item.kind:
        case "scale":
            return answer == int(answer) and 1 <= answer <= item.points
        case "rating":
            return answer % 5 == 0 and 0 <= answer <= 100
        case _:
            return item.smallest <= answer <= item.largest


def _has(questionnaire: Questionnaire, item_id: str) -> bool:
    return any(item.id == item_id for item in questionnaire.items)
