"""How kinds of real drives differ on the bus from the simulated drive of our own EDS: what they lack, add and do.

Written from the makers' EDS files and manuals, and on purpose apart from the drive profiles of canbase_config: the
driver knows a drive by its profile, the bench by this table, and only a boot on the bus brings the two together.
"assumed" marks what no source has; it is there because some drive does it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field


def _key(index: int, subindex: int = 0) -> int:
    return index << 8 | subindex


@dataclass(frozen=True, slots=True)
class Extra:
    """An object that our EDS does not have: `struct` letter, value after power on, and whether the bus may write it."""

    code: str
    value: int
    writable: bool = False


@dataclass(frozen=True, slots=True)
class Personality:
    """One kind of drive. Indexes are those of the first axis; the second one differs alike."""

    missing: frozenset[int] = frozenset()
    """Indexes that it does not have; without 1005h it heeds no SYNC, and refuses synchronous PDOs."""
    missing_subs: frozenset[int] = frozenset()
    """Single entries (`index << 8 | sub-index`) that it does not have."""
    extras: Mapping[int, Extra] = field(default_factory=dict)
    """Objects of the manufacturer, by `index << 8 | sub-index`."""
    voltage: Mapping[int, float] = field(default_factory=lambda: {_key(0x6079): 0.001})
    """Entries that show the supply, and the volts of one bit; CiA 402-2: 6079h in mV. Read by SDO alone."""
    defaults: Mapping[int, int] = field(default_factory=dict)
    """Values after power on that are not those of our EDS."""
    widths: Mapping[int, str] = field(default_factory=dict)
    """`struct` letters of objects, by index, that have another width than in our EDS."""
    heartbeat_entries: int = 2
    """1016h:0."""
    sets_no_rtr: bool = False
    """Bit 30 is set in the COB-IDs of the PDOs after power on."""
    needs_no_rtr: bool = False
    """A COB-ID of a PDO without bit 30 is refused."""
    motors_by_sub_index: bool = False
    """True: both motors behind one 6040h, 6041h and 6060h, their values at sub-index 1 and 2."""
    vl: bool = False
    """An inverter of mode 2: its velocities are 6042h and 6044h with 16 bits, its ramps 6048h, 6049h and 604Ah."""
    modes: tuple[int, ...] = (3, 9)
    """Values of 6060h that it takes, besides 0."""
    target_unit: str | None = None
    """One bit of 60FFh; None: from robot.yaml."""
    actual_unit: str | None = None
    """One bit of 606Ch; None: from robot.yaml."""
    acceleration_unit: str | None = None
    """One bit of 6083h to 6085h; None: the unit of 60FFh per second. `ms`: time from stand to `full_speed_rpm`."""
    full_speed_rpm: float = 0.0
    boot_delay_s: float | None = None
    """From power on to the boot-up message [s]; None: from the bench."""
    second_boot_up_s: float | None = None
    """Boot loader and firmware each send a boot-up, this far apart [s]; objects answer only after the second."""
    starts_operational: bool = False
    """Goes to OPERATIONAL by itself after its boot-up."""
    sdo_delay_s: float | None = None
    """From a request to its answer [s]; None: from the bench."""
    block_transfers: bool = True
    """Whether it has SDO block transfers; False: refused with 0504 0001h."""
    shows_mode_without_power: bool = True
    """False: 6061h is 0 before OPERATION ENABLED."""
    locked_with_power: frozenset[int] = frozenset()
    """Indexes that can only be written while the power stage is off; else 0800 0022h."""
    heartbeat_fault_needs_communication_reset: bool = False
    """Fault resets are in vain after 8130h until NMT reset communication or node."""
    command_timeout_s: float | None = None
    """The vendor's own watchdog: without a command for this long the motors stop; the next one starts them [s]."""
    command_timeout_object: int | None = None
    """The entry that sets it in ms (0: off), where the bus can."""

    @property
    def heeds_guarding(self) -> bool:
        """It monitors node guarding, and no heartbeat: it stops when a master that guarded it stays away."""
        return self.heartbeat_entries == 0 and not self.missing & {0x100C, 0x6007}

    @property
    def heeds_heartbeats(self) -> bool:
        """It watches its masters' heartbeats, and stops when one stays away."""
        return self.heartbeat_entries > 0 and 0x6007 not in self.missing

    @property
    def heeds_masters(self) -> bool:
        """It stops when one of its masters stays away, whatever else they send: setpoints of another one count for
        nothing."""
        return self.heeds_heartbeats or self.heeds_guarding

    def alone_s(self, configured_s: float) -> float:
        """From the last frame of its masters, who set every time limit to `configured_s`, to its own stop at most [s].

        Infinity: it goes on turning.
        """
        if self.heeds_masters or self.command_timeout_object is not None:
            return configured_s
        return math.inf if self.command_timeout_s is None else self.command_timeout_s


