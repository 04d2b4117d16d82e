"""The page `Drive`: locked until a person unlocks it; then hold-to-drive, a goal with progress, and the reset."""

from __future__ import annotations

from typing import Final

from nicegui import Client, ui

from canbase_web.own_command import run
from canbase_web.pages import Pages, section

PERIOD_S: Final = 0.2
RESET_S: Final = 30.0
"""It may have to boot the drives first."""
FIRST_SHARE: Final = 0.2
"""Of the greatest speed: hold-to-drive begins low."""
PAD: Final = (
    ("", "", ""), ("▲", "1,0", "Forward"), ("", "", ""),
    ("◀", "0,1", "Turn left"), ("", "", ""), ("▶", "0,-1", "Turn right"),
    ("", "", ""), ("▼", "-1,0", "Backward"), ("", "", ""),
)  # fmt: skip
MISSING: Final = """\
robot.yaml has no source for this page. Given sources replace the defaults, so the whole section is this. \
Then start canbase again.

mux:
  sources:
    joystick:   {topic: cmd_vel_joy, priority: 100, timeout_s: 0.3}
    web:        {topic: cmd_vel_web, priority: 90, timeout_s: 0.3, nodes: [canbase_web]}
    navigation: {topic: cmd_vel_nav, priority: 50, timeout_s: 0.5}
    action:     {topic: cmd_vel_action, priority: 40, timeout_s: 0.3, nodes: [drive_distance_server]}"""


def add(pages: Pages) -> None:
    """The page at `/drive`."""

    @ui.page("/drive")
    async def drive(client: Client) -> None:
        limits = pages.loaded.robot.limits
        ui.add_head_html('<script src="/static/hold.js"></script>')
        with pages.frame("/drive"):
            with section("Lock"):
                ui.label("This page only reads until you unlock it. It locks itself when it is closed or reloaded.")
                unlocked = ui.switch("unlocked: I see the robot, and nobody is near it")
            with section("Hold to drive"):
                if pages.source:
                    _pad()
                    ui.html('<div id="hold-state" role="status">locked</div>', sanitize=False)
                    ui.label("Hold a button, or an arrow key. Release it: the robot stops.").classes("text-caption")
                    greatest = f"{limits.linear_mps:g} m/s and {limits.angular_radps:g} rad/s"
                    ui.label(f"Share of the greatest speed ({greatest}):")
                    share = ui.slider(min=0.05, max=1.0, step=0.05, value=FIRST_SHARE).props(
                        'label-always aria-label="Share of the greatest speed"'
                    )
                    share.on_value_change(
                        lambda event: ui.run_javascript(f"canbaseHold.setShare({float(event.value)})")
                    )
                else:
                    ui.label(MISSING).style("white-space:pre-wrap")
            with section("Drive a distance"):
                with ui.row().classes("items-end"):
                    distance = ui.number("Distance [m]", value=0.5, step=0.1, format="%.2f")
                    speed = ui.number("Greatest speed [m/s]", value=min(0.2, limits.linear_mps), min=0.01,
                                      max=limits.linear_mps, step=0.05, format="%.2f")  # fmt: skip
                    speed.style("min-width:12rem")
                    start = ui.button("Drive", on_click=lambda: _start(pages, distance, speed))
                    cancel = ui.button("Cancel", on_click=pages.link.goals.cancel).props("outline")
                progress = ui.linear_progress(value=0.0, show_value=False).props('aria-label="Share of the distance"')
                told = ui.label(pages.link.goals.text).props('role="status"')
            with section("Reset a latched stop").props("id=reset"):
                ui.label("The reset itself moves nothing. It is refused while anything orders a velocity.")
                reset = ui.button("Reset").props("outline")
                answer = ui.label("").props('role="status"')
                reset.on_click(lambda: _reset(pages, answer))

        tickets: list[str] = []  # of this page, while it is unlocked

        def lock_or_unlock() -> None:
            is_open = bool(unlocked.value)
            if pages.source:
                pages.hold.revoke(tickets.pop() if tickets else "")
                tickets.extend([pages.hold.ticket()] if is_open else [])
                client.run_javascript(f'canbaseHold.unlock("{tickets[0]}")' if is_open else "canbaseHold.lock()")
                client.run_javascript(
                    f'document.querySelectorAll("[data-hold]").forEach(e => e.disabled = {str(not is_open).lower()})'
                )
            refresh()

        def refresh() -> None:
            goals, is_open = pages.link.goals, bool(unlocked.value)
            start.set_enabled(is_open and not goals.runs)
            cancel.set_enabled(goals.runs)
            reset.set_enabled(is_open)
            progress.set_value(max(0.0, min(1.0, goals.share)))
            told.set_text(goals.text)

        unlocked.on_value_change(lock_or_unlock)
        refresh()
        ui.timer(PERIOD_S, refresh)


def _pad() -> None:
    keys = "".join(
        f'<button type="button" data-hold="{order}" aria-label="{name}" tabindex="-1" disabled>{sign}</button>'
        if sign
        else "<span></span>"
        for sign, order, name in PAD
    )
    ui.html(f'<div class="pad">{keys}</div>', sanitize=False).classes("w-full")


def _start(pages: Pages, distance: ui.number, speed: ui.number) -> None:
    if not distance.value or not speed.value:
        ui.notify("A distance and a speed are numbers other than 0.", type="warning", position="top")
        return
    pages.drive(float(distance.value), float(speed.value))


async def _reset(pages: Pages, answer: ui.label) -> None:
    """`canbase reset`: the emergency stop first, where it holds."""
    answer.set_text("…")
    namespace = ("--namespace", pages.namespace) if pages.namespace else ()
    code, out, error = await run("reset", *namespace, patience_s=RESET_S)
    said = f"{out}\n{error}".strip()
    answer.set_text(said if code is not None else f"canbase reset gave no answer within {RESET_S:.0f} s")
