"""`peaking view`."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import tyro

from peaking.commands.arguments import checked_arguments
from peaking.commands.options import MethodOptions
from peaking.commands.scenes import SceneOptions
from peaking.terminal import say

if TYPE_CHECKING:
    from peaking.share.place import SharedPlace


@dataclass(frozen=True)
class View:
    """Look at a scene in the browser: its light field, its cameras and points, or 3D Gaussians.

    Only this machine can reach the page. It shows at once: what it needs is made when it asks.
    Nothing is written to the disk.

    Examples:
      peaking view scenes/desk
      peaking view ~/captures/garden
      peaking view view.mpi
      peaking view garden.spz
    """

    path: Annotated[Path, tyro.conf.Positional]
    """A recording of any format (docs/formats.md; a session of `peaking serve` is one), an .mpi
    file, or 3D Gaussians: .ply, .spz, .glb, .gltf."""
    port: int = 8000
    """Port to listen on, or the next free one; 0: any free port."""
    follow_links: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Show also what links lead to from outside the recording."""
    no_open: Annotated[bool, tyro.conf.FlagCreatePairsOff] = False
    """Do not open the browser."""
    reading: SceneOptions = field(default_factory=SceneOptions)
    method: MethodOptions = field(default_factory=MethodOptions)

    def run(self) -> None:
        """Serve until Ctrl-C."""
        import contextlib
        import webbrowser

        from peaking.commands.serving import check_port
        from peaking.server.serving import CLIENT_DIR, bind
        from peaking.share.place_server import PlaceServer

        check_port(self.port)
        shared = self._place()
        with PlaceServer(bind("127.0.0.1", self.port), shared, CLIENT_DIR) as server:
            address = f"http://localhost:{server.port}/"
            say(f"{shared.place.title}: {address}", "Stop with Ctrl-C.")
            server.warm_up()
            if not self.no_open:
                webbrowser.open(address)
            with contextlib.suppress(KeyboardInterrupt):
                server.serve_forever()

    def _place(self) -> SharedPlace:
        from peaking.export.splats import is_splat_file, read_splats
        from peaking.share.file_place import place_of_mpi, place_of_splats
        from peaking.share.recorded_files import RecordedFiles
        from peaking.share.recorded_place import place_of_recording, whole_contents

        if self.path.suffix.lower() == ".mpi":
            return place_of_mpi(self.path)
        if is_splat_file(self.path):
            return place_of_splats(self.path, read_splats(self.path))[0]
        with checked_arguments():
            options = self.method.options()
        files = RecordedFiles(self.reading.open(self.path, confined=not self.follow_links), options)
        return place_of_recording(files, whole_contents(files))
