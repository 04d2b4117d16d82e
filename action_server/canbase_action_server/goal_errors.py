"""What can keep a goal from its result: one exception for each step that it reached."""

from __future__ import annotations


class DriveError(Exception):
    """A goal did not come to a result. The subclass gives the step that it reached."""


class NoServerError(DriveError):
    """No action server was found in time; nothing was sent."""


class NoResponseError(DriveError):
    """The server did not answer in time. The goal is canceled if the server accepts it after all."""


class RejectedError(DriveError):
    """The server rejects the goal. `reason`: its sentence; None when none was received: then its log has it."""

    def __init__(self, action: str, reason: str | None) -> None:
        super().__init__(
            f"{action} rejects the goal{f': {reason}' if reason else '; the reason is in the log of its server'}"
        )
        self.reason = reason


class ServerLostError(DriveError):
    """The server went away during the goal. The result is unknown: do not send the goal again blindly."""


class FeedbackLostError(DriveError):
    """No feedback arrived for too long. The cancel of the goal was sent; `cancel` waits for its answer."""


class InterruptedDriveError(DriveError):
    """`interrupted` became true before the goal was accepted. It was canceled if the server accepted it after all."""
