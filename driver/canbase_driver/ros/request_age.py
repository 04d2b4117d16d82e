"""Which requests are too old to be carried out: their caller has given up, and may have gone on to something else.

A ROS request carries no deadline. Two things give its age: whether this process stood still before it was taken in
(`canbase_runtime.receive_time`), and the time at which it was sent. A stop is obeyed however late it comes. Pure.
"""

from __future__ import annotations

from typing import Final

LONGEST_S: Final = 5.0
"""The least time that the callers of this project wait for the answer to a request that needs no boot."""


def refusal(waited: bool, sent_s: float, now_s: float) -> str:
    """Why a request must not be carried out; empty: it may.

    `waited`: it may have waited while this process stood still. `sent_s`: when it was sent, by its sender's system
    clock [s], 0: not known; `now_s`: this computer's system clock.
    """
    if waited:
        return "refused: it may be old, because motor_driver did not run before it; send it again"
    age_s = now_s - sent_s
    if sent_s == 0.0 or abs(age_s) <= LONGEST_S:
        return ""
    if age_s > 0.0:
        return f"refused: it was sent {age_s:.1f} s ago (at most {LONGEST_S:.0f} s); send it again, and compare clocks"
    return f"refused: by its sender's clock it comes from {-age_s:.1f} s ahead; set the clocks of both computers"
