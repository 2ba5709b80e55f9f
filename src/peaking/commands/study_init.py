"""`peaking study init`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from peaking.terminal import say


@dataclass(frozen=True)
class Init:
    """Create the folder of a study, with a protocol to read and edit.

    In a folder that already has a protocol, it only checks the protocol and, with --language, adds
    a translation file.

    Examples:
      peaking study init study
      peaking study init study --language ja     # writes translations/ja.toml to translate
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study; created if it does not exist."""
    language: str | None = None
    """Also write the texts of all pages and questionnaires, to translate into this language."""

    def run(self) -> None:
        """Write what is not there yet, and check what is."""
        import re
        from importlib.resources import files

        from peaking.commands.arguments import ArgumentError
        from peaking.errors import OutputError
        from peaking.output import check_folder, write_atomically
        from peaking.study.protocol import FILE_NAME, load_protocol, remarks
        from peaking.study.texts import FOLDER, template

        check_folder(self.folder)
        path = self.folder / FILE_NAME
        if not path.exists():
            write_atomically(path, (files("peaking.study") / "example.toml").read_bytes())
            say(f"Wrote {path}: read it and change what differs in your study.")
        protocol = load_protocol(self.folder)
        for remark in remarks(protocol):
            say(f"Note: {remark}")
        if self.language is not None:
            if not re.fullmatch(r"[a-z]{2}(-[A-Za-z]{2,8})?", self.language):
                raise ArgumentError(f"need --language such as ja or pt-BR, got {self.language!r}")
            translation = self.folder / FOLDER / f"{self.language}.toml"
            if translation.exists():
                raise OutputError(f"{translation}: exists already; give another --language")
            write_atomically(translation, template(protocol).encode())
            say(
                f'Wrote {translation}: translate it, and write language = "{self.language}" in '
                f"{FILE_NAME}."
            )
        say(f"Next:  peaking study serve {self.folder}")
