"""The lines of `canbase bus dump`: each frame in words, some of them left out. Pure."""

from __future__ import annotations

from collections.abc import Sequence

from canbase_config.eds_file import Eds
from canbase_config.robot import Robot
from canbase_recording.entry import RecordedFrame
from canbase_recording.frame_words import Decoder
from canbase_recording.kind import Kind
from canbase_recording.network import Network
from canbase_recording.pdo_layouts import PdoLayouts
from canbase_runtime.foreign_text import SENTENCE_LENGTH, printable


class LiveWords:
    """Learns from every frame, also from those that it leaves out."""

    def __init__(
        self, robot: Robot | None, eds_files: Sequence[Eds], nodes: frozenset[int], kinds: frozenset[Kind]
    ) -> None:
        """`nodes`, `kinds`: those to show; empty: all. What is for all nodes is shown with each node."""
        layouts = PdoLayouts(robot)
        self._decoder = Decoder(layouts, robot, eds_files)
        self._network = Network(self._decoder, layouts, robot.bus.bitrate if robot else 500_000)
        self._nodes, self._kinds = nodes, kinds

    def line(self, frame: RecordedFrame) -> str | None:
        """The line of this frame; None: it is left out."""
        self._network.on_frame(frame)
        words = self._decoder.words(frame)
        is_wanted = not self._nodes or words.node_id in self._nodes or (not words.node_id and words.kind is Kind.NMT)
        if not is_wanted or (self._kinds and words.kind not in self._kinds):
            return None
        who = self._decoder.who(words.node_id) if words.node_id else ""
        data = frame.data[:8].hex(" ").upper()
        return printable(
            f"{frame.at_s:11.6f}  {frame.cob_id:03X}  {data:<23}  {who}{': ' if who else ''}{words.text}",
            SENTENCE_LENGTH,
        )
