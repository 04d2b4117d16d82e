"""The oddities that are drawn, each with the clause that makes it legal. CiA 301 4.2, CiA 402-2 3.0, ISO 11898-1.

What a drive's own manual says about an oddity is in `Drawn.keys`: nothing here knows what canbase does about it.
"""

from __future__ import annotations

from collections.abc import Mapping
from random import Random

from canbase_sim.cia301.dictionary import NO_RTR, key
from canbase_sim.odd.manner import Bounds
from canbase_sim.odd.oddity import Drawn, Oddity, both, with_manner, with_personality
from canbase_sim.personality import Extra, sdo_channel

ABORT_CODES = (
    0x0504_0005, 0x0601_0000, 0x0601_0001, 0x0601_0002, 0x0602_0000, 0x0604_0043, 0x0604_0047, 0x0606_0000,
    0x0607_0010, 0x0607_0012, 0x0607_0013, 0x0609_0011, 0x0609_0030, 0x0609_0031, 0x0609_0032, 0x0609_0036,
    0x060A_0023, 0x0800_0000, 0x0800_0020, 0x0800_0021, 0x0800_0022, 0x0800_0024,
)  # fmt: skip
"""Every one that a server may give for an object (CiA 301, SDO abort codes)."""
RANGES = (0x0609_0030, 0x0609_0031, 0x0609_0032)
OPTIONAL = (
    key(0x1016), key(0x1018, 2), key(0x1018, 3), key(0x1018, 4), key(0x1019), key(0x1029, 1), key(0x6007), key(0x605A),
    key(0x605E), key(0x6061), key(0x6077), key(0x6083), key(0x6084),
)  # fmt: skip
"""Entries of category optional (CiA 301, CiA 402-2) that masters like to have."""
STEEP = {key(index): 100_000 for index in (0x6083, 0x6084)}
"""Ramps of a drive that lets nobody set them: hard, 5 m/s² of the sample robot. A soft one only the watchdog finds."""
GENERAL_ERROR = 0x0800_0000
TYPES = tuple(key(base + n, 2) for base in (0x1400, 0x1800) for n in range(4))
EVENT_TYPES = (254, 255)
VELOCITY_UNITS = {
    "rpm": {key(0x60A9): Extra("I", 0x00B4_4700)},
    "0.001rpm": {key(0x60A9): Extra("I", 0xFDB4_4700)},
    "rev/s": {key(0x608C): Extra("B", 0xA3), key(0x608B): Extra("b", 0)},
    "0.001rev/s": {key(0x60A9): Extra("I", 0xFDB4_0300)},
    "counts/s": {key(0x60A9): Extra("I", 0x00B5_0300)},
}
"""Units of 60FFh that are not those of the sample robot's file, and the objects by which a drive reports them."""
COUNTS_PER_MOTOR_REV, COUNTS_PER_M = 4096, 130_379.7
"""6064h of the sample robot."""
RAMP_BITS_PER_MPS2 = 19098.6
"""6085h of the sample robot, whose velocity unit is 0.1 rpm: gear 20, wheel radius 0.1 m."""


def _hex(entry: int) -> str:
    return f"{entry >> 8:04X}h:{entry & 0xFF}"


def _refused(random: Random) -> Drawn:
    entry, code = random.choice(OPTIONAL), random.choice(ABORT_CODES)
    reads, writes = random.choice(((True, True), (True, False), (False, True)))
    refused = with_manner(refused_reads={entry: code} if reads else {}, refused_writes={entry: code} if writes else {})
    change = both(refused, with_personality(defaults=STEEP))
    how = " and ".join(word for word, does in (("reading", reads), ("writing", writes)) if does)
    return Drawn(f"aborts {how} {_hex(entry)} with {code:08X}h", change)


def _missing(random: Random) -> Drawn:
    index = random.choice((0x1016, 0x1019, 0x1029, 0x6007, 0x603F, 0x605A, 0x605E, 0x6061, 0x6077, 0x6083, 0x6084))
    entries = {"heartbeat_entries": 0} if index == 0x1016 else {}
    change = with_personality(missing=frozenset((index,)), defaults=STEEP, **entries)
    return Drawn(f"has no {index:04X}h", change)


