"""The form in which dataclasses are compiled behaves as the one in which they are written."""

from __future__ import annotations

import math
import pickle
import sys
from dataclasses import fields, replace
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from campaign import removed_safeguards
from compiled.modules import BUILD, ROOT, SOURCES, hot_modules
from compiled.native_form import native_form

SOURCE = '''
from __future__ import annotations
import math
from dataclasses import dataclass, field
from typing import ClassVar

LOW, HIGH = 1.0, 2.0
(ONE, *OTHERS), LAST = (1, 2, 3), 4

@dataclass(frozen=True, slots=True, kw_only=True)
class Report:
    NONE: ClassVar[Report]

    note: str = ""
    age_s: float

Report.NONE = Report(age_s=math.inf)

@dataclass(frozen=True, slots=True)
class Wheel:
    """With a docstring."""
    speed_mps: float
    name: str = "left"
    notes: tuple[float, ...] = ()

@dataclass(frozen=True, slots=True, eq=False)
class Alone:
    number: int = 3

@dataclass(slots=True)
class Box:
    wheel: Wheel
    kept: list[int] = field(default_factory=list)
    cost_s: float = field(default=0.0, compare=False)
    _twice: int = field(default=0, init=False)

    def __post_init__(self) -> None:
        self._twice = 2 * len(self.kept)
'''


def module(name: str, source: str) -> Any:
    made = ModuleType(name)
    sys.modules[name] = made
    exec(compile(source, name, "exec"), vars(made))
    return made


@pytest.fixture(params=["written", "compiled", "compiled_for_virtual_time"])
def forms(request: pytest.FixtureRequest) -> Any:
    native = native_form(SOURCE, plain_values=request.param == "compiled_for_virtual_time")
    assert native.count("def __init__") == 4
    return module(f"a_form_{request.param}", SOURCE if request.param == "written" else native)


def test_defaults_and_what_is_made_after_them(forms: Any) -> None:
    box = forms.Box(forms.Wheel(0.5), [1, 2, 3])
    assert (box.wheel.name, box.wheel.notes, box._twice, box.cost_s) == ("left", (), 6, 0.0)
    first, second = forms.Box(box.wheel), forms.Box(wheel=box.wheel)
    first.kept.append(1)
    assert second.kept == []


def test_parameters_by_keyword_and_a_constant_of_the_class(forms: Any) -> None:
    assert forms.Report(age_s=math.inf) == forms.Report.NONE
    assert [field.name for field in fields(forms.Report)].count("NONE") == 0
    assert replace(forms.Report.NONE, note="late").note == "late"
    assert pickle.loads(pickle.dumps(forms.Report.NONE)) == forms.Report.NONE


def test_constants_that_share_a_line(forms: Any) -> None:
    assert (forms.LOW, forms.HIGH, forms.ONE, forms.OTHERS, forms.LAST) == (1.0, 2.0, 1, [2, 3], 4)


def test_the_compiler_learns_what_is_constant_and_in_virtual_time_what_needs_no_collector() -> None:
    assert "mypyc_attr" not in native_form(SOURCE), "on a robot the collector knows all of them"
    native = native_form(SOURCE, plain_values=True)
    assert "LOW: _NeverAssignedAgain = 1.0\nHIGH: _NeverAssignedAgain = 2.0" in native
    assert native.count("@mypyc_attr(acyclic=True, free_list_len=1)") == 3, "of the frozen ones, and not of Box"


def test_what_is_equal_and_what_is_not(forms: Any) -> None:
    wheel = forms.Wheel(0.5)
    assert wheel == forms.Wheel(0.5)
    assert hash(wheel) == hash(forms.Wheel(0.5)) == hash((0.5, "left", ()))
    assert wheel != forms.Wheel(0.6)
    assert wheel != forms.Wheel(0.5, notes=(1.0,))
    assert wheel != (0.5, "left", ())
    assert forms.Wheel(math.nan) == forms.Wheel(math.nan), "one and the same NaN is equal in tuples, and so here"
    assert forms.Box(wheel, cost_s=1.0) == forms.Box(wheel, cost_s=2.0)
    assert forms.Alone() != forms.Alone()


def test_text_fields_copies_and_pickles(forms: Any) -> None:
    wheel = forms.Wheel(0.5, "right")
    assert repr(wheel) == "Wheel(speed_mps=0.5, name='right', notes=())"
    assert [field.name for field in fields(wheel)] == ["speed_mps", "name", "notes"]
    assert replace(wheel, name="left") == forms.Wheel(0.5)
    assert pickle.loads(pickle.dumps(wheel)) == wheel


def test_every_hot_module_exists() -> None:
    assert BUILD.is_relative_to(ROOT)
    for name in hot_modules():
        package = name.partition(".")[0]
        assert (ROOT / SOURCES[package] / name.replace(".", "/")).with_suffix(".py").is_file(), name


def test_no_safeguard_is_taken_out_of_compiled_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    """It would have no effect, and the campaign would find nothing: a check that cannot fail."""
    compiled = SimpleNamespace(__file__="policy.cpython-311-x86_64-linux-gnu.so")
    monkeypatch.setattr(removed_safeguards, "policy", compiled)
    with pytest.raises(RuntimeError, match="without COMPILED=1"):
        removed_safeguards.remove("watchdog:latch")
    removed_safeguards.remove("")
