"""The definitions of ROS types in a recording, as the parser of Foxglove's library reads them."""

from __future__ import annotations

import pytest
from mcap_ros2._vendor.rosidl_adapter.parser import parse_message_string

from canbase_recording.ros_definition import SEPARATOR, definition, of_fields

FILES = {
    (
        "shop",
        "msg",
        "Order",
    ): "uint8 LATE=1  # shop/msg/No is in a comment\nHeader[] headers\nItem[<=3] items\nstring<=9 who\n",
    ("shop", "msg", "Item"): "other_pkg/Price price\nfloat64[2] size\nItem2 twin\n",
    ("shop", "msg", "Item2"): "other_pkg/Price price\n",
    ("shop", "msg", "Header"): "uint32 number\n",
    ("other_pkg", "msg", "Price"): "float32 euro\n",
    ("shop", "action", "Buy_FeedbackMessage"): "other_pkg/Price price\nshop/Buy_Feedback feedback\n",
    ("shop", "action", "Buy_Feedback"): "float32 done\n",
}


def read(package: str, space: str, kind: str) -> str:
    return FILES[package, space, kind]


def test_each_contained_type_comes_once_below_its_own_name() -> None:
    first, *others = definition("shop/msg/Order", read).split(f"\n{SEPARATOR}\n")
    assert first == FILES["shop", "msg", "Order"]
    assert [part.split("\n")[0] for part in others] == [
        "MSG: shop/Header",
        "MSG: shop/Item",
        "MSG: other_pkg/Price",
        "MSG: shop/Item2",
    ]


def test_the_feedback_of_an_action_is_found_beside_its_message() -> None:
    text = definition("shop/action/Buy_FeedbackMessage", read)
    assert [line for line in text.splitlines() if line.startswith("MSG: ")] == [
        "MSG: other_pkg/Price",
        "MSG: shop/Buy_Feedback",
    ]


def test_what_the_reader_raises_comes_through() -> None:
    with pytest.raises(KeyError):
        definition("shop/msg/Unknown", read)


def test_fields_of_a_python_class_become_lines_that_ros_reads() -> None:
    fields = {
        "flag": "boolean", "raw": "octet", "share": "float", "length_m": "double", "name": "string<20>",
        "stamps": "sequence<builtin_interfaces/Time>", "few": "sequence<double, 10>", "matrix": "double[36]",
        "words": "sequence<string<5>, 2>", "count": "uint32",
    }  # fmt: skip
    parsed = parse_message_string("shop", "Made", of_fields(fields))
    assert [(str(field.type), field.name) for field in parsed.fields] == [
        ("bool", "flag"), ("byte", "raw"), ("float32", "share"), ("float64", "length_m"), ("string<=20", "name"),
        ("builtin_interfaces/Time[]", "stamps"), ("float64[<=10]", "few"), ("float64[36]", "matrix"),
        ("string<=5[<=2]", "words"), ("uint32", "count"),
    ]  # fmt: skip