def _watches(random: Random) -> Drawn:
    entries = random.choice((1, 3, 8))
    return Drawn(f"1016h has {entries} entries", with_personality(heartbeat_entries=entries))


def _slow_answers(random: Random) -> Drawn:
    delay_s = round(10 ** random.uniform(-2.0, 0.3), 3)
    timeout_s = round(2.0 * delay_s + 0.1, 2)
    keys = {"sdo.timeout_s": timeout_s, "timeouts.sdo_s": timeout_s, "timeouts.boot_s": round(150.0 * delay_s + 20.0)}
    return Drawn(f"answers each SDO after {delay_s} s", with_personality(sdo_delay_s=delay_s), keys)


def _jittery_answers(random: Random) -> Drawn:
    jitter_s = round(10 ** random.uniform(-2.5, -0.7), 3)
    return Drawn(f"answers SDOs up to {jitter_s} s later", with_manner(answer_jitter_s=jitter_s))


def _lost_answers(random: Random) -> Drawn:
    share = round(random.uniform(0.01, 0.05), 3)
    return Drawn(f"never answers {share:.1%} of its SDO requests", with_manner(answers_lost=share))


def _sizeless(_random: Random) -> Drawn:
    return Drawn("expedited answers without their size", with_manner(answers_sized=False))


def _segmented(_random: Random) -> Drawn:
    return Drawn("answers each upload in segments", with_manner(answers_expedited=False))


def _doubled(random: Random) -> Drawn:
    share = round(10 ** random.uniform(-4.0, -2.7), 5)
    return Drawn(f"{share:.3%} of its frames are sent twice", with_manner(frames_twice=share))


def _late_pdos(random: Random) -> Drawn:
    late_s = round(random.uniform(0.0005, 0.004), 4)
    return Drawn(f"TPDOs up to {1e3 * late_s:.1f} ms after SYNC", with_manner(pdo_late_s=late_s))


def _late_boot(random: Random) -> Drawn:
    delay_s = round(random.uniform(0.3, 6.0), 2)
    return Drawn(f"boot-up message {delay_s} s after power on", with_personality(boot_delay_s=delay_s))


def _second_boot_up(random: Random) -> Drawn:
    gap_s = round(random.uniform(0.05, 0.8), 2)
    return Drawn(f"boot loader and firmware send a boot-up, {gap_s} s apart", with_personality(second_boot_up_s=gap_s))


def _slow_reset(random: Random) -> Drawn:
    reset_s = round(10 ** random.uniform(-0.5, 1.1), 2)
    keys = {"start.boot_up_s": round(reset_s + 2.0, 1)}
    return Drawn(f"needs {reset_s} s for NMT reset communication", with_manner(reset_s=reset_s), keys)


def _no_boot_up(_random: Random) -> Drawn:
    return Drawn("sends no boot-up message", with_manner(boot_ups=False))


def _starts_operational(_random: Random) -> Drawn:
    return Drawn("goes to operational by itself", with_personality(starts_operational=True))


def _other_profile(random: Random) -> Drawn:
    value = random.choice((0x0, 0x000F_0191, 0xFFFF_0192, 0x0042_0192))
    return Drawn(f"1000h is {value:08X}h", with_personality(defaults={key(0x1000): value}))


def _stored_values(random: Random) -> Drawn:
    stored = {
        key(0x6007): random.choice((0, 1, 2, 3)),
        key(0x605A): random.choice((1, 2, 5, 6)),
        key(0x6060): random.choice((0, 3, 9)),
        key(0x60FF): random.choice((0, 777, -30000)),
        key(0x1017): random.choice((0, 50, 2000)),
        key(0x1029, 1): random.choice((0, 1, 2)),
    }
    return Drawn("has stored values of another master", with_personality(defaults=stored))


def _heartbeat_steps(random: Random) -> Drawn:
    step, code = random.choice((8, 16, 50, 64, 100)), random.choice((0, *RANGES))
    how = f"refused with {code:08X}h" if code else "rounded down"
    bounds = {key(0x1017): Bounds(0, 65500, step, code)}
    return Drawn(f"1017h in steps of {step} ms, others are {how}", with_manner(bounds=bounds))


