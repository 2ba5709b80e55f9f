"""`peaking study serve`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from peaking.terminal import say


@dataclass(frozen=True)
class ServeStudy:
    """Serve a study: a console for the experimenter and pages for the participants' phones.

    Serves https to the local network, as `peaking serve` does. It can be stopped at any time: after
    a restart, every participant continues at the same step.

    Examples:
      peaking study serve study
      peaking study serve study --local    # on this machine only, with the virtual phone
      peaking study serve study --adb      # a phone on a USB cable
    """

    folder: Annotated[Path, tyro.conf.Positional]
    """Folder of the study, created by `peaking study init`."""
    host: str = "0.0.0.0"
    """Address to listen on; default: all of them."""
    port: int = 8443
    """Port to listen on, or the next free one; 0: any free port."""
    preset: Literal["default", "paper"] = "default"
    """`paper` is the published method exactly; `default` is our improved one."""
    local: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Serve this machine only, without pairing: to try a study."""
    adb: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """For a phone on a USB cable: http on localhost, through `adb reverse`."""
    token_file: Path | None = None
    """File with a secret that pairs consoles; or the environment's PEAKING_TOKEN."""

    def run(self) -> None:
        """Serve until Ctrl-C."""
        import threading

        from peaking.commands.python_version import say_when_outdated
        from peaking.commands.serving import (
            Invitation,
            check_port,
            fixed_token,
            https_origins,
            keep_private,
            preparation_said,
            say_skipped,
        )
        from peaking.options import PRESETS
        from peaking.server.app import ServerOptions, create_app
        from peaking.server.devices import Devices
        from peaking.server.events import Hub
        from peaking.server.pairing_codes import CONSOLE
        from peaking.server.serving import CLIENT_DIR, bind, run
        from peaking.server.sessions import SessionStore
        from peaking.server.study.app import StudyServerOptions, create_study_app
        from peaking.server.study.open_study import OpenStudy
        from peaking.server.warm_up import WarmUp
        from peaking.study.privacy import held
        from peaking.study.protocol import load_protocol

        token = fixed_token(self.token_file)
        check_port(self.port)
        keep_private()
        load_protocol(self.folder)  # before anything is written there
        with held(self.folder):
            sessions = SessionStore(self.folder / "sessions")
            for problem in sessions.problems:
                say_skipped(problem)
            study = OpenStudy(self.folder, sessions)
            plain = self.local or self.adb
            listener = bind("127.0.0.1" if plain else self.host, self.port)
            port = listener.getsockname()[1]
            origins, context = [f"http://localhost:{port}"], None
            if not plain:
                origins, context = https_origins(self.host, port)
            consoles = [f"{origin}/study" for origin in origins]
            devices = None
            if not self.local:
                devices = Devices(sessions.root, usual=CONSOLE, fixed_secret=token)
                for problem in devices.problems:
                    say(f"Note: {problem}", problem=True)
            hubs = Hub(), Hub()  # of the capture server, and of the study
            reachable = threading.Event()
            capture = create_app(
                store=sessions,
                hub=hubs[0],
                admission=study,
                warm_up=WarmUp(preparation_said(reachable)),
                config=ServerOptions(
                    devices=devices,
                    client_dir=CLIENT_DIR,
                    options=PRESETS[self.preset],
                    pages=consoles,
                ),
            )
            app = create_study_app(
                study=study,
                capture=capture,
                hub=hubs[1],
                config=StudyServerOptions(
                    devices=devices,
                    client_dir=CLIENT_DIR,
                    phone_links=[f"{origin}/participant?participant=" for origin in origins],
                ),
            )

            def started() -> None:
                say_when_outdated()
                say("Console, for the experimenter only; the link pairs one browser:")
                if devices is None:
                    say(*(f"  {page}" for page in consoles))
                else:
                    Invitation(devices, consoles, what="console", qr=False).show()
                say("The console shows the links for the phones.")
                for remark in study.remarks:
                    say(f"Note: {remark}")
                say(f"Folder of the study:  {self.folder.resolve()}")
                say("Stop with Ctrl-C.")
                reachable.set()

            def stopping() -> None:
                for hub in hubs:
                    hub.close()

            run(listener, app, context=context, started=started, stopping=stopping)