_NO_REACTION: dict[int, int] = {_key(0x6007): 0}
"""What a drive without 6007h does with its motors when the connection is lost: nothing, which is the worst case."""
_NO_SYNC_COUNTER = frozenset({0x1019})
_NO_GUARDING = frozenset({0x100C, 0x100D})
_LACKS_SELF_STOP = frozenset({0x1016, 0x1029, 0x6007})


def sdo_channel(index: int, requests: int = 0x8000_0000, answers: int = 0x8000_0000) -> dict[int, Extra]:
    """A further SDO server, 1201h to 127Fh, with its COB-IDs after power on; bit 31: closed (CiA 301)."""
    cob_ids = {_key(index, 1): Extra("I", requests, writable=True), _key(index, 2): Extra("I", answers, writable=True)}
    return {_key(index): Extra("B", 2), **cob_ids}


_RPDO_TIMERS = frozenset({_key(index, 5) for index in range(0x1400, 0x1404)})

GENERIC = Personality()

PERSONALITIES: Mapping[str, Personality] = {
    "generic": GENERIC,
    "epos4": Personality(
        missing=_NO_SYNC_COUNTER | _NO_GUARDING | {0x6078, 0x6079},  # EDS
        missing_subs=_RPDO_TIMERS,  # EDS: no 1400h:5
        sets_no_rtr=True,  # EDS
        defaults={_key(0x6007): 3, _key(0x605A): 6, _key(0x1029, 1): 0},  # EDS
        extras={  # EDS: types
            _key(0x2200, 1): Extra("H", 240),
            _key(0x30D1, 1): Extra("i", 0),
            _key(0x3201, 1): Extra("h", 312),
        },
        voltage={_key(0x2200, 1): 0.1},  # assumed, as in its profile
        target_unit="rpm",  # EDS 60A9h = 00B44700h
        actual_unit="rpm",
        acceleration_unit="rpm/s",  # manual of the motion controller
        locked_with_power=frozenset({0x6007, 0x605A, 0x605E}),  # "many objects"; that these are among them is assumed
        heartbeat_fault_needs_communication_reset=True,  # seen by users: 8130h and 8120h
    ),
    "roboteq": Personality(
        missing=_NO_SYNC_COUNTER | {0x1005, 0x1029, 0x6007, 0x603F, 0x605A, 0x605E, 0x6078, 0x6079},  # EDS v80
        missing_subs=_RPDO_TIMERS,  # EDS
        sets_no_rtr=True,  # EDS
        defaults=_NO_REACTION | {_key(base + n, 2): 255 for base in (0x1400, 0x1800) for n in range(4)},  # EDS
        extras={  # EDS: volts and battery amps, temperatures
            _key(0x210D, 2): Extra("H", 240),
            _key(0x2100, 1): Extra("h", 0),
            _key(0x2100, 2): Extra("h", 0),
            _key(0x210F, 2): Extra("h", 31),
        },
        voltage={_key(0x210D, 2): 0.1},  # assumed, as in its profile
        heartbeat_entries=4,  # EDS
        needs_no_rtr=True,  # refused with 0609 0030h, as a user of canopen found
        target_unit="rpm",
        actual_unit="rpm",
        acceleration_unit="0.1rpm/s",
        starts_operational=True,  # manual of the battery system of the same manufacturer
        command_timeout_s=1.0,  # RWD; then the earlier speed comes back with the next command
    ),
    "zlac8015d": Personality(
        block_transfers=False,  # assumed: no source has them
        missing=_NO_SYNC_COUNTER
        | _NO_GUARDING  # manual of ZLAC8030L: heartbeat producer alone
        | _LACKS_SELF_STOP
        | {0x1010, 0x1011, 0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x60C2, 0x606B, 0x606D, 0x6078, 0x6079},
        missing_subs=_RPDO_TIMERS,  # the EDS has them; no source shows that the firmware heeds them
        extras={
            _key(0x2000): Extra("H", 0, writable=True),  # EDS: communication offline time
            _key(0x200F): Extra("H", 1, writable=True),  # both targets packed after power on: assumed
        },
        defaults=_NO_REACTION,
        heartbeat_entries=0,
        motors_by_sub_index=True,
        modes=(3,),
        target_unit="rpm",
        actual_unit="0.1rpm",
        acceleration_unit="ms",
        full_speed_rpm=1000.0,
        command_timeout_object=_key(0x2000),
    ),
    "nanotec": Personality(
        missing_subs=_RPDO_TIMERS,  # assumed
        defaults={_key(0x6007): 0, _key(0x60C2, 2): -3},  # 6007h assumed
        heartbeat_entries=1,  # assumed
        second_boot_up_s=0.3,  # boot loader and firmware; the time is assumed
    ),
    "elmo_gold": Personality(
        missing=_NO_SYNC_COUNTER | _NO_GUARDING,  # DCF
        missing_subs=_RPDO_TIMERS,  # DCF
        defaults={_key(0x6007): 1, _key(0x1029, 1): 1, _key(0x605A): 2, _key(0x605E): 2},  # DCF
        extras={_key(0x22A2): Extra("H", 38)},  # DCF
        target_unit="counts/s",  # default of the manufacturer's tool
        actual_unit="counts/s",
        acceleration_unit="counts/s2",
    ),
    "kinco": Personality(
        missing_subs=_RPDO_TIMERS,  # assumed
        defaults={_key(0x6007): 0},  # 1 is needed for alarm and stop
        heartbeat_entries=1,  # assumed
        modes=(3, -3),
        target_unit="counts/ms/16384",
        actual_unit="counts/ms/16384",
        acceleration_unit="counts/ms2/16384",
        shows_mode_without_power=False,  # a user's report
        sdo_delay_s=0.004,  # assumed
    ),
    "technosoft": Personality(
        missing=_NO_SYNC_COUNTER | {0x1016, 0x1029, 0x60C2, 0x603F},  # EDS
        missing_subs=_RPDO_TIMERS,  # EDS
        defaults={_key(0x6007): 0},  # EDS
        heartbeat_entries=0,
        modes=(3,),  # EDS 6502h: no mode 9
        target_unit="counts/ms/65536",
        actual_unit="counts/ms/65536",
        acceleration_unit="counts/ms2/65536",
        boot_delay_s=0.6,  # assumed: a late boot-up
    ),
    "tmcm1636": Personality(
        missing=_NO_SYNC_COUNTER | {0x6007, 0x603F, 0x6078, 0x6079},  # EDS
        missing_subs=_RPDO_TIMERS,  # EDS
        sets_no_rtr=True,  # EDS
        defaults=_NO_REACTION | {_key(0x1029, 1): 0},  # EDS
        heartbeat_entries=1,  # EDS
        modes=(3,),
        target_unit="rpm",
        actual_unit="rpm",
        acceleration_unit="rpm/s",
    ),
    "inverter": Personality(
        missing=frozenset({0x606B, 0x606D, 0x606F, 0x6079}),  # assumed
        extras=sdo_channel(0x1201),  # Lenze 8400, manual: closed as delivered
        missing_subs=_RPDO_TIMERS,  # assumed
        vl=True,
        modes=(2,),
        target_unit="rpm",
        actual_unit="rpm",
        defaults={_key(0x6046, 1): 30, _key(0x6046, 2): 1500, _key(0x604C, 1): 1, _key(0x604C, 2): 1},  # assumed
    ),
    "dryve_d1": Personality(
        missing=_NO_SYNC_COUNTER | {0x1011, 0x1029, 0x6007, 0x605A, 0x605E, 0x6077, 0x6079},  # EDS
        sets_no_rtr=True,  # EDS
        defaults=_NO_REACTION,
        heartbeat_entries=1,  # EDS
        modes=(3,),  # operating manual: 6060h takes 1, 3, 6 and 8
    ),
}
"""By the name that the drive's profile has in robot.yaml."""