def _slow_heartbeat(random: Random) -> Drawn:
    low, code = random.choice((200, 250, 300, 400, 500)), random.choice(RANGES)
    keys = {"timeouts.drive_heartbeat_s": 2.0 * low / 1000.0}
    bounds = {key(0x1017): Bounds(low, 65535, 1, code)}
    return Drawn(f"1017h from {low} ms on, else {code:08X}h", with_manner(bounds=bounds), keys)


def _guarding_alone(random: Random) -> Drawn:
    keys = {"self_stop.node_guarding": True, "self_stop.heartbeat_entries": 0}
    if random.random() < 0.5:
        change = with_personality(missing=frozenset((0x1016, 0x1017)), heartbeat_entries=0)
        return Drawn("has node guarding, and no 1016h nor 1017h", change, keys)
    code = random.choice(ABORT_CODES)
    change = with_manner(refused_reads={key(0x1017): code}, refused_writes={key(0x1017): code})
    return Drawn(f"has node guarding, and aborts all of 1017h with {code:08X}h", change, keys)


def _no_synchronous_pdos(random: Random) -> Drawn:
    code = random.choice(RANGES)
    if random.random() < 0.3:
        missing = with_personality(missing=frozenset((0x1005, 0x1019)))
        return Drawn("has no 1005h, and no synchronous PDOs", missing)
    bounds = dict.fromkeys(TYPES, Bounds(254, 255, 1, code))
    return Drawn(f"PDO types below 254 are refused with {code:08X}h", with_manner(bounds=bounds))


def _one_event_type(random: Random) -> Drawn:
    only, code = random.choice(EVENT_TYPES), random.choice(RANGES)
    refuses = {entry: Bounds(0, 254, 1, code) for entry in TYPES} if only == 254 else {}
    return Drawn(f"of the event-driven PDO types it takes {only} alone", with_manner(bounds=refuses))


def _synchronous_alone(random: Random) -> Drawn:
    refuses = {entry: Bounds(0, 240, 1, random.choice(RANGES)) for entry in TYPES}
    on = dict.fromkeys(TYPES, 1)
    change = both(with_personality(defaults=on), with_manner(bounds=refuses))
    return Drawn("takes no event-driven PDO", change, unusable=True)


def _keeps_no_rtr(_random: Random) -> Drawn:
    return Drawn("COB-IDs of PDOs must keep bit 30", with_personality(sets_no_rtr=True, needs_no_rtr=True))


def _other_unit(random: Random) -> Drawn:
    """As seen: 60A9h = rpm was readable, robot.yaml had 0.1rpm, and the base drove 10 times as fast as commanded."""
    unit = random.choice(sorted(VELOCITY_UNITS))
    change = with_personality(extras=VELOCITY_UNITS[unit], target_unit=unit, actual_unit=unit)
    index = 0x608C if unit == "rev/s" else 0x60A9
    return Drawn(f"one bit of its velocities is 1 {unit}, by {index:04X}h", change, {"velocity_unit": unit})


def _few_pdos(random: Random) -> Drawn:
    number = random.choice((2, 3))
    gone = [base + n for base in (0x1400, 0x1600, 0x1800, 0x1A00) for n in range(number, 4)]
    off = {key(base + n, 1): 1 << 31 for base in (0x1400, 0x1800) for n in range(number, 4)}
    change = with_personality(missing=frozenset(gone), defaults=off)
    return Drawn(f"has {number} RPDOs and {number} TPDOs", change, {"pdo.rpdos": number, "pdo.tpdos": number})


def _one_tpdo(random: Random) -> Drawn:
    """With 606Ch of 16 bits it has room for all that canbase needs."""
    narrow = random.random() < 0.75
    gone = frozenset(base + n for base in (0x1800, 0x1A00) for n in range(1, 4))
    off = {key(0x1800 + n, 1): 1 << 31 for n in range(1, 4)}
    change = with_personality(missing=gone, defaults=off, widths={0x606C: "h"} if narrow else {})
    text = f"has one TPDO, and 606Ch with {16 if narrow else 32} bits"
    return Drawn(text, change, {"layout.velocity_bits": 16, "pdo.tpdos": 1} if narrow else {}, unusable=not narrow)


def _fixed_cob_ids(_random: Random) -> Drawn:
    """Those of the predefined connection set."""
    change = with_manner(refused_writes={key(base, 1): 0x0601_0002 for base in (0x1402, 0x1802, 0x1803)})
    return Drawn("COB-IDs of unused PDOs are read-only", change)


