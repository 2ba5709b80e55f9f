"""A simulated study's folder, event by event, as `peaking study serve` would have written it."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path

import numpy as np

from peaking.study.measure_catalogue import column
from peaking.study.procedure import Step, steps_of
from peaking.study.protocol import FILE_NAME, Protocol, Trial, parse_protocol, trials_of
from peaking.study.questionnaires import Answer, Item, Questionnaire
from peaking.study.questionnaires.scoring import TLX_PAIRS
from peaking.study.records import (
    VERSION,
    Answered,
    AnyEvent,
    ConsentGiven,
    ParticipantBegun,
    StepFinished,
    StepStarted,
    log_of,
    participant_folder,
)
from peaking.study.simulation.capture import capture_events
from peaking.study.simulation.drawing import draw
from peaking.study.simulation.truth import Truth

FIRST_DAY_S = 1_760_000_000.0
"""When the first participant comes: 9 October 2025, seconds since 1970."""

BETWEEN_PARTICIPANTS_S = 3600.0


def simulated_protocol(participants: int, seed: int) -> str:
    """Return the example's protocol.toml, planned for so many participants."""
    text = (files("peaking.study") / "example.toml").read_text("utf-8")
    for field, value in {
        "title": '"Two ways to photograph a scene (simulated)"',
        "planned_participants": str(participants),
        "seed": str(seed),
    }.items():
        text = re.sub(rf'(?m)^{field} = (".*?"|\d+)', f"{field} = {value}", text)
    return text


def write_study(folder: Path, truths: Sequence[Truth], *, participants: int, seed: int) -> None:
    """Write a study of the example's protocol, with the effects of `truths`.

    Args:
        folder: Where to write; it must be there.
        truths: Of the measures that are not to be arbitrary; a column for each condition.
        participants: How many, all of whom finish.
        seed: The same seed gives the same bytes.
    """
    text = simulated_protocol(participants, seed)
    (folder / FILE_NAME).write_text(text, encoding="utf-8")
    protocol = parse_protocol(text, folder / FILE_NAME)
    rng = np.random.default_rng(seed)
    drawn = draw(truths, participants, rng)
    digest = hashlib.sha256(text.encode()).hexdigest()
    for row in range(participants):
        name = f"P{row + 1:02d}"
        trials = trials_of(protocol, row)
        person = _Person(protocol, FIRST_DAY_S + row * BETWEEN_PARTICIPANTS_S, rng)
        person.told.append(
            ParticipantBegun(
                at_s=person.now_s,
                version=VERSION,
                participant=name,
                row=row,
                trials=trials,
                protocol_sha256=digest,
            )
        )
        for step in steps_of(protocol, trials):
            person.do(step, _numbers(step.trial, drawn, row, protocol))
        participant_folder(folder, name).mkdir(parents=True)
        log_of(folder, name).append(*person.told)


def _numbers(
    trial: Trial | None, drawn: Mapping[str, np.ndarray], row: int, protocol: Protocol
) -> dict[str, float]:
    if trial is None:
        return {}
    conditions = [condition.name for condition in protocol.conditions]
    at = conditions.index(trial.condition)
    return {name: float(values[row, at]) for name, values in drawn.items()}


class _Person:
    """Goes through the steps and tells what happens."""

    def __init__(self, protocol: Protocol, now_s: float, rng: np.random.Generator) -> None:
        self.protocol = protocol
        self.now_s = now_s
        self.rng = rng
        self.told: list[AnyEvent] = []

    def do(self, step: Step, numbers: Mapping[str, float]) -> None:
        """Do one step; `numbers` are what its trial is to give, by measure."""
        self.told.append(StepStarted(at_s=self._after(2.0), step=step.key))
        match step.kind:
            case "consent":
                digest = hashlib.sha256(self.protocol.consent.encode()).hexdigest()
                self.told.append(
                    ConsentGiven(at_s=self._after(60.0), images=True, text_sha256=digest)
                )
            case "ask":
                form = self.protocol.questionnaire(step.questionnaire or "")
                self.told.append(
                    Answered(
                        at_s=self._after(10.0 + 5.0 * len(form.items)),
                        step=step.key,
                        questionnaire=form.name,
                        answers=self._answers(form, numbers),
                    )
                )
            case "capture":
                self._capture(step.key, numbers)
            case _:
                self._after(self.rng.uniform(20.0, 40.0))
        by = "participant" if step.self_paced or step.kind == "capture" else "experimenter"
        self.told.append(StepFinished(at_s=self._after(1.0), step=step.key, by=by))

    def _after(self, seconds: float) -> float:
        self.now_s = round(self.now_s + seconds, 3)
        return self.now_s

    def _capture(self, step: str, numbers: Mapping[str, float]) -> None:
        told = capture_events(step, self._after(1.0), numbers=numbers, rng=self.rng)
        self.told += told
        self.now_s = max(self.now_s, round(told[-1].at_s, 3))

    def _answers(self, form: Questionnaire, numbers: Mapping[str, float]) -> dict[str, Answer]:
        answers: dict[str, Answer] = {}
        for item in form.items:
            number = numbers.get(column(form, item.id))
            answers[item.id] = self._any_answer(item) if number is None else round(number)
        if form.scoring == "nasa_tlx":
            for first, second in TLX_PAIRS:
                # The scale that was rated higher is the weightier one, most of the time.
                heavier = _rating(answers, first) + self.rng.normal(0.0, 15.0) >= _rating(
                    answers, second
                )
                answers[f"pair_{first}_{second}"] = first if heavier else second
        return answers

    def _any_answer(self, item: Item) -> Answer:
        match item.kind:
            case "choice":
                return item.choices[int(self.rng.integers(len(item.choices)))].value
            case "choices":
                return [item.choices[int(self.rng.integers(len(item.choices)))].value]
            case "scale":
                return int(self.rng.integers(1, item.points + 1))
            case "rating":
                return 5 * int(self.rng.integers(0, 21))
            case "number":
                most = min(item.largest, item.smallest + 15)
                return float(round(self.rng.uniform(item.smallest, most)))
            case "text":
                return None


def _rating(answers: Mapping[str, Answer], scale: str) -> float:
    answer = answers[scale]
    return float(answer) if isinstance(answer, int | float) else 0.0
