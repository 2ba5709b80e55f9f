"""`peaking devices`."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from peaking.commands.arguments import ArgumentError
from peaking.terminal import say


@dataclass(frozen=True)
class ListDevices:
    """List the phones and browsers that may use a server, or revoke one; also while it runs.

    Examples:
      peaking devices ~/captures
      peaking devices study
      peaking devices ~/captures --revoke 5e55101112131415
    """

    folder: Annotated[Path, tyro.conf.Positional] = Path("sessions")
    """Folder of the sessions, or of a study."""
    revoke: str | None = None
    """Number of the device that may use it no more; `all`: none of them may."""

    def run(self) -> None:
        """List, or revoke and list."""
        import time

        from peaking.server.devices import Devices, has_devices

        places = [self.folder, self.folder / "sessions"]
        place = next((one for one in places if has_devices(one)), None)
        if place is None:
            raise ArgumentError(
                f"{self.folder}: no device was ever paired there; give a folder "
                "that `peaking serve` or `peaking study serve` has served"
            )
        devices = Devices(place)
        for problem in devices.problems:
            say(f"Note: {problem}", problem=True)
        if self.revoke is not None:
            wanted = [d.id for d in devices.list() if self.revoke in ("all", d.id)]
            if not wanted and self.revoke != "all":
                raise ArgumentError(
                    f"--revoke {self.revoke}: there is no such device; the list names them: "
                    f"peaking devices {self.folder}"
                )
            for one in wanted:
                devices.revoke(one)
        for one in devices.list():
            seen = time.strftime("%Y-%m-%d %H:%M", time.localtime(one.seen_s))
            whose = f" of {', '.join(one.participants)}" if one.participants else ""
            say(f"{one.id}  {one.role + whose:12}  last seen {seen}  {one.name}")
        if not devices.list():
            say("No device may use this server.")