def _narrow_target(_random: Random) -> Drawn:
    return Drawn("60FFh has 16 bits", with_personality(widths={0x60FF: "h"}), {"layout.target_bits": 16})


def _narrow_velocity(_random: Random) -> Drawn:
    return Drawn("606Ch has 16 bits", with_personality(widths={0x606C: "h"}), {"layout.velocity_bits": 16})


def _wide_status(_random: Random) -> Drawn:
    return Drawn("6041h has 32 bits", with_personality(widths={0x6041: "I"}), unusable=True)


def _cyclic_alone(random: Random) -> Drawn:
    hidden = random.random() < 0.5
    change = with_personality(modes=(9,), shows_mode_without_power=not hidden)
    return Drawn("takes 6060h = 9 alone", change, {"mode": 9})


def _mode_without_power(_random: Random) -> Drawn:
    return Drawn("6061h is 0 without power", with_personality(shows_mode_without_power=False))


def _write_only_mode(_random: Random) -> Drawn:
    return Drawn("6060h is write-only", with_manner(refused_reads={key(0x6060): 0x0601_0001}))


def _locked_with_power(_random: Random) -> Drawn:
    locked = frozenset((0x6007, 0x605A, 0x605E, 0x6083, 0x6084, 0x6085))
    return Drawn("option codes cannot be written with power", with_personality(locked_with_power=locked))


def _stays_in_quick_stop(_random: Random) -> Drawn:
    change = both(with_personality(defaults={key(0x605A): 6}), with_manner(refused_writes={key(0x605A): 0x0601_0002}))
    return Drawn("605Ah is read-only, and 6", change)


def _coasts(random: Random) -> Drawn:
    code = random.choice((0x0601_0002, GENERAL_ERROR, 0x0609_0030))
    change = both(with_personality(defaults={key(0x605A): 0}), with_manner(refused_writes={key(0x605A): code}))
    return Drawn(f"605Ah is 0, others are refused with {code:08X}h", change, tool=frozenset((0x605A,)))


def _soft_stop(random: Random) -> Drawn:
    """Below the quick stop of the sample robot (2 m/s²), or its ordinary deceleration too (1 m/s²)."""
    mps2 = round(random.uniform(0.5, 1.8), 2)
    raw, code = round(mps2 * RAMP_BITS_PER_MPS2), random.choice((0, 0x0609_0031))
    change = both(
        with_personality(defaults={key(0x6085): raw}), with_manner(bounds={key(0x6085): Bounds(1, raw, 1, code)})
    )
    keys = dict.fromkeys(("limits.emergency_deceleration_mps2", "limits.deceleration_mps2"), round(mps2 - 0.01, 2))
    return Drawn(f"6085h is at most {raw} ({mps2} m/s²), with {code:08X}h", change, keys, frozenset((0x6085,)))


def _rounded_ramps(random: Random) -> Drawn:
    step = random.choice((10, 100, 256))
    bounds = {key(index): Bounds(step, 2**32 - 1, step) for index in (0x6083, 0x6084, 0x6085)}
    return Drawn(f"ramps are rounded down to multiples of {step}", with_manner(bounds=bounds))


def _status_bits(random: Random) -> Drawn:
    bits = random.choice((0x0100, 0x4000, 0x8000, 0xC180, 0x0880))
    return Drawn(f"bits {bits:04X}h of 6041h come and go", with_manner(status_bits=bits))


def _noisy_velocity(random: Random) -> Drawn:
    """In 0.1 rpm at the motor: 20 mm/s at the rim of the sample robot are 382."""
    mps = round(random.uniform(0.002, 0.03), 4)
    return Drawn(f"606Ch is ±{1e3 * mps:.1f} mm/s beside the speed", with_manner(velocity_noise=round(19098.6 * mps)))


def _emergencies(random: Random) -> Drawn:
    every_s = round(random.uniform(0.1, 2.0), 2)
    return Drawn(f"an emergency message of the manufacturer's each {every_s} s", with_manner(emcy_every_s=every_s))


def _count_wraps(random: Random) -> Drawn:
    count = random.choice((2**31 - 500, -(2**31) + 500, -1))
    return Drawn(f"6064h begins at {count}", with_manner(start_count=count))


