"""The environment file of a robot's services, as both the installer and doctor read it."""

from __future__ import annotations

from pathlib import Path

import pytest

from canbase_deploy.host import environment
from canbase_doctor.service_environment import service_environment
from canbase_runtime.environment_file import variables

FILES = [
    ("ROS_DOMAIN_ID=42\n", {"ROS_DOMAIN_ID": "42"}),
    ("# A=1\n;B=2\n\nno assignment\n", {}),
    ("A=1\nA=2\n", {"A": "2"}),
    (" A = 'one two' \nB=\"x\"\n", {"A": "one two", "B": "x"}),
    ("A='it\nB=it's'\nC=\"\nD=a=b\nE=\n", {"A": "'it", "B": "it's'", "C": '"', "D": "a=b", "E": ""}),
]


@pytest.mark.parametrize(("text", "found"), FILES)
def test_installer_and_doctor_read_the_same_out_of_a_file(text: str, found: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "etc/canbase").mkdir(parents=True)
    (tmp_path / "etc/canbase/carrier.env").write_text(text)
    assert variables(text) == found
    assert environment(tmp_path, "carrier") == found
    assert service_environment({}, [], text) == found
