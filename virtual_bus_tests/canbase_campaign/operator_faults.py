"""People as faults: a joystick held through everything, two hands, a stop button tapped, resets that are too early."""

from __future__ import annotations

from collections.abc import Callable
from random import Random
from typing import TYPE_CHECKING

from canbase_campaign.fault import LONG, SHORT, Arguments, Change, Kind, nothing, stays
from canbase_driver.supervision.lifecycle import Aim
from canbase_velocity.twist import ZERO, Twist

if TYPE_CHECKING:
    from canbase_campaign.outside import Surroundings
    from canbase_campaign.world import World

AGAIN_S = 0.05
RESTS, DIES_AT = 4, 14
"""Of `end_before_stop`: the joystick is at rest, then deflected, so many times AGAIN_S long."""
Do = Callable[["World", "Surroundings", Arguments, int], None]

RETRY_S, AWAY_S = 0.2, 0.3
"""A person tries again after this time; a process that was killed is started again after this time [s]."""


def goes_on(do: Do, after: Do | None = None, every_s: float = AGAIN_S) -> tuple[Change, Change]:
    """Somebody does something again and again (with its number) until the end, then `after`."""
    running: set[int] = set()

    def begin(world: World, around: Surroundings, given: Arguments) -> None:
        running.add(id(given))

        def again(number: int) -> None:
            if id(given) in running:
                do(world, around, given, number)
                world.clock.after(every_s, again, number + 1)

        again(0)

    def end(world: World, around: Surroundings, given: Arguments) -> None:
        running.discard(id(given))
        if after is not None:
            after(world, around, given, 0)

    return begin, end


def hold_stick(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """The joystick orders the same motion, whatever happens."""
    world.topics.publish("cmd_vel_joy", given["twist"])


def release_stick(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """It sends zero, as a joystick at rest does."""
    world.topics.publish("cmd_vel_joy", ZERO)


def two_hands(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """Joystick and navigation order opposite motions."""
    twist: Twist = given["twist"]
    world.topics.publish("cmd_vel_joy" if number % 2 else "cmd_vel_nav", twist.scaled(1.0 if number % 2 else -1.0))


def tap_button(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """Pressed and released in turn."""
    around.press(number % 2 == 0)


def release_button(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """It is not pressed."""
    around.press(False)


def end_before_stop(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """The joystick's program ends while it orders motion; then the stop button is pressed, and released."""
    if number < DIES_AT:
        world.topics.publish("cmd_vel_joy", given["twist"] if number >= RESTS else ZERO)
    elif number == DIES_AT + given["waits"]:
        around.press(True)
    elif number == DIES_AT + given["waits"] + given["presses"]:
        around.press(False)


def reset_again(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """A reset, whether it is time for it or not."""
    around.reset()


def tap_stick(world: World, around: Surroundings, given: Arguments, number: int) -> None:
    """A touch each second, of a few millimetres; else the joystick is at rest."""
    world.topics.publish("cmd_vel_joy", given["twist"] if 0 < number % 50 < 4 else ZERO)


def ask_to_stop(world: World, around: Surroundings, given: Arguments) -> None:
    """Service motor_driver/stop."""
    world.driver.stop()


def deactivate(world: World, around: Surroundings, given: Arguments) -> None:
    """Lifecycle transition of motor_driver."""
    world.driver.aim(Aim.CONFIGURED)


def activate(world: World, around: Surroundings, given: Arguments) -> None:
    """Lifecycle transition of motor_driver, requested again until the process runs."""
    if world.driver.running:
        world.driver.aim(Aim.ACTIVE)
    else:
        world.clock.after(RETRY_S, lambda: activate(world, around, given))


def switch_off_and_kill(world: World, around: Surroundings, given: Arguments) -> None:
    """Deactivated; killed during or after the stop, and started again."""
    deactivate(world, around, given)
    world.clock.after(given["killed_s"], world.driver.die)
    world.clock.after(given["killed_s"] + AWAY_S, world.driver.restart)


def touch(random: Random) -> Arguments:
    """A motion that is too slow and too short to be missed: about 5 mm."""
    return {"twist": Twist(random.choice((-1.0, 1.0)) * random.uniform(0.04, 0.08), 0.0)}


def steady(random: Random) -> Arguments:
    """A motion to hold."""
    speed_mps = random.choice((-1.0, 1.0)) * random.uniform(0.15, 0.8)
    return {"twist": Twist(speed_mps, random.choice((0.0, random.uniform(-2.0, 2.0))))}


def steady_until_it_ends(random: Random) -> Arguments:
    """A motion, and how long after it the stop button is pressed, and for how long, in AGAIN_S."""
    return {**steady(random), "waits": random.randint(1, 6), "presses": random.randint(2, 16)}


PEOPLE: dict[str, Kind] = {
    "source_ends_before_stop": Kind(
        "a joystick's program ends in motion, then the stop button is pressed and released", (2.0, 4.0),
        steady_until_it_ends, *goes_on(end_before_stop, release_button),
    ),
    "stick_tapped": Kind(
        "a stick is touched for a moment, again and again", (2.0, 4.0), touch,
        *goes_on(tap_stick, release_stick, every_s=0.02),
    ),
    "stop_requested": Kind("motor_driver is asked to stop", SHORT, nothing, ask_to_stop, stays),
    "driver_deactivated": Kind(
        "motor_driver is deactivated, and activated again", LONG, nothing, deactivate, activate
    ),
    "driver_switched_off_and_killed": Kind(
        "motor_driver is deactivated, killed and started again; later it is activated", (2.5, 4.0),
        lambda random: {"killed_s": random.uniform(0.02, 1.5)}, switch_off_and_kill, activate,
    ),
    "stick_held": Kind(
        "a stick is held through everything", (0.8, 4.0), steady,
        *goes_on(hold_stick, release_stick),
    ),
    "two_hands": Kind(
        "joystick and navigation order opposite motions", LONG, steady, *goes_on(two_hands)
    ),
    "button_tapped": Kind(
        "the emergency stop is pressed and released again and again", (0.05, 0.6), nothing,
        *goes_on(tap_button, release_button),
    ),
    "resets_too_early": Kind(
        "an operator resets again and again", LONG, nothing, *goes_on(reset_again, every_s=0.2)
    ),
}  # fmt: skip
