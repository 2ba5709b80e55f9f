"""`peaking demo`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated
from urllib.parse import quote

import tyro

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.commands.options import MethodOptions
from peaking.commands.scenes import SceneOptions
from peaking.terminal import say


@dataclass(frozen=True)
class Demo:
    """Try live capture without a phone: a virtual room, or a recording, takes the camera's place.

    Starts a server that only this machine can reach, and opens the browser.

    Examples:
      peaking demo
      peaking demo scenes/desk
      peaking demo peaking-trace.zip     # of a phone, recorded by the page /check
      peaking demo --sessions ~/captures --no-open
    """

    scene: Annotated[Path | None, tyro.conf.Positional] = None
    """A recording, or a trace of a phone, to play as the camera; default: a virtual phone."""
    sessions: Path = Path("sessions")
    """Folder of the sessions; created if it does not exist."""
    host: str = "127.0.0.1"
    """Address to listen on; a loopback address."""
    port: int = 8000
    """Port to listen on, or the next free one; 0: any free port."""
    follow_links: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Serve also files that links lead to from outside the recording."""
    no_open: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Do not open the browser."""
    keep_exif: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Keep the metadata of photos: EXIF with GPS, XMP, comments."""
    training_steps: int = 2000
    """Steps of a training of 3D Gaussians that is begun from a session's page."""
    reading: SceneOptions = field(default_factory=SceneOptions)
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Serve until Ctrl-C."""
        import ipaddress
        import threading
        import webbrowser

        from peaking.commands.python_version import say_when_outdated
        from peaking.commands.serving import (
            check_port,
            check_training_steps,
            keep_private,
            preparation_said,
            say_skipped,
        )
        from peaking.server.app import ServerOptions
        from peaking.server.recordings import PlayedRecording
        from peaking.server.serving import CLIENT_DIR, bind, serve
        from peaking.server.traces import Played, PlayedTrace, is_trace
        from peaking.server.warm_up import WarmUp

        check_port(self.port)
        check_training_steps(self.training_steps)
        keep_private()
        name = "localhost" if self.host in ("127.0.0.1", "localhost") else self.host
        with checked_arguments():
            options = self.method.options()
            loopback = self.host == "localhost" or ipaddress.ip_address(self.host).is_loopback
        if not loopback:
            raise ArgumentError(
                f"need a loopback address such as 127.0.0.1 for --host, got {self.host}; "
                "phones are served by: peaking serve"
            )
        recordings: dict[str, Played] = {}
        # Hands are busy with keys and mouse here: from the first view on it takes views by itself.
        query = "?source=virtual&auto=on"
        if self.scene is not None:
            played = self.scene.resolve().name
            if is_trace(self.scene):
                recordings[played] = PlayedTrace(self.scene)
            else:
                recording = self.reading.open(self.scene, confined=not self.follow_links)
                recordings[played] = PlayedRecording(played, recording)
            query = f"?source=replay&recording={quote(played)}&auto=on"
        listener = bind("127.0.0.1" if self.host == "localhost" else self.host, self.port)
        host = f"[{name}]" if ":" in name else name
        address = f"http://{host}:{listener.getsockname()[1]}/"

        reachable = threading.Event()

        def started() -> None:
            say_when_outdated()
            say(f"Capture page:        {address}{query}")
            say(f"List of sessions:    {address}sessions")
            say(f"Folder of sessions:  {self.sessions.resolve()}")
            say("Stop with Ctrl-C.")
            reachable.set()
            if not self.no_open:
                webbrowser.open(address + query)

        serve(
            listener,
            sessions=self.sessions,
            config=ServerOptions(
                devices=None,
                client_dir=CLIENT_DIR,
                options=options,
                keep_exif=self.keep_exif,
                training_steps=self.training_steps,
                recordings=recordings,
            ),
            started=started,
            told=say_skipped,
            warm_up=WarmUp(preparation_said(reachable)),
        )
