"""`peaking study serve`."""

from __future__ import annotations

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

if TYPE_CHECKING:
    import socket
    import ssl


@dataclass(frozen=True)
class ServeStudy:
    """Serve a study: a console for the experimenter, pages for the participants' phones.

    Serves https to the local network, as `peaking serve` does. May be stopped at any moment: when
    it is started again, everybody is at the step where they were.

    Examples:
      peaking study serve study
      peaking study serve study --local    # this machine alone, with the virtual phone
      peaking study serve study --adb      # a phone on a USB cable
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study, made by `peaking study init`."""
    host: str = "0.0.0.0"
    """Address to listen at; all of them by default."""
    port: int = 8443
    """Port, or the next free one; 0 takes any."""
    preset: Literal["default", "paper"] = "default"
    """`default` is our best, `paper` is the paper to the letter."""
    local: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """This machine alone, without tokens: to try a study out."""
    adb: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """For a phone on a USB cable: plain http at localhost, through `adb reverse`."""

    def run(self) -> None:
        """Serve until Ctrl-C."""
        import secrets

        from peaking.options import PRESETS
        from peaking.server.app import ServerConfig, create_app
        from peaking.server.run import CLIENT_DIR, bind, run
        from peaking.server.sessions import SessionStore
        from peaking.server.study.app import StudyConfig, create_study_app
        from peaking.server.study.open_study import OpenStudy
        from peaking.study.privacy import held
        from peaking.study.protocol import load_protocol

        load_protocol(self.folder)  # before anything is written there
        with held(self.folder):
            study = OpenStudy(self.folder)
            plain = self.local or self.adb
            listener = bind("127.0.0.1" if plain else self.host, self.port)
            origins, context = self._origins(listener)
            token, console_token = (
                (None, None)
                if self.local
                else (secrets.token_urlsafe(18), secrets.token_urlsafe(18))
            )
            sessions = SessionStore(self.folder / "sessions")
            for problem in sessions.problems:
                print(f"left alone: {problem}", file=sys.stderr)
            capture = create_app(
                store=sessions,
                config=ServerConfig(
                    token=token,
                    client_dir=CLIENT_DIR,
                    options=PRESETS[self.preset],
                    secure=context is not None,
                ),
            )
            app = create_study_app(
                study=study,
                sessions=sessions,
                capture=capture,
                config=StudyConfig(
                    token=token,
                    console_token=console_token,
                    client_dir=CLIENT_DIR,
                    phone_links=[f"{origin}/participant?participant=" for origin in origins],
                    secure=context is not None,
                ),
            )
            secret = "" if token is None else f"#token={token}&console={console_token}"

            def started() -> None:
                print("The console, for the experimenter alone:")
                for origin in origins:
                    print(f"  {origin}/study{secret}")
                print("Links for the phones are in the console.")
                for remark in study.remarks:
                    print(f"Note: {remark}")
                print(f"Records are kept in {self.folder.resolve()}")
                print("Stop with Ctrl-C.", flush=True)

            run(listener, app, context=context, started=started)

    def _origins(self, listener: socket.socket) -> tuple[list[str], ssl.SSLContext | None]:
        """Return where the pages are, and how they are secured."""
        import socket

        from peaking.server.certificates import (
            authority,
            config_folder,
            lan_addresses,
            server_context,
        )

        port = listener.getsockname()[1]
        if self.local or self.adb:
            return [f"http://localhost:{port}"], None
        addresses = lan_addresses() if self.host in ("0.0.0.0", "::") else [self.host]
        names = [*addresses, "localhost", "127.0.0.1", socket.gethostname()]
        context = server_context(authority(config_folder()), list(dict.fromkeys(names)))
        hosts = [f"[{a}]" if ":" in a else a for a in addresses] or ["localhost"]
        return [f"https://{host}:{port}" for host in hosts], context
