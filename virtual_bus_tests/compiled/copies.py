"""What build/compiled has to hold: a copy of each source, and of compiled modules their native form."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from compiled.modules import BUILD, ROOT, SOURCES, hot_modules
from compiled.native_form import native_form


def copies() -> Iterator[tuple[Path, bytes]]:
    """Where each file lies, and what is in it."""
    hot = set(hot_modules())
    for package, folder in SOURCES.items():
        for source in (ROOT / folder / package).rglob("*"):
            name = source.relative_to(ROOT / folder)
            if source.is_file() and "__pycache__" not in name.parts:
                data = source.read_bytes()
                is_hot = name.suffix == ".py" and ".".join(name.with_suffix("").parts) in hot
                yield BUILD / name, native_form(data.decode(), plain_values=True).encode() if is_hot else data


def outdated() -> list[str]:
    """Sources that have changed since they were copied; they are compiled as they were before."""
    return [path.name for path, data in copies() if not path.exists() or path.read_bytes() != data]