def _sets_bit_30(_random: Random) -> Drawn:
    off = {key(0x1400 + n, 1): NO_RTR | 0x200 + 0x100 * n for n in range(4)}
    return Drawn("bit 30 of RPDO COB-IDs is set", with_personality(sets_no_rtr=bool(off)))


def _sdo_channels(random: Random) -> Drawn:
    """Closed or open as delivered, some of them for good."""
    number, is_open, is_fixed = random.choice((1, 2)), random.random() < 0.7, random.random() < 0.3
    off = 0 if is_open else 1 << 31
    extras: dict[int, Extra] = {}
    for n in range(number):
        extras |= sdo_channel(0x1201 + n, off | 0x6A0 + n, off | 0x6C0 + n)
    codes = {place: random.choice((0x0601_0002, GENERAL_ERROR, 0x0609_0030)) for place in extras if place & 0xFF}
    change = both(with_personality(extras=extras), with_manner(refused_writes=codes if is_fixed else {}))
    text = f"has {number} more SDO channels, {'open' if is_open else 'closed'}{', read-only' if is_fixed else ''}"
    return Drawn(text, change, tool=frozenset((0x1201,)) if is_open and is_fixed else frozenset())


def _busy(_random: Random) -> Drawn:
    return Drawn("refuses the first write to each object with 08000022h", with_manner(refuses_first=True))


def _late_heartbeat(random: Random) -> Drawn:
    late_s = round(random.uniform(0.5, 4.0), 2)
    return Drawn(f"its first heartbeat comes {late_s} s after its boot-up", with_manner(heartbeat_late_s=late_s))


def _long_tpdo(_random: Random) -> Drawn:
    return Drawn("two bytes more than mapped in TPDO1", with_manner(tpdo_padding=2), tool=frozenset((0x1A00,)))


def _fixed_mapping(random: Random) -> Drawn:
    entry, code = key(0x1A00, random.choice((0, 1, 2))), random.choice((0x0601_0002, GENERAL_ERROR))
    change = with_manner(refused_writes={entry: code})
    return Drawn(f"writing {_hex(entry)} is refused with {code:08X}h", change, tool=frozenset((0x1A00,)))


def _counted_syncs(_random: Random) -> Drawn:
    change = both(with_personality(defaults={key(0x1019): 10}), with_manner(refused_writes={key(0x1019): 0x0601_0002}))
    return Drawn("1019h is read-only, and 10", change, tool=frozenset((0x1019,)))


def _late_mode(random: Random) -> Drawn:
    late_s = round(random.uniform(2.5, 4.0), 2)
    change = with_manner(mode_late_s=late_s)
    return Drawn(f"6061h follows 6060h after {late_s} s", change, {"options.mode_display": "yes"})


def _other_counts(random: Random) -> Drawn:
    factor = random.choice((0.05, 0.25, 0.5, 2.0))
    keys = {"counts_per_motor_rev": round(factor * COUNTS_PER_MOTOR_REV)}
    change = with_manner(counts_per_m=keys["counts_per_motor_rev"] / COUNTS_PER_MOTOR_REV * COUNTS_PER_M)
    return Drawn(f"6064h counts {factor} times as far as robot.yaml says", change, keys)


def _short_range(random: Random) -> Drawn:
    most = random.choice((4095, 65_535, 999_999))
    extras = {key(0x607B): Extra("B", 2), key(0x607B, 1): Extra("i", 0), key(0x607B, 2): Extra("i", most)}
    change = both(with_personality(extras=extras), with_manner(position_range=most))
    return Drawn(f"6064h wraps from {most} to 0, by 607Bh", change, tool=frozenset((0x607B,)))


def _reversed_velocity(_random: Random) -> Drawn:
    return Drawn("606Ch has the other sign", with_manner(velocity_sign=-1), tool=frozenset((0x607E,)))


def _narrow_counter(_random: Random) -> Drawn:
    return Drawn(
        "6064h counts in 16 bits, and 607Bh does not say so", with_manner(position_range=65_535), unusable=True
    )


def _held_velocity(random: Random) -> Drawn:
    held_s = round(random.uniform(0.02, 0.1), 3)
    return Drawn(f"606Ch is measured each {held_s} s", with_manner(velocity_held_s=held_s), stops=frozenset(("606Ch",)))


