"""`peaking demo`."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import tyro

from peaking.commands.options import MethodFlags


@dataclass(frozen=True)
class Demo:
    """Try the live capture without a phone: a drawn room, or a recording, is the camera.

    Starts the server on this machine alone and opens the browser.

    Examples:
      peaking demo
      peaking demo scenes/desk
      peaking demo --sessions ~/captures --no-open
    """

    scene: Annotated[Path | None, tyro.conf.Positional] = None
    """A recording to play as the camera; without one, the virtual phone in a drawn room."""
    sessions: Path = Path("sessions")
    """Folder for what is captured; made when it is not there."""
    host: str = "127.0.0.1"
    """Address to listen at; only addresses of this machine alone."""
    port: int = 8000
    """Port, or the next free one; 0 takes any."""
    no_open: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Do not open the browser."""
    method: MethodFlags = field(default_factory=MethodFlags)

    def run(self) -> None:
        """Serve until Ctrl-C."""
        import ipaddress
        import webbrowser

        from peaking.datasets import open_recording
        from peaking.server.app import ServerConfig
        from peaking.server.recordings import PlayedRecording
        from peaking.server.run import CLIENT_DIR, bind, serve

        name = "localhost" if self.host in ("127.0.0.1", "localhost") else self.host
        if self.host != "localhost" and not ipaddress.ip_address(self.host).is_loopback:
            raise ValueError(
                f"need a --host of this machine alone, such as 127.0.0.1, got {self.host}; "
                "for phones use: peaking serve"
            )
        recordings: dict[str, PlayedRecording] = {}
        query = "?source=virtual"
        if self.scene is not None:
            played = self.scene.resolve().name
            recordings[played] = PlayedRecording(played, open_recording(self.scene))
            query = f"?source=replay&recording={quote(played)}"
        listener = bind("127.0.0.1" if self.host == "localhost" else self.host, self.port)
        host = f"[{name}]" if ":" in name else name
        address = f"http://{host}:{listener.getsockname()[1]}/"

        def started() -> None:
            print(f"The capture page:  {address}{query if recordings else ''}")
            print(f"All sessions:      {address}sessions")
            print(f"What is captured:  {self.sessions.resolve()}")
            print("Stop with Ctrl-C.", flush=True)
            if not self.no_open:
                webbrowser.open(address + query)

        serve(
            listener,
            sessions=self.sessions,
            config=ServerConfig(
                token=None,
                client_dir=CLIENT_DIR,
                options=self.method.options(),
                recordings=recordings,
            ),
            started=started,
            told=lambda problem: print(f"left alone: {problem}", file=sys.stderr),
        )
