"""One scenario as a log: the plan, the decisions of the processes, the speed, and, on request, every frame."""

from __future__ import annotations

from collections.abc import Callable

from canbase_campaign.can_bus import REMOTE
from canbase_campaign.planned import Plan
from canbase_campaign.robots import DrawnRobot
from canbase_campaign.scenario import Result, Start
from canbase_campaign.world import World

LOOK_S = 0.005
SPEED_S = 0.1


class _Teller:
    """Notes what changes in the world."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._told: dict[str, str] = {}
        self._speed_at = 0.0
        world.clock.after(0.0, self._look)

    def _look(self) -> None:
        world = self._world
        driver, watchdog = world.driver.core, world.watchdog.core.status
        self._tell(
            "driver", f"{driver.state.name}: {driver.finding.cause.value} {driver.finding.detail}", driver.state.name
        )
        verdict = f"{watchdog.state.name}: {watchdog.verdict.cause.name} {watchdog.verdict.detail}"
        self._tell("watchdog", verdict, f"{watchdog.state.name} {watchdog.verdict.cause.name}")
        self._tell("watchdog's ladder", watchdog.step.name, watchdog.step.name)
        if world.clock.now_s >= self._speed_at:
            self._speed_at = world.clock.now_s + SPEED_S
            base = world.drives.bench.base
            world.note(f"    truth {base.v_mps:+.3f} m/s {base.w_radps:+.3f} rad/s")
        world.clock.after(LOOK_S, self._look)

    def _tell(self, who: str, text: str, state: str) -> None:
        if self._told.get(who) != state:
            self._told[who] = state
            self._world.note(f"{who} is {text}".rstrip())


def tell(world: World, frames: bool, note: Callable[[float, str], None]) -> None:
    """From now on `note` receives what happens, with its time from now [s]; `frames`: each frame on the bus as well."""
    start = world.clock.now_s
    world.note = lambda text: note(world.clock.now_s - start, text)
    _watch(world, frames)


def _watch(world: World, frames: bool) -> None:
    if frames:
        world.bus.watch = lambda sender, cob_id, data: world.note(
            f"    {sender:9} {cob_id & ~REMOTE:03X} {'request' if cob_id >= REMOTE else data.hex(' ').upper()}"
        )
    _Teller(world)


def replay(drawn: DrawnRobot, plan: Plan, frames: bool, say: Callable[[str], None]) -> Result:
    """Run the scenario with this robot and `say` what happens, line by line."""
    start = Start(drawn, plan.boots)
    world = start.world
    for line in plan.lines(str(drawn)):
        say(line)
    _watch(world, frames)
    result = start.run(plan, lambda at_s, text: say(f"{at_s:8.4f} {text}"))
    say(f"{len(result.violations)} violations")
    for violation in result.violations:
        say(f"{violation.name} at {violation.at_s:.3f} s: {violation.detail}")
    return result