def _velocity_spikes(random: Random) -> Drawn:
    mps = round(random.uniform(-0.5, 0.5), 2)
    change = with_manner(velocity_spike=round(19098.6 * mps))
    return Drawn(
        f"606Ch is {mps} m/s beside the speed now and then", change, stops=frozenset(("changes of speed", "606Ch"))
    )


def _answers_again(random: Random) -> Drawn:
    share = round(random.uniform(0.05, 0.5), 2)
    stops = frozenset(("answered twice", "gateway that repeats"))
    return Drawn(f"{share:.0%} of its SDO answers come again later", with_manner(answers_again=share), stops=stops)


def _jittery_heartbeat(random: Random) -> Drawn:
    late_s = round(random.uniform(0.03, 0.09), 3)
    return Drawn(f"heartbeats up to {late_s} s late", with_manner(heartbeat_jitter_s=late_s))


def _heartbeat_bit(_random: Random) -> Drawn:
    return Drawn("bit 7 of its heartbeats is set", with_manner(heartbeat_bits=0x80))


def _emergency_flood(random: Random) -> Drawn:
    rate = random.randint(50, 150)
    return Drawn(f"{rate} emergency messages a second", with_manner(emcy_every_s=1.0 / rate))


def _late_nmt(random: Random) -> Drawn:
    late_s = round(10 ** random.uniform(-2.0, -0.3), 3)
    return Drawn(f"obeys NMT commands {late_s} s later", with_manner(nmt_late_s=late_s))


def _late_enable(random: Random) -> Drawn:
    late_s = round(random.uniform(0.2, 0.9), 2)
    return Drawn(f"needs {late_s} s for operation enabled", with_manner(enable_late_s=late_s))


def _motionless(random: Random) -> Drawn:
    still_s = round(random.uniform(0.2, 1.5), 2)
    change = with_manner(motionless_s=still_s)
    return Drawn(f"does not turn for {still_s} s after it was enabled", change, stops=frozenset(("brake",)))


def _late_remote(random: Random) -> Drawn:
    late_s = round(random.uniform(1.0, 5.0), 1)
    return Drawn(f"bit 9 is set {late_s} s after power on", with_manner(remote_late_s=late_s))


def _taken_local(random: Random) -> Drawn:
    after_s = round(random.uniform(0.3, 1.5), 2)
    change = with_manner(local_after_s=after_s)
    return Drawn(f"is in local mode {after_s} s after it began to move", change, stops=frozenset(("bit 9",)))


def _passing_fault(random: Random) -> Drawn:
    after_s = round(random.uniform(0.3, 1.5), 2)
    change = with_manner(fails_after_s=after_s)
    return Drawn(f"over-voltage for 0.3 s, {after_s} s after it began to move", change, stops=frozenset(("3210h",)))


