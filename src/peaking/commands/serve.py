"""`peaking serve`."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from peaking.commands.options import MethodFlags


@dataclass(frozen=True)
class Serve:
    """Serve phones in the same network: open the link that it prints on a phone, and capture.

    Serves https with a certificate of its own, because phones show neither camera nor augmented
    reality to other pages. Who does not have the link is refused.

    Examples:
      peaking serve ~/captures
      peaking serve --adb                # a phone on a USB cable
      peaking serve --port 9443 --preset paper
      peaking serve --generator adampi   # layered MPIs at once, learned ones when they are ready
    """

    folder: Annotated[Path, tyro.conf.Positional] = Path("sessions")
    """Folder for the sessions; made when it is not there."""
    host: str = "0.0.0.0"
    """Address to listen at; all of them by default."""
    port: int = 8443
    """Port, or the next free one; 0 takes any."""
    adb: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """For a phone on a USB cable: plain http at localhost, through `adb reverse`."""
    token: str | None = None
    """Secret of the pairing link; a new one is drawn when it is not given."""
    method: MethodFlags = field(default_factory=MethodFlags)

    def run(self) -> None:
        """Serve until Ctrl-C."""
        import secrets
        import socket

        import segno

        from peaking.server.app import ServerConfig
        from peaking.server.certificates import (
            authority,
            config_folder,
            lan_addresses,
            server_context,
        )
        from peaking.server.run import CLIENT_DIR, bind, serve

        token = self.token or secrets.token_urlsafe(18)
        if len(token) < 8:
            raise ValueError("need a --token of at least 8 characters")
        listener = bind("127.0.0.1" if self.adb else self.host, self.port)
        port = listener.getsockname()[1]
        addresses: list[str] = []
        context = None
        if self.adb:
            links = [f"http://localhost:{port}/#token={token}"]
        else:
            addresses = lan_addresses() if self.host in ("0.0.0.0", "::") else [self.host]
            names = [*addresses, "localhost", "127.0.0.1", socket.gethostname()]
            context = server_context(authority(config_folder()), list(dict.fromkeys(names)))
            hosts = [f"[{a}]" if ":" in a else a for a in addresses] or ["localhost"]
            links = [f"https://{host}:{port}/#token={token}" for host in hosts]

        def started() -> None:
            segno.make(links[0], error="m").terminal(compact=True)
            print("Open this on the phone (scan the code with its camera):")
            for link in links:
                print(f"  {link}")
            if self.adb:
                print(f"First, with the phone on the cable:  adb reverse tcp:{port} tcp:{port}")
            else:
                print(
                    "The phone warns of the certificate once: choose Advanced, then Proceed.\n"
                    "To be rid of the warning, copy this file to the phone and install it as a CA\n"
                    f"certificate:  {config_folder() / 'peaking-ca.pem'}"
                )
            print(f"Sessions are kept in {self.folder.resolve()}")
            print("Stop with Ctrl-C.", flush=True)

        serve(
            listener,
            sessions=self.folder,
            config=ServerConfig(
                token=token,
                client_dir=CLIENT_DIR,
                options=self.method.options(),
                secure=not self.adb,
            ),
            context=context,
            started=started,
            told=lambda problem: print(f"left alone: {problem}", file=sys.stderr),
        )
