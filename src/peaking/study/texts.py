"""What participants read, in any language: one translations/xx.toml in the study's folder.

    [pages]              every key of texts.toml
    [sus]                title, instruction
    [sus.items.q1]       text, low, high, help
    [demographics.items.hand.choices]   right = "…"
    [protocol]           consent, introduction, practice, scan, capture, review

What the file leaves out stays English, and `untranslated` lists it.
"""

from __future__ import annotations

import functools
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec

from peaking.errors import StudyError
from peaking.study.protocol import Protocol
from peaking.study.questionnaires import Item, Questionnaire

FOLDER = "translations"
ITEM_WORDS = ("text", "low", "high", "help")
FORM_WORDS = ("title", "instruction")
TASK_WORDS = ("introduction", "practice", "scan", "capture", "review")


class ItemWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """An item in another language."""

    text: str = ""
    low: str = ""
    high: str = ""
    help: str = ""
    choices: dict[str, str] = {}


class FormWords(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A questionnaire in another language."""

    title: str = ""
    instruction: str = ""
    items: dict[str, ItemWords] = {}


@functools.cache
def english() -> dict[str, str]:
    """Return the texts of the pages as they are built in."""
    path = Path(__file__).with_name("texts.toml")
    return {name: str(text) for name, text in tomllib.loads(path.read_text("utf-8")).items()}


class Texts:
    """All that a participant reads, in the language of the study."""

    def __init__(self, protocol: Protocol, study: Path) -> None:
        """Read the translation that the protocol names.

        Raises:
            StudyError: It is not there, is not TOML, or translates what does not exist.
        """
        self.language = protocol.language
        self._protocol = protocol
        self._path = study / FOLDER / f"{protocol.language}.toml"
        self._forms: dict[str, FormWords] = {}
        self.pages, self._tasks = english(), dict[str, str]()
        if protocol.language != "en" or self._path.is_file():
            self._read()

    def form(self, name: str) -> Questionnaire:
        """Return a questionnaire in the language of the study."""
        form = self._protocol.questionnaire(name)
        words = self._forms.get(name, FormWords())
        return msgspec.structs.replace(
            form,
            title=words.title or form.title,
            instruction=words.instruction or form.instruction,
            items=[_item(item, words.items.get(item.id, ItemWords())) for item in form.items],
        )

    def task(self, kind: str) -> str:
        """Return what is read in a phase, or the text of the consent."""
        own = self._protocol.consent if kind == "consent" else getattr(self._protocol.tasks, kind)
        return self._tasks.get(kind) or own

    def untranslated(self) -> list[str]:
        """Return what stays English although the study has another language."""
        if self.language == "en":
            return []
        found = [f"pages.{n}" for n in english() if self.pages[n] == english()[n]]
        for name in self._protocol.ask.everywhere():
            if any(q.name == name for q in self._protocol.questionnaires):
                continue
            words = self._forms.get(name, FormWords())
            items = self._protocol.questionnaire(name).items
            found += [f"{name}.items.{i.id}" for i in items if not _said(words, i.id)]
        return found

    def _read(self) -> None:
        try:
            fields = tomllib.loads(self._path.read_text("utf-8"))
        except FileNotFoundError:
            raise StudyError(
                self._path,
                f"is not there, and the study's language is {self.language!r}",
                remedy=f"write one with: peaking study init FOLDER --language {self.language}",
            ) from None
        except (ValueError, RecursionError, OSError) as error:
            raise StudyError(
                self._path, f"is not TOML: {error}", remedy="mend that line"
            ) from error
        pages = self._words(fields.pop("pages", {}), "pages", list(english()))
        self.pages = {**english(), **pages}
        self._tasks = self._words(fields.pop("protocol", {}), "protocol", ["consent", *TASK_WORDS])
        for name, words in fields.items():
            self._forms[name] = self._form_words(name, words)

    def _form_words(self, name: str, fields: Any) -> FormWords:
        try:
            form = self._protocol.questionnaire(name)
        except ValueError as error:
            raise StudyError(
                self._path, "is no questionnaire", field=name, remedy="remove or rename it"
            ) from error
        try:
            words = msgspec.convert(fields, FormWords)
        except msgspec.ValidationError as error:
            raise StudyError(self._path, str(error), field=name, remedy="correct it") from error
        for item_id, item in words.items.items():
            known = {i.id: i for i in form.items}
            if item_id not in known:
                raise StudyError(
                    self._path,
                    "there is no such item",
                    field=f"{name}.items.{item_id}",
                    remedy=f"choose from: {', '.join(known)}",
                )
            values = [c.value for c in known[item_id].choices]
            for value in item.choices:
                if value not in values:
                    raise StudyError(
                        self._path,
                        "there is no such choice",
                        field=f"{name}.items.{item_id}.choices.{value}",
                        remedy=f"choose from: {', '.join(values)}",
                    )
        return words

    def _words(self, fields: Any, table: str, known: list[str]) -> dict[str, str]:
        try:
            words = msgspec.convert(fields, dict[str, str])
        except msgspec.ValidationError as error:
            raise StudyError(self._path, str(error), field=table, remedy="correct it") from error
        for name in words:
            if name not in known:
                raise StudyError(
                    self._path,
                    "there is no such text",
                    field=f"{table}.{name}",
                    remedy=f"choose from: {', '.join(known)}",
                )
        return words


def template(protocol: Protocol) -> str:
    """Return a translation file with everything in English, to translate."""
    lines = [
        "# Replace the English texts by their translations; lines that are left out stay English.",
        "",
    ]
    lines += ["[pages]", *_lines(english()), "", "[protocol]"]
    tasks = {name: getattr(protocol.tasks, name) for name in TASK_WORDS}
    lines += _lines({"consent": protocol.consent, **tasks})
    for name in protocol.ask.everywhere():
        form = protocol.questionnaire(name)
        lines += ["", f"[{name}]", *_lines({w: getattr(form, w) for w in FORM_WORDS})]
        for item in form.items:
            lines += [f"[{name}.items.{item.id}]"]
            lines += _lines({w: getattr(item, w) for w in ITEM_WORDS})
            if item.choices:
                lines += [f"[{name}.items.{item.id}.choices]"]
                lines += _lines({c.value: c.text for c in item.choices})
    return "\n".join(lines) + "\n"


def _lines(words: Mapping[str, str]) -> list[str]:
    # A JSON string is a TOML basic string.
    return [f"{n} = {msgspec.json.encode(text).decode()}" for n, text in words.items() if text]


def _item(item: Item, words: ItemWords) -> Item:
    texts = {name: getattr(words, name) or getattr(item, name) for name in ITEM_WORDS}
    choices = [
        msgspec.structs.replace(choice, text=words.choices.get(choice.value, choice.text))
        for choice in item.choices
    ]
    return msgspec.structs.replace(item, choices=choices, **texts)


def _said(words: FormWords, item_id: str) -> bool:
    return item_id in words.items and bool(words.items[item_id].text)
