"""Who may begin a session and add to it."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from peaking.errors import PeakingError


class NotAdmitted(PeakingError):
    """The device is paired, and still may not do this; the message says what to do."""


@runtime_checkable
class Admission(Protocol):
    """Decides what a paired device may do with sessions. Called from threads."""

    def owner(self, session_id: str) -> str | None:
        """Return whose a session is; None where it belongs to nobody. Never waits."""
        ...

    def to_begin(self, session_id: str) -> str | None:
        """Return whose session this will be; None where sessions belong to nobody.

        Raises:
            NotAdmitted: It may not be begun.
        """
        ...

    def to_add(self, session_id: str) -> None:
        """Let a photo or samples be added to a session, or one of its photos be changed.

        Raises:
            NotAdmitted: It may not.
        """
        ...

    def to_end(self, session_id: str) -> None:
        """Let a session be deleted or restored as a whole, or anything of it be erased.

        Raises:
            NotAdmitted: It may not.
        """
        ...


class Everybody:
    """Every paired device may do everything: the sessions are its owner's."""

    def owner(self, session_id: str) -> str | None:
        """Return None: sessions belong to nobody in particular."""
        return None

    def to_begin(self, session_id: str) -> str | None:
        """Return None: sessions belong to nobody in particular."""
        return None

    def to_add(self, session_id: str) -> None:
        """Refuse nothing."""

    def to_end(self, session_id: str) -> None:
        """Refuse nothing."""
