"""Finds and reads drive profiles: those that come with canbase by name, those of the user by their path."""

from __future__ import annotations

import difflib
import functools
from importlib import resources
from pathlib import Path

from pydantic import ValidationError

from canbase_config.errors import ConfigError
from canbase_config.profile import Profile
from canbase_config.schema import Schema
from canbase_config.validation_errors import explain
from canbase_config.yaml_file import read_yaml

PROFILE_SCHEMA = Schema(Profile)


def profile_names() -> tuple[str, ...]:
    """The profiles that come with canbase, in alphabetical order."""
    return tuple(sorted(file.stem for file in _folder().glob("*.yaml")))


def profile_path(name: str) -> Path:
    """The file of a profile: `name` is one of `profile_names()`, or the path of a .yaml file.

    Raises ValueError, with the nearest name, for anything else.
    """
    if name.endswith((".yaml", ".yml")):
        return Path(name)
    names = profile_names()
    if name in names:
        return _folder() / f"{name}.yaml"
    near = difflib.get_close_matches(name.lower(), names, n=1, cutoff=0.5)
    hint = f"; did you mean {near[0]}?" if near else ""
    raise ValueError(f"there is no drive profile {name!r}, expected one of {', '.join(names)} or a .yaml file{hint}")


@functools.lru_cache(maxsize=64)
def load_profile(name: str) -> Profile:
    """The profile of this name or path; each file is read once in a process.

    Raises ValueError for an unknown name, ConfigError for a file that is no profile.
    """
    file = read_yaml(profile_path(name))
    try:
        return Profile.model_validate(file.values)
    except ValidationError as error:
        raise ConfigError(explain(error, file, PROFILE_SCHEMA)) from error


def guess(vendor_id: int | None, product_code: int | None) -> str | None:
    """The name of the profile that knows this identity (1018h:1, 1018h:2); None: no profile does.

    One that names the product too goes before one that names the vendor alone.
    """
    found = {name: load_profile(name).identity for name in profile_names()}
    for name, identity in found.items():
        if identity.product_code is not None and (identity.vendor_id, identity.product_code) == (
            vendor_id,
            product_code,
        ):
            return name
    for name, identity in found.items():
        if identity.product_code is None and identity.vendor_id is not None and identity.vendor_id == vendor_id:
            return name
    return None


def _folder() -> Path:
    return Path(str(resources.files("canbase_config"))) / "drives"
