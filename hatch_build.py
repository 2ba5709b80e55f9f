"""Build hook: a source distribution or wheel without the web client is not built."""

from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

PAGE = Path("src/peaking/server/client/index.html")


class WebClientHook(BuildHookInterface):  # type: ignore[type-arg]
    """Looks whether the client is built; an editable install does without it until it is served."""

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Stop with one sentence when it is not."""
        if version != "editable" and not (Path(self.root) / PAGE).is_file():
            self.app.abort(
                f"peaking: the web client is not built ({PAGE} is missing). "
                "Run `make client` in a checkout first, or install a release."
            )
