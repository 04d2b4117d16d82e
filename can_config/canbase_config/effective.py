"""The whole effective configuration as YAML text that loads again, each value that is a default marked as one."""

from __future__ import annotations

import io
import re
from collections.abc import Sequence
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap, CommentedSeq
from ruamel.yaml.nodes import ScalarNode
from ruamel.yaml.representer import RoundTripRepresenter
from ruamel.yaml.scalarint import HexCapsInt

from canbase_config.errors import Loc
from canbase_config.load import Loaded

DEFAULT_MARK: Final = "default"
"""The comment behind a value that the file does not give."""
_MARK_COLUMN: Final = 44
_IN_HEX: Final = frozenset(("index", "vendor_id", "product_code", "revision", "serial"))
"""Keys whose numbers are those of a manual, an EDS or 1018h: hexadecimal, as `canbase setup commission` writes them."""


class _Representer(RoundTripRepresenter):
    """Writes None as `null`, not as nothing, and quotes text with line ends and the like, which YAML would fold."""

    def represent_none(self, data: Any) -> ScalarNode:
        return self.represent_scalar("tag:yaml.org,2002:null", "null")

    def represent_str(self, data: str) -> ScalarNode:
        return self.represent_scalar("tag:yaml.org,2002:str", data, style=None if data.isprintable() else '"')


_Representer.add_representer(type(None), _Representer.represent_none)
_Representer.add_representer(str, _Representer.represent_str)


def effective(loaded: Loaded) -> str:
    """The configuration as the processes see it, as a robot.yaml with `# default` behind every default."""
    yaml = YAML()
    yaml.Representer = _Representer
    yaml.indent(mapping=2, sequence=4, offset=2)
    yaml.width = 4096
    text = io.StringIO()
    yaml.dump(_marked(loaded.robot.model_dump(), (), loaded.defaults), text)
    return text.getvalue()


def _marked(value: Any, loc: Loc, defaults: frozenset[Loc]) -> Any:
    """`value` in ruamel.yaml's mappings, which carry comments: the mark behind each entry that is among `defaults`."""
    if isinstance(value, (list, tuple)) and loc in defaults and all(_is_simple(inner) for inner in value):
        return _in_one_line(value)
    if isinstance(value, (list, tuple)):
        return [_marked(inner, (*loc, index), defaults) for index, inner in enumerate(value)]
    if isinstance(value, int) and loc[-1] in _IN_HEX:
        return HexCapsInt(value)
    if not isinstance(value, dict) or not value:
        return value
    marked = CommentedMap()
    for key, inner in value.items():
        marked[key] = _marked(inner, (*loc, key), defaults)
        if (*loc, key) in defaults:
            marked.yaml_add_eol_comment(DEFAULT_MARK, key, column=_MARK_COLUMN)
    return marked


def _is_simple(value: Any) -> bool:
    """What looks the same in every style of YAML."""
    return isinstance(value, (bool, int)) or (
        isinstance(value, str) and re.fullmatch(r"[A-Za-z/][\w/]*", value) is not None
    )


def _in_one_line(values: Sequence[Any]) -> CommentedSeq:
    """So that the mark can stand behind it."""
    line = CommentedSeq(values)
    line.fa.set_flow_style()
    return line
