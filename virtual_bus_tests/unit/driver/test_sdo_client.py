"""The SDO client as byte scripts: what it sends for what it gets, with the time on each line that matters."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from canbase_driver.cia301.frame import Frame
from canbase_driver.cia301.sdo_client import (
    MAX_UPLOAD_BYTES,
    Read,
    SdoAborted,
    SdoClient,
    SdoTimeout,
    Write,
    abort_text,
)

Script = list[tuple[str, str]]


def client(attempts: int = 1) -> SdoClient:
    return SdoClient(node_id=5, timeout_s=0.3, attempts=attempts)


def rx(data: str) -> Frame:
    """An answer of node 5."""
    return Frame(0x585, bytes.fromhex(data))


def tx(data: str) -> Frame:
    """A request to node 5."""
    return Frame(0x605, bytes.fromhex(data))


def play(sdo: SdoClient, step: Read | Write, script: Script) -> None:
    """Each line: what the client must have sent, and what the drive answers."""
    sent = [sdo.start(step, now_s=0.0)]
    for request, answer in script:
        assert sent == [tx(request)]
        sent = sdo.on_frame(rx(answer), now_s=0.0)
    assert sent == []
    assert not sdo.busy


@pytest.mark.parametrize(
    ("answer", "value"),
    [
        ("4B 41 60 00 37 06 00 00", "37 06"),  # two bytes, size shown
        ("4F 41 60 00 37 00 00 00", "37"),
        ("47 41 60 00 37 06 01 00", "37 06 01"),
        ("43 41 60 00 37 06 01 02", "37 06 01 02"),
        ("42 41 60 00 37 06 01 02", "37 06 01 02"),  # no size shown: all four
    ],
)
def test_expedited_upload(answer: str, value: str) -> None:
    sdo = client()
    play(sdo, Read(0x6041), [("40 41 60 00 00 00 00 00", answer)])
    assert sdo.answer() == bytes.fromhex(value)


@pytest.mark.parametrize("begin", ["41 08 10 00 0A 00 00 00", "40 08 10 00 00 00 00 00"])  # with and without a size
def test_segmented_upload(begin: str) -> None:
    sdo = client()
    script = [
        ("40 08 10 00 00 00 00 00", begin),
        ("60 00 00 00 00 00 00 00", "00 57 68 65 65 6C 20 64"),  # toggle 0, 7 bytes
        ("70 00 00 00 00 00 00 00", "19 72 76 65 00 00 00 00"),  # toggle 1, 4 bytes unused, last
    ]
    play(sdo, Read(0x1008), script)
    assert sdo.answer() == b"Wheel drve"


def test_expedited_download() -> None:
    sdo = client()
    play(sdo, Write(0x6060, 0, 3, 1), [("2F 60 60 00 03 00 00 00", "60 60 60 00 00 00 00 00")])
    assert sdo.answer() == b""


@pytest.mark.parametrize(
    ("step", "request_data"),
    [
        (Write(0x6040, 0, 0x0F, 2), "2B 40 60 00 0F 00 00 00"),
        (Write(0x60FF, 0, -2, 4), "23 FF 60 00 FE FF FF FF"),
        (Write(0x1400, 1, 0x80000201, 4), "23 00 14 01 01 02 00 80"),
        (Write(0x1010, 1, b"sav"), "27 10 10 01 73 61 76 00"),
    ],
)
def test_numbers_and_bytes_on_the_wire(step: Write, request_data: str) -> None:
    assert client().start(step, now_s=0.0) == tx(request_data)


def test_segmented_download() -> None:
    sdo = client()
    script = [
        ("21 00 20 01 0F 00 00 00", "60 00 20 01 00 00 00 00"),  # 15 bytes are to come
        ("00 30 31 32 33 34 35 36", "20 00 00 00 00 00 00 00"),
        ("10 37 38 39 61 62 63 64", "30 00 00 00 00 00 00 00"),
        ("0D 65 00 00 00 00 00 00", "20 00 00 00 00 00 00 00"),  # toggle 0, 6 bytes unused, last
    ]
    play(sdo, Write(0x2000, 1, b"0123456789abcde"), script)
    assert sdo.answer() == b""


def test_a_segment_of_seven_bytes_can_be_the_last() -> None:
    sdo = client()
    script = [
        ("21 00 20 00 07 00 00 00", "60 00 20 00 00 00 00 00"),
        ("01 30 31 32 33 34 35 36", "20 00 00 00 00 00 00 00"),
    ]
    play(sdo, Write(0x2000, 0, b"0123456"), script)


def test_a_refusal_names_object_and_reason() -> None:
    sdo = client(attempts=3)
    play(sdo, Write(0x6007, 0, 3, 2), [("2B 07 60 00 03 00 00 00", "80 07 60 00 00 00 02 06")])
    with pytest.raises(SdoAborted, match="node 5, 6007h:0: 0602 0000h the object does not exist") as caught:
        sdo.answer()
    error = caught.value
    assert (error.node_id, error.index, error.sub, error.code) == (5, 0x6007, 0, 0x0602_0000)


def test_an_abort_code_that_nobody_knows() -> None:
    assert abort_text(0x0123_4567) == "0123 4567h unknown abort code"


def test_silence_is_aborted_tried_again_and_given_up() -> None:
    request, abort = tx("40 00 10 00 00 00 00 00"), tx("80 00 10 00 00 00 04 05")
    sdo = client(attempts=2)
    assert sdo.start(Read(0x1000), now_s=1.0) == request
    assert sdo.tick(now_s=1.299) == []
    assert sdo.tick(now_s=1.3) == [abort, request]  # the abort names the object
    assert sdo.tick(now_s=1.599) == []
    assert sdo.tick(now_s=1.6) == [abort]
    assert not sdo.busy
    with pytest.raises(SdoTimeout, match=r"node 5, 1000h:0: no answer to 2 requests, 0\.3 s each"):
        sdo.answer()


def test_a_second_attempt_can_succeed() -> None:
    sdo = client(attempts=2)
    sdo.start(Read(0x6041), now_s=0.0)
    sdo.tick(now_s=0.3)
    sdo.on_frame(rx("4B 41 60 00 37 06 00 00"), now_s=0.31)
    assert sdo.answer() == bytes.fromhex("37 06")


def test_each_segment_has_the_whole_time() -> None:
    sdo = client()
    sdo.start(Read(0x1008), now_s=0.0)
    sdo.on_frame(rx("40 08 10 00 00 00 00 00"), now_s=0.2)
    assert sdo.tick(now_s=0.499) == []
    assert sdo.tick(now_s=0.5) == [tx("80 08 10 00 00 00 04 05")]


def test_a_wrong_toggle_ends_the_attempt() -> None:
    sdo = client(attempts=2)
    sdo.start(Read(0x1008), now_s=0.0)
    sdo.on_frame(rx("40 08 10 00 00 00 00 00"), now_s=0.0)
    again = sdo.on_frame(rx("10 57 68 65 65 6C 20 64"), now_s=0.0)
    assert again == [tx("80 08 10 00 00 00 03 05"), tx("40 08 10 00 00 00 00 00")]
    sdo.on_frame(rx("40 08 10 00 00 00 00 00"), now_s=0.0)
    sdo.on_frame(rx("10 57 68 65 65 6C 20 64"), now_s=0.0)
    with pytest.raises(SdoAborted, match="toggle bit not alternated"):
        sdo.answer()


def test_more_or_less_than_announced_is_no_answer() -> None:
    sdo = client()
    sdo.start(Read(0x1008), now_s=0.0)
    sdo.on_frame(rx("41 08 10 00 08 00 00 00"), now_s=0.0)
    assert sdo.on_frame(rx("01 57 68 65 65 6C 20 64"), now_s=0.0) == [tx("80 08 10 00 10 00 07 06")]
    with pytest.raises(SdoAborted, match="length does not match"):
        sdo.answer()


def test_a_drive_that_never_ends_is_not_followed() -> None:
    sdo = client()
    sdo.start(Read(0x1008), now_s=0.0)
    sdo.on_frame(rx("40 08 10 00 00 00 00 00"), now_s=0.0)
    segments = 0
    while sdo.busy:
        segments += 1
        sdo.on_frame(rx(f"{'00' if segments % 2 else '10'} 57 68 65 65 6C 20 64"), now_s=0.0)
    assert segments == MAX_UPLOAD_BYTES // 7 + 1
    with pytest.raises(SdoAborted, match="out of memory"):
        sdo.answer()


@pytest.mark.parametrize(
    "stray",
    [
        "4B 64 60 00 37 06 00 00",  # another object: a late answer, or another client's
        "4B 41 60 01 37 06 00 00",  # another sub-index
        "60 41 60 00 00 00 00 00",  # the answer to a write
        "80 64 60 00 00 00 02 06",  # the abort of another object
        "00 57 68 65 65 6C 20 64",  # a segment that nobody asked for
        "4B 41 60 00 37 06 00",  # seven bytes
        "",
    ],
)
def test_strays_are_dropped_and_counted_and_the_transfer_goes_on(stray: str) -> None:
    sdo = client()
    sdo.start(Read(0x6041), now_s=0.0)
    assert sdo.on_frame(rx(stray), now_s=0.0) == []
    assert sdo.dropped == 1
    sdo.on_frame(rx("4B 41 60 00 37 06 00 00"), now_s=0.0)
    assert sdo.answer() == bytes.fromhex("37 06")


def test_a_stray_between_segments_is_dropped_too() -> None:
    sdo = client()
    sdo.start(Read(0x1008), now_s=0.0)
    sdo.on_frame(rx("40 08 10 00 00 00 00 00"), now_s=0.0)
    assert sdo.on_frame(rx("4B 41 60 00 37 06 00 00"), now_s=0.0) == []
    assert (sdo.dropped, sdo.busy) == (1, True)


def test_an_answer_without_a_question_is_dropped_and_other_nodes_are_not_even_counted() -> None:
    sdo = client()
    assert sdo.on_frame(rx("4B 41 60 00 37 06 00 00"), now_s=0.0) == []
    assert sdo.on_frame(Frame(0x586, bytes(8)), now_s=0.0) == []
    assert (
        sdo.on_frame(tx("40 41 60 00 00 00 00 00"), now_s=0.0) == []
    )  # its own request, as a multicast bus returns it
    assert sdo.dropped == 1


def test_one_transfer_at_a_time() -> None:
    sdo = client()
    sdo.start(Read(0x6041), now_s=0.0)
    with pytest.raises(RuntimeError, match="6041h:0 is under way"):
        sdo.start(Read(0x1000), now_s=0.0)
    sdo.on_frame(rx("4B 41 60 00 37 06 00 00"), now_s=0.0)
    assert sdo.answer() == bytes.fromhex("37 06")  # the refused step changed nothing


def test_no_answer_before_a_transfer_has_ended() -> None:
    sdo = client()
    with pytest.raises(RuntimeError, match="no transfer has ended"):
        sdo.answer()


@pytest.mark.parametrize(("value", "size"), [(256, 1), (-129, 1), (2**32, 4), (-(2**31) - 1, 4), (1, 0), (b"", 0)])
def test_what_cannot_be_written_raises_at_once(value: int | bytes, size: int) -> None:
    with pytest.raises(ValueError, match="6060h:0"):
        Write(0x6060, 0, value, size)


@pytest.mark.parametrize(("value", "data"), [(255, "FF"), (-128, "80"), (-1, "FF"), (0, "00")])
def test_the_limits_of_a_byte_can_be_written(value: int, data: str) -> None:
    assert Write(0x6060, 0, value, 1).data == bytes.fromhex(data)


@pytest.mark.parametrize(("node_id", "timeout_s", "attempts"), [(0, 0.3, 1), (128, 0.3, 1), (5, 0.0, 1), (5, 0.3, 0)])
def test_a_client_that_could_never_work_raises(node_id: int, timeout_s: float, attempts: int) -> None:
    with pytest.raises(ValueError, match=r"expected 1…127"):
        SdoClient(node_id, timeout_s, attempts)


steps = st.one_of(
    st.just(Read(0x1008)),
    st.binary(min_size=1, max_size=40).map(lambda data: Write(0x2000, 0, data)),
)
answers = st.one_of(
    st.binary(max_size=8),
    st.tuples(st.integers(0, 255), st.sampled_from(["081000", "002000"]), st.binary(min_size=4, max_size=4)).map(
        lambda parts: bytes((parts[0],)) + bytes.fromhex(parts[1]) + parts[2]
    ),
)


@given(steps, st.lists(answers, max_size=30))
def test_no_answer_of_a_drive_raises(step: Read | Write, drive: list[bytes]) -> None:
    sdo = client(attempts=2)
    sdo.start(step, now_s=0.0)
    for data in drive:
        sdo.on_frame(Frame(0x585, data), now_s=0.0)
    sdo.tick(now_s=1.0)
    sdo.tick(now_s=2.0)
    assert not sdo.busy


# -- drives that answer late: CiA 301 gives a server no time limit


def exchange(sdo: SdoClient, delay_s: float, until_s: float, lost: tuple[int, ...] = ()) -> list[float]:
    """Reads 1018h:1 to 1018h:4 in turn; the drive answers each request after `delay_s`, but not those `lost`.

    The times at which a transfer ended.
    """
    due: list[tuple[float, bytes]] = []
    ended: list[float] = []
    requests = 0
    for now_s in (round(step * 0.01, 2) for step in range(round(until_s / 0.01))):
        sent = sdo.tick(now_s) if sdo.busy else [sdo.start(Read(0x1018, 1 + len(ended) % 4), now_s)]
        for frame in sent:
            if frame.data[0] == 0x40:
                due += [] if requests in lost else [(now_s + delay_s, frame.data[1:4])]
                requests += 1
        while due and due[0][0] <= now_s:
            sdo.on_frame(Frame(0x585, b"\x43" + due.pop(0)[1] + bytes(4)), now_s)
        ended += [] if sdo.busy else [now_s]
    return ended


@pytest.mark.parametrize("delay_s", [0.35, 0.6, 1.0, 2.0])
def test_a_client_learns_how_late_a_drive_answers_and_waits_for_it(delay_s: float) -> None:
    """t   0  request ── 0.3  again ── delay  an answer to each of them: the last one shows how late it is"""
    sdo = client(attempts=3)
    ended = exchange(sdo, delay_s, 30.0)
    assert 0.5 * delay_s < sdo.late_s <= delay_s + 0.011, "looked at every 10 ms"
    assert sdo.duplicates == 0, "no second drive with its node id"
    assert ended[-1] - ended[-2] == pytest.approx(delay_s, abs=0.03), "one request for each transfer"


@pytest.mark.parametrize("delay_s", [0.0, 0.25])
def test_a_request_that_was_lost_makes_no_drive_a_late_one(delay_s: float) -> None:
    sdo = client(attempts=3)
    exchange(sdo, delay_s, 10.0, lost=(0, 3, 4, 7))
    assert sdo.late_s == 0.0


def test_an_answer_that_comes_after_the_last_attempt_is_a_late_one_too() -> None:
    sdo = client(attempts=1)
    sdo.start(Read(0x1018, 1), 0.0)
    sdo.tick(0.3)
    assert not sdo.busy
    sdo.on_frame(rx("43 18 10 01 11 11 00 00"), 0.8)
    assert sdo.late_s == 0.8
    assert sdo.dropped == 1


def test_what_the_watchdog_requests_too_teaches_nothing_about_lateness() -> None:
    sdo = client(attempts=1)
    sdo.start(Read(0x6041), 0.0)
    sdo.tick(0.3)
    sdo.on_frame(rx("4B 41 60 00 37 06 00 00"), 0.8)
    assert sdo.late_s == 0.0


def test_the_answers_to_two_requests_of_which_one_was_given_up_name_no_second_drive() -> None:
    """t   0  request ── 0.3  given up ── 0.4  request ── 0.5, 0.6  an answer to each ── 0.7  one more"""
    sdo = client(attempts=1)
    sdo.start(Read(0x1018, 1), 0.0)
    sdo.tick(0.3)
    sdo.start(Read(0x1018, 1), 0.4)
    for now_s in (0.5, 0.6):
        sdo.on_frame(rx("43 18 10 01 11 11 00 00"), now_s)
    assert sdo.duplicates == 0
    sdo.on_frame(rx("43 18 10 01 11 11 00 00"), 0.7)
    assert sdo.duplicates == 1, "one answer more than requests"


# -- whose confirmation it is


MONITORED = Write(0x1016, 1, 0x007E_012C, 4)
CONFIRMED = "60 16 10 01 00 00 00 00"
AT = bytes.fromhex("16 10 01")


def repeated() -> SdoClient:
    """t   0  write ── 0.3  no answer: requested again ── 0.4  an answer"""
    sdo = client(attempts=3)
    sdo.start(MONITORED, 0.0)
    sdo.tick(0.3)
    sdo.on_frame(rx(CONFIRMED), 0.4)
    assert not sdo.busy
    return sdo


def test_a_second_answer_to_a_write_that_was_repeated_may_come_until_the_next_transfer_is_answered() -> None:
    """t   0.4  an answer to one of two requests ── 0.5  the next transfer ── 0.6  its answer: they come in order"""
    sdo = repeated()
    assert sdo.may_confirm(AT)
    sdo.start(Read(0x1018, 1), 0.5)
    assert sdo.may_confirm(AT)
    sdo.on_frame(rx("43 18 10 01 11 11 00 00"), 0.6)
    assert (sdo.may_confirm(AT), sdo.has_requested(AT)) == (False, True)


def test_a_refusal_is_an_answer_that_settles_what_was_written_before_and_no_answer_settles_nothing() -> None:
    sdo = repeated()
    sdo.start(Read(0x1018, 1), 0.5)
    for now_s in (3.0, 6.0, 9.0):
        sdo.tick(now_s)
    assert not sdo.busy
    assert sdo.may_confirm(AT), "it was given up"
    sdo.start(Read(0x1018, 2), 11.0)
    sdo.on_frame(rx("80 18 10 02 00 00 02 06"), 11.1)
    assert not sdo.may_confirm(AT)


def test_the_value_that_is_read_back_settles_the_write_before_it() -> None:
    sdo = repeated()
    sdo.start(Read(0x1016, 1), 0.5)
    sdo.on_frame(rx("43 16 10 01 2C 01 7E 00"), 0.6)
    assert not sdo.may_confirm(AT)


def test_a_write_once_more_may_be_confirmed_itself() -> None:
    sdo = repeated()
    sdo.start(MONITORED, 0.5)
    sdo.on_frame(rx(CONFIRMED), 0.6)
    assert sdo.may_confirm(AT)


def test_an_answer_about_an_object_of_the_watchdog_settles_nothing_it_may_have_been_requested_before() -> None:
    sdo = repeated()
    sdo.start(Read(0x6041), 0.5)
    sdo.on_frame(rx("4B 41 60 00 37 06 00 00"), 0.6)
    assert sdo.may_confirm(AT)
