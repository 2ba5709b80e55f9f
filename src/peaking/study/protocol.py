"""protocol.toml: what a study compares, who does what in which order, and what is asked when.

A person reads and edits this file; `load_protocol` checks it and says, in sentences, which field is
wrong and what to do. `trials_of` is the order of one participant.
"""

from __future__ import annotations

import tomllib
from collections import Counter
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from peaking.errors import StudyError
from peaking.study.counterbalance import row_of, williams
from peaking.study.measure_catalogue import catalogue
from peaking.study.questionnaires import (
    Questionnaire,
    built_in,
    built_in_names,
    check_questionnaire,
)

FILE_NAME = "protocol.toml"
VERSION = 1

Slug = Annotated[str, Meta(pattern=r"^[a-z][a-z0-9_-]{0,39}$(?!\n)")]
"""A short name in lower case, as it stands in tables: `peaking`, `office-left`."""

Text = Annotated[str, Meta(max_length=20_000)]


class Struct(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Base of what stands in the file: fields that are not known are refused."""


class Condition(Struct, frozen=True):
    """What the participant sees while capturing."""

    name: Slug
    label: str
    overlay: Literal["peaks", "none"]
    """`peaks`: the error peaking of the capture page; `none`: the camera's picture alone."""
    guide: Literal["none", "plenoptic"] = "none"
    """`plenoptic`: LLFF's grid of 3D axes over the picture."""
    area_side_m: Annotated[float, Meta(ge=0.01, le=10)] | None = None
    """Side of the square in which the guide asks for views, S; none: the paper's 0.15."""
    scan: bool = False
    """The scene is scanned before the capture (LLFF needs it for its smallest depth)."""


class Scene(Struct, frozen=True):
    """What is captured."""

    name: Slug
    label: str


class Tasks(Struct, frozen=True):
    """What the participant reads; without a text there is no introduction, no practice."""

    introduction: Text = ""
    practice: Text = ""
    scan: Text = "Scan the scene: move the phone slowly so that it sees everything."
    capture: Text = "Photograph the scene until you are satisfied, then press Finish."
    review: Text = "Look at the result from all sides."


class Asked(Struct, frozen=True):
    """Which questionnaires are filled in when, by name, in order."""

    at_start: list[Slug] = []
    """Once, before the first trial."""
    after_capture: list[Slug] = []
    """In every trial, before the result is seen."""
    after_review: list[Slug] = []
    """In every trial, after the result was seen."""
    at_end: list[Slug] = []
    """Once, after the last trial."""

    def in_trial(self) -> list[str]:
        """Return the names of those that are filled in once per trial."""
        return [*self.after_capture, *self.after_review]

    def everywhere(self) -> list[str]:
        """Return all names, in the order in which they come up."""
        return [*self.at_start, *self.in_trial(), *self.at_end]


class Family(Struct, frozen=True):
    """Hypotheses that are corrected together (Holm): one test per measure."""

    name: Slug
    measures: Annotated[list[str], Meta(min_length=1)]
    """Names of measures, as in the codebook: `tct_s`, `captures`, `sus`, `satis`."""


class Protocol(Struct, frozen=True):
    """A study. `protocol.toml` has exactly these fields."""

    version: int
    title: Annotated[str, Meta(min_length=1, max_length=200)]
    design: Literal["within", "between"]
    """`within`: everybody does all conditions; `between`: everybody does one."""
    order: Literal["ab-ba", "williams", "fixed"]
    """How the order of the conditions changes from participant to participant."""
    planned_participants: Annotated[int, Meta(ge=1, le=10_000)]
    seed: int
    conditions: Annotated[list[Condition], Meta(min_length=1)]
    scenes: Annotated[list[Scene], Meta(min_length=1)]
    scene_use: Literal["all", "one"] = "all"
    """`all`: every condition in every scene; `one`: every condition in a scene of its own."""
    scene_order: Literal["williams", "fixed"] = "williams"
    """Counterbalanced separately from the order of the conditions."""
    language: Annotated[str, Meta(pattern=r"^[a-z]{2}(-[A-Za-z]{2,8})?$(?!\n)")] = "en"
    """`en`, or the name of a file in the folder `translations/`."""
    consent: Text = ""
    tasks: Tasks = Tasks()
    ask: Asked = Asked()
    alpha: Annotated[float, Meta(gt=0, lt=1)] = 0.05
    missing: Literal["pairwise", "listwise"] = "pairwise"
    """Who is left out of a test: those who miss this measure, or those who miss any measure."""
    families: list[Family] = []
    questionnaires: list[Questionnaire] = []
    """Your own, beside the built-in ones."""

    def condition(self, name: str) -> Condition:
        """Return a condition by its name."""
        return next(c for c in self.conditions if c.name == name)

    def questionnaire(self, name: str) -> Questionnaire:
        """Return one of the protocol's own questionnaires, or a built-in one.

        Raises:
            ValueError: There is none of this name.
        """
        own = [q for q in self.questionnaires if q.name == name]
        return own[0] if own else built_in(name)

    def scene(self, name: str) -> Scene:
        """Return a scene by its name."""
        return next(s for s in self.scenes if s.name == name)


class Trial(msgspec.Struct, frozen=True):
    """One participant in one condition at one scene."""

    position: int
    """1, 2, 3 … in the order of the participant."""
    condition: str
    scene: str

    @property
    def key(self) -> str:
        """Name of the trial in the log: `t1`, `t2` and so on."""
        return f"t{self.position}"


def load_protocol(folder: Path) -> Protocol:
    """Read and check protocol.toml in the folder of a study.

    Raises:
        StudyError: It is not there, or a field is wrong; the sentence says which and what to do.
    """
    file = folder / FILE_NAME
    if folder.is_file():
        raise StudyError(folder, "is a file", remedy="give the folder of a study")
    try:
        text = file.read_text(encoding="utf-8")
    except (FileNotFoundError, NotADirectoryError):
        remedy = f"make one with: peaking study init {folder}"
        raise StudyError(file, "is not there", remedy=remedy) from None
    except (OSError, UnicodeDecodeError) as error:
        raise StudyError(file, f"cannot be read ({error})", remedy="give a text file") from error
    return parse_protocol(text, file)


def parse_protocol(text: str, file: Path) -> Protocol:
    """Check the text of a protocol.toml; `file` is named in what is wrong.

    Raises:
        StudyError: A field is wrong.
    """
    try:
        fields = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise StudyError(file, f"is not TOML: {error}", remedy="mend that line") from error
    if fields.get("version") != VERSION:
        raise StudyError(
            file,
            f"is {fields.get('version')!r}, this peaking reads {VERSION}",
            field="version",
            remedy=f"write: version = {VERSION}",
        )
    try:
        protocol = msgspec.convert(fields, Protocol)
    except msgspec.ValidationError as error:
        problem, _, place = str(error).partition(" - at `$")
        raise StudyError(
            file,
            _lower(problem),
            field=place.rstrip("`").lstrip(".") or None,
            remedy="correct it; docs/study.md lists the fields and what they may be",
        ) from error
    _check(protocol, file)
    return protocol


def _check(protocol: Protocol, file: Path) -> None:
    """Refuse what the types cannot."""

    def refuse(field: str, problem: str, remedy: str) -> None:
        raise StudyError(file, problem, field=field, remedy=remedy)

    for field, names in {
        "conditions": [c.name for c in protocol.conditions],
        "scenes": [s.name for s in protocol.scenes],
        "families": [f.name for f in protocol.families],
        "questionnaires": [q.name for q in protocol.questionnaires],
        "ask": protocol.ask.everywhere(),
    }.items():
        for name, count in Counter(names).items():
            if count > 1:
                refuse(field, f"{name!r} stands there {count} times", "give each its own name")
    count = len(protocol.conditions)
    if protocol.order == "ab-ba" and count != 2:
        refuse("order", f"'ab-ba' is for 2 conditions, there are {count}", "write: williams")
    if protocol.scene_use == "one" and 1 < len(protocol.scenes) < count:
        refuse(
            "scene_use",
            f"'one' needs a scene for each of the {count} conditions, there are "
            f"{len(protocol.scenes)}",
            "add scenes, keep one scene for all conditions, or write: all",
        )
    for index, questionnaire in enumerate(protocol.questionnaires):
        if questionnaire.name in built_in_names():
            refuse(
                f"questionnaires[{index}].name",
                f"{questionnaire.name!r} is built in",
                "give yours another name",
            )
        problem = check_questionnaire(questionnaire)
        if problem is not None:
            refuse(f"questionnaires[{index}]", problem, "correct it; see docs/study.md")
    known = [*built_in_names(), *(q.name for q in protocol.questionnaires)]
    for name in protocol.ask.everywhere():
        if name not in known:
            refuse("ask", f"there is no questionnaire {name!r}", f"choose from: {', '.join(known)}")
    measures = [
        m.name for m in catalogue([protocol.questionnaire(n) for n in protocol.ask.in_trial()])
    ]
    for name, times in Counter(measures).items():
        if times > 1:
            refuse("questionnaires", f"two columns would be called {name!r}", "rename an item")
    for index, family in enumerate(protocol.families):
        for name in family.measures:
            if name not in measures:
                refuse(
                    f"families[{index}].measures",
                    f"there is no measure {name!r}",
                    f"choose from: {', '.join(measures)}",
                )
    for index, condition in enumerate(protocol.conditions):
        if condition.guide == "plenoptic" and condition.overlay == "peaks":
            refuse(
                f"conditions[{index}].overlay",
                "a guide and the error peaking cannot be shown together",
                'write: overlay = "none"',
            )
        if condition.area_side_m is not None and condition.guide == "none":
            refuse(
                f"conditions[{index}].area_side_m",
                "needs a guide, and there is none",
                'write: guide = "plenoptic", or leave area_side_m out',
            )
        if condition.scan and condition.guide == "none":
            refuse(
                f"conditions[{index}].scan",
                "a scan needs a guide, and there is none",
                'write: guide = "plenoptic", or leave scan out',
            )


def remarks(protocol: Protocol) -> list[str]:
    """Return sentences about what is allowed and yet should be known before the study begins."""
    said: list[str] = []
    planned, rows = protocol.planned_participants, len(_condition_orders(protocol))
    cells = rows * len(_scene_orders(protocol))
    if planned % rows and protocol.order == "ab-ba" and protocol.design == "within":
        said.append(
            f"planned_participants is {planned}, an odd number: one of the orders AB and BA "
            f"occurs once more than the other; plan {planned + 1} to balance them."
        )
    elif planned % rows:
        said.append(
            f"planned_participants is {planned}, not a multiple of the {rows} "
            f"{'orders' if protocol.design == 'within' else 'groups'}: they do not "
            f"occur equally often; plan {_up(planned, rows)} to balance them."
        )
    elif planned % cells:
        said.append(
            f"planned_participants is {planned}: conditions are balanced, but not every order of "
            f"scenes is equally often with every order of conditions; plan {_up(planned, cells)}."
        )
    if protocol.order == "fixed" and len(protocol.conditions) > 1 and protocol.design == "within":
        said.append(
            "order is 'fixed': all participants do the conditions in the same order, so learning "
            "and fatigue cannot be separated from the conditions."
        )
    if not protocol.consent.strip():
        said.append("consent is empty: the phone does not ask for consent; ask on paper.")
    return said


def trials_of(protocol: Protocol, row: int) -> list[Trial]:
    """Return the trials of the participant who has place `row` (0, 1, 2 …), in order."""
    condition_orders, scene_orders = _condition_orders(protocol), _scene_orders(protocol)
    conditions = condition_orders[row_of(row, len(condition_orders), seed=protocol.seed)]
    # Nested: within one block of condition orders everybody has the same scene order.
    block = row // len(condition_orders)
    shift = row_of(block, len(scene_orders), seed=protocol.seed + 1)
    chosen: list[tuple[int, int]] = []
    for index, condition in enumerate(conditions):
        if protocol.scene_use == "all":
            scenes = scene_orders[(shift + index) % len(scene_orders)]
            chosen += [(condition, scene) for scene in scenes]
        else:
            scenes = scene_orders[shift]
            chosen.append((condition, scenes[index % len(scenes)]))
    return [
        Trial(position, protocol.conditions[c].name, protocol.scenes[s].name)
        for position, (c, s) in enumerate(chosen, start=1)
    ]


def _condition_orders(protocol: Protocol) -> list[list[int]]:
    """Return the rows of the design of conditions; a row of `between` is one condition."""
    count = len(protocol.conditions)
    if protocol.design == "between":
        return [[index] for index in range(count)]
    return [list(range(count))] if protocol.order == "fixed" else williams(count)


def _scene_orders(protocol: Protocol) -> list[list[int]]:
    count = len(protocol.scenes)
    return [list(range(count))] if protocol.scene_order == "fixed" else williams(count)


def _up(planned: int, step: int) -> int:
    return -(-planned // step) * step


def _lower(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]
