"""`peaking serve`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from peaking.commands.arguments import ArgumentError, checked_arguments
from peaking.commands.options import MethodOptions
from peaking.terminal import say


@dataclass(frozen=True)
class Serve:
    """Serve the capture page to phones in the local network; prints a link and its QR code.

    Serves https with its own certificate, because phones give other pages neither the camera nor
    augmented reality. The link pairs one phone, once; a phone that is paired stays so, also after a
    restart, as long as it is used every week. The page /devices and `peaking devices` list them.

    Of what the automatic shutter takes, 240 views stay in a session; beyond that the least missed
    are set aside, in at most 2 GB, and can be brought back.

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
    token_file: Path | None = None
    """File with a secret that pairs scripted clients; or the environment's PEAKING_TOKEN."""
    token: str | None = None
    """Refused: other users can read command lines. Use --token-file or PEAKING_TOKEN."""
    keep_exif: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Keep the metadata of photos: EXIF with GPS, XMP, comments."""
    training_steps: int = 2000
    """Steps of a training of 3D Gaussians that is begun from a session's page."""
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Serve until Ctrl-C."""
        import threading

        from peaking.commands.python_version import say_when_outdated
        from peaking.commands.serving import (
            Invitation,
            check_port,
            check_training_steps,
            fixed_token,
            https_origins,
            keep_private,
            preparation_said,
            say_skipped,
        )
        from peaking.server.app import ServerOptions
        from peaking.server.certificates import config_folder
        from peaking.server.devices import Devices
        from peaking.server.serving import CLIENT_DIR, bind, serve
        from peaking.server.warm_up import WarmUp

        if self.token is not None:
            raise ArgumentError(
                "--token: other users of this computer can read it in the list of processes; put "
                "another one into a file, and give --token-file, or set PEAKING_TOKEN"
            )
        token = fixed_token(self.token_file)
        check_port(self.port)
        check_training_steps(self.training_steps)
        keep_private()
        with checked_arguments():
            options = self.method.options()
        devices = Devices(self.sessions, fixed_secret=token)
        for problem in devices.problems:
            say(f"Note: {problem}", problem=True)
        listener = bind("127.0.0.1" if self.adb else self.host, self.port)
        port = listener.getsockname()[1]
        origins, context = [f"http://localhost:{port}"], None
        if not self.adb:
            origins, context = https_origins(self.host, port)
        pages = [f"{origin}/" for origin in origins]
        invitation = Invitation(devices, pages, what="phone")

        reachable = threading.Event()

        def started() -> None:
            say_when_outdated()
            say(
                "Open this link on the phone, or scan the code with its camera. It pairs one phone."
            )
            invitation.show()
            if self.adb:
                say(f"First connect the phone by cable and run:  adb reverse tcp:{port} tcp:{port}")
            else:
                say(
                    "The phone warns of the certificate once: choose Advanced, then Proceed.",
                    "To avoid the warning, copy this file to the phone and install it as a CA",
                    f"certificate:  {config_folder() / 'peaking-ca.pem'}",
                )
            say(f"Capture page:        {pages[0]}  (this and the list: on devices that are paired)")
            say(f"List of sessions:    {pages[0]}sessions")
            say(f"Folder of sessions:  {self.sessions.resolve()}")
            say("Stop with Ctrl-C.")
            reachable.set()

        serve(
            listener,
            sessions=self.sessions,
            config=ServerOptions(
                devices=devices,
                client_dir=CLIENT_DIR,
                options=options,
                pages=pages,
                keep_exif=self.keep_exif,
                training_steps=self.training_steps,
            ),
            context=context,
            started=started,
            told=say_skipped,
            warm_up=WarmUp(preparation_said(reachable)),
        )