ALIKE = (
    frozenset(("few_pdos", "fixed_cob_ids", "one_tpdo")),
    frozenset(("narrow_velocity", "one_tpdo")),
    frozenset(("no_synchronous_pdos", "one_event_type", "synchronous_alone")),
    frozenset(("heartbeat_steps", "slow_heartbeat", "guarding_alone")),
    frozenset(("guarding_alone", "stored_values")),
    frozenset(("guarding_alone", "missing", "watches")),
    frozenset(("coasts", "stays_in_quick_stop")),
    frozenset(("soft_stop", "rounded_ramps")),
    frozenset(("other_unit", "soft_stop", "rounded_ramps", "refused", "missing")),  # ramps in the unit of 60FFh
    frozenset(("counted_syncs", "refused", "missing", "no_synchronous_pdos")),
    frozenset(("late_mode", "mode_without_power", "cyclic_alone", "refused", "missing")),
    frozenset(
        (
            "other_counts",
            "short_range",
            "reversed_velocity",
            "noisy_velocity",
            "count_wraps",
            "narrow_counter",
            "other_unit",
        )
    ),
    frozenset(("late_heartbeat", "jittery_heartbeat", "heartbeat_bit", "guarding_alone")),
    frozenset(("emergencies", "emergency_flood")),
    frozenset(("taken_local", "passing_fault", "motionless", "late_mode")),
    frozenset(("long_tpdo", "fixed_mapping", "one_tpdo", "narrow_velocity", "wide_status")),
    frozenset(("other_unit", "noisy_velocity", "narrow_target", "narrow_velocity", "one_tpdo", "stored_values")),
)
"""A drive has one of each of these sets at most."""
ODDITIES: Mapping[str, Oddity] = {
    "refused": Oddity("CiA 301, SDO abort codes", "an optional object is refused with any abort code", _refused),
    "missing": Oddity("CiA 301, CiA 402-2: category optional", "an optional object does not exist", _missing),
    "watches": Oddity("CiA 301, 1016h:0: 1 to 127", "another number of watched heartbeats", _watches),
    "slow_answers": Oddity("CiA 301, SDO: no time limit of the server", "SDO answers take long", _slow_answers),
    "jittery_answers": Oddity("CiA 301, SDO", "SDO answers take their time now and then", _jittery_answers),
    "lost_answers": Oddity("CiA 301, SDO: the client's timeout", "requests are lost in a full buffer", _lost_answers),
    "sizeless": Oddity("CiA 301, SDO upload, s = 0", "the size of an object is not indicated", _sizeless),
    "sdo_channels": Oddity("CiA 301, 1201h to 127Fh", "it takes SDO requests by other identifiers too", _sdo_channels),
    "segmented": Oddity("CiA 301, SDO upload, e = 0", "short objects come in segments", _segmented),
    "doubled": Oddity("ISO 11898-1, error in the last bit of EOF", "a frame is received twice", _doubled),
    "late_pdos": Oddity("CiA 301, 1007h", "TPDOs come at the end of the synchronous window", _late_pdos),
    "late_boot": Oddity("CiA 301, NMT: no time limit", "its start takes long", _late_boot),
    "second_boot_up": Oddity("CiA 301, NMT: one for each initialisation", "two boot-ups of a start", _second_boot_up),
    "slow_reset": Oddity("CiA 301, NMT: no time limit", "an NMT reset takes long", _slow_reset),
    "no_boot_up": Oddity("DS-301 3.0: none is required", "no boot-up message", _no_boot_up),
    "starts_operational": Oddity("CiA 302-2, 1F80h bit 2", "it starts itself", _starts_operational),
    "other_profile": Oddity("CiA 301, 1000h", "its device type is no motor drive's", _other_profile),
    "stored_values": Oddity("CiA 301, 1010h", "stored values of another life", _stored_values),
    "heartbeat_steps": Oddity("CiA 301, 1017h: a multiple of 1 ms", "heartbeat periods in steps", _heartbeat_steps),
    "slow_heartbeat": Oddity("CiA 301, value range", "no short heartbeat periods", _slow_heartbeat),
    "guarding_alone": Oddity("CiA 301: heartbeat or node guarding", "no heartbeat", _guarding_alone),
    "no_synchronous_pdos": Oddity("CiA 301, 1400h:2, 1800h:2", "event-driven PDOs alone", _no_synchronous_pdos),
    "one_event_type": Oddity("CiA 301, types 254 and 255", "one of the event-driven types", _one_event_type),
    "synchronous_alone": Oddity("CiA 301, 1400h:2, 1800h:2", "synchronous PDOs alone", _synchronous_alone),
    "keeps_no_rtr": Oddity("CiA 301, 1400h:1 bit 30", "a reserved bit must stay as it is", _keeps_no_rtr),
    "sets_bit_30": Oddity("CiA 301, 1400h:1 bit 30: do not care", "a reserved bit is set", _sets_bit_30),
    "few_pdos": Oddity("CiA 301: up to 512 PDOs", "two or three PDOs in each direction", _few_pdos),
    "one_tpdo": Oddity("CiA 301: up to 512 PDOs", "one TPDO", _one_tpdo),
    "fixed_cob_ids": Oddity("CiA 301, 1400h:1: rw or const", "COB-IDs that cannot be written", _fixed_cob_ids),
    "narrow_target": Oddity("seen: drives with 16-bit velocities", "60FFh of 16 bits", _narrow_target),
    "narrow_velocity": Oddity("seen: Sevcon Gen4", "606Ch of 16 bits", _narrow_velocity),
    "wide_status": Oddity("seen: ZLAC8015D", "6041h of 32 bits", _wide_status),
    "cyclic_alone": Oddity("CiA 402-2, 6502h", "cyclic synchronous velocity alone", _cyclic_alone),
    "mode_without_power": Oddity("CiA 402-2, 6061h", "no mode is shown without power", _mode_without_power),
    "write_only_mode": Oddity("CiA 402 2.0, 6060h: wo", "the mode cannot be read", _write_only_mode),
    "locked_with_power": Oddity("CiA 301, 0800 0022h", "options are locked with power", _locked_with_power),
    "stays_in_quick_stop": Oddity("CiA 402-2, 605Ah: 5 to 8", "quick stop active stays", _stays_in_quick_stop),
    "coasts": Oddity("CiA 402-2, 605Ah: 0", "a quick stop coasts", _coasts),
    "soft_stop": Oddity("CiA 402-2, 6085h", "its quick stop is softer than wanted", _soft_stop),
    "rounded_ramps": Oddity("CiA 402-2, 6083h", "ramps have a resolution of their own", _rounded_ramps),
    "status_bits": Oddity("CiA 402-2, 6041h bits 7, 8, 11, 14, 15", "manufacturer's bits come and go", _status_bits),
    "noisy_velocity": Oddity("CiA 402-2, 606Ch: no accuracy", "the measured speed has noise", _noisy_velocity),
    "emergencies": Oddity("CiA 301, EMCY: FFxxh", "the manufacturer's emergency messages", _emergencies),
    "other_unit": Oddity("CiA 402-2, 60A9h; 608Bh, 608Ch of 2.0", "its velocities have another unit", _other_unit),
    "busy": Oddity("CiA 301, 0800 0022h", "its state forbids each write once", _busy),
    "late_heartbeat": Oddity("CiA 301, 1017h: no time limit", "heartbeats begin late", _late_heartbeat),
    "long_tpdo": Oddity("seen: a fixed length of 8 bytes", "a TPDO longer than its mapping", _long_tpdo),
    "fixed_mapping": Oddity("CiA 301, 1A00h: rw or const", "a mapping that cannot be written", _fixed_mapping),
    "counted_syncs": Oddity("CiA 301, 1019h", "it takes SYNCs with a counter alone", _counted_syncs),
    "late_mode": Oddity("CiA 402-2, 6061h: no time limit", "its mode changes late", _late_mode),
    "other_counts": Oddity("CiA 402-2, 608Fh to 6093h", "its position has another unit", _other_counts),
    "short_range": Oddity("CiA 402-2, 607Bh", "the position has a short range", _short_range),
    "reversed_velocity": Oddity("seen: swapped tracks", "606Ch has the other sign", _reversed_velocity),
    "count_wraps": Oddity("CiA 402-2, 6064h: INTEGER32", "the counter of the encoder wraps", _count_wraps),
    "narrow_counter": Oddity("seen: 16-bit encoders", "6064h wraps at 16 bits", _narrow_counter),
    "held_velocity": Oddity("CiA 402-2, 606Ch: no rate", "the measured speed is seldom new", _held_velocity),
    "velocity_spikes": Oddity("CiA 402-2, 606Ch: no accuracy", "the measured speed has spikes", _velocity_spikes),
    "answers_again": Oddity("seen: gateways", "SDO answers come again, after the next request", _answers_again),
    "jittery_heartbeat": Oddity("CiA 301, 1017h: no jitter", "heartbeats come late", _jittery_heartbeat),
    "heartbeat_bit": Oddity("seen: bit 7 of node guarding", "a reserved bit of its heartbeat is set", _heartbeat_bit),
    "emergency_flood": Oddity("CiA 301, 1015h: 0", "many emergency messages", _emergency_flood),
    "late_nmt": Oddity("CiA 301, NMT: no time limit", "NMT commands are obeyed late", _late_nmt),
    "late_enable": Oddity("CiA 402-2, transition 4: no time limit", "it is enabled slowly", _late_enable),
    "motionless": Oddity("CiA 402-2, 60FFh", "it turns late after it was enabled", _motionless),
    "late_remote": Oddity("CiA 402-2, 6041h bit 9", "it is in local mode at first", _late_remote),
    "taken_local": Oddity("CiA 402-2, 6041h bit 9", "somebody takes it into local mode", _taken_local),
    "passing_fault": Oddity("CiA 402-2, transition 15", "a fault that clears itself", _passing_fault),
}
"""By name."""
