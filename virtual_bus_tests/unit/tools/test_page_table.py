"""Tables that several runs write: what one did not measure stays as it was."""

from __future__ import annotations

from exit_matrix.page_table import PageTable

TABLE = PageTable(("what", "how"), ("who", "real", "p50"), ("who",))
HEAD = ["| what | how | who | real | p50 |", "|---|---|---|---:|---:|"]


def rows(section: str) -> list[str]:
    assert section.splitlines()[:2] == HEAD
    return section.splitlines()[2:]


def test_the_columns_of_one_command_leave_those_of_the_other_alone() -> None:
    real = TABLE.merged("", {("driver", "SIGKILL"): {"who": "watchdog", "real": "0.46 s"}})
    both = TABLE.merged(real, {("driver", "SIGKILL"): {"p50": "0.44 s"}})

    assert rows(real) == ["| driver | SIGKILL | watchdog | 0.46 s | – |"]
    assert rows(both) == ["| driver | SIGKILL | watchdog | 0.46 s | 0.44 s |"]
    assert rows(TABLE.merged(both, {("driver", "SIGKILL"): {"who": "drives", "real": "0.50 s"}})) == [
        "| driver | SIGKILL | drives | 0.50 s | 0.44 s |"
    ]


def test_rows_stay_where_they_are_and_new_ones_come_last() -> None:
    before = TABLE.merged("", {("a", "1"): {}, ("b", "1"): {}})

    after = TABLE.merged(before, {("c", "1"): {}, ("b", "1"): {"p50": "1 s"}})

    assert [row[:5] for row in rows(after)] == ["| a |", "| b |", "| c |"]


def test_rows_with_a_given_order_come_first() -> None:
    before = TABLE.merged("", {("lie", "1"): {"p50": "1 s"}, ("b", "1"): {"p50": "2 s"}})

    after = TABLE.merged(before, {("a", "1"): {"real": "3 s"}}, [("a", "1"), ("b", "1"), ("none", "1")])

    assert rows(after) == ["| a | 1 | – | 3 s | – |", "| b | 1 | – | – | 2 s |", "| lie | 1 | – | – | 1 s |"]


def test_a_column_that_is_gone_goes_and_text_around_the_table_is_not_read() -> None:
    before = "Some text.\n\n| what | how | old | real |\n|---|---|---|---:|\n| a | 1 | x | 5 s |\n"

    assert rows(TABLE.merged(before, {})) == ["| a | 1 | – | 5 s | – |"]
