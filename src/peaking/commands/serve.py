"""`peaking serve`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.commands.options import MethodOptions
from peaking.terminal import say

MIN_TOKEN_CHARS = 8


@dataclass(frozen=True)
class Serve:
    """Serve the capture page to phones in the local network; prints a link and its QR code.

    Serves https with its own certificate, because phones give other pages neither the camera nor
    augmented reality. Requests without the token in the link are rejected.

    Examples:
      peaking serve ~/captures
      peaking serve --adb                # a phone on a USB cable
      peaking serve --port 9443 --preset paper
      peaking serve --generator adampi   # layered MPIs first, AdaMPI's when they are ready
    """

    sessions: Annotated[Path, tyro.conf.Positional] = Path("sessions")
    """Folder of the sessions; created if it does not exist."""
    host: str = "0.0.0.0"
    """Address to listen on; default: all of them."""
    port: int = 8443
    """Port to listen on, or the next free one; 0: any free port."""
    adb: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """For a phone on a USB cable: http on localhost, through `adb reverse`."""
    token: str | None = None
    """Secret in the link, at least 8 characters; default: a new random one at each start."""
    keep_exif: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Keep the metadata of photos: EXIF with GPS, XMP, comments."""
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Serve until Ctrl-C."""
        import secrets

        import segno

        from peaking.commands.serving import check_port, https_origins, keep_private, say_skipped
        from peaking.server.app import ServerOptions
        from peaking.server.certificates import config_folder
        from peaking.server.serving import CLIENT_DIR, bind, serve

        token = self.token or secrets.token_urlsafe(18)
        if len(token) < MIN_TOKEN_CHARS:
            raise ArgumentError(f"need --token of at least {MIN_TOKEN_CHARS} characters")
        check_port(self.port)
        keep_private()
        with checked_arguments():
            options = self.method.options()
        listener = bind("127.0.0.1" if self.adb else self.host, self.port)
        port = listener.getsockname()[1]
        origins, context = [f"http://localhost:{port}"], None
        if not self.adb:
            origins, context = https_origins(self.host, port)
        links = [f"{origin}/#token={token}" for origin in origins]

        def started() -> None:
            segno.make(links[0], error="m").terminal(compact=True)
            say("Open this link on the phone (or scan the code with its camera):")
            for link in links:
                say(f"  {link}")
            if self.adb:
                say(f"First connect the phone by cable and run:  adb reverse tcp:{port} tcp:{port}")
            else:
                say(
                    "The phone warns of the certificate once: choose Advanced, then Proceed.",
                    "To avoid the warning, copy this file to the phone and install it as a CA",
                    f"certificate:  {config_folder() / 'peaking-ca.pem'}",
                )
            say(f"Folder of sessions:  {self.sessions.resolve()}")
            say("Stop with Ctrl-C.")

        serve(
            listener,
            sessions=self.sessions,
            config=ServerOptions(
                token=token,
                client_dir=CLIENT_DIR,
                options=options,
                keep_exif=self.keep_exif,
                secure=not self.adb,
            ),
            context=context,
            started=started,
            told=say_skipped,
        )
