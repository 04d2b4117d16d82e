"""Bus load over time, in bins whose number does not grow with the recording. Pure."""

from __future__ import annotations

from typing import Final

MOST_BINS: Final = 1_200
FIRST_BIN_S: Final = 0.1


class LoadSeries:
    """Shares of the bus's time that frames took, with as many stuff bits as there can be: the real load is below."""

    def __init__(self, bitrate: int) -> None:
        self.bitrate = bitrate
        self.bin_s = FIRST_BIN_S
        self._bits: list[int] = []

    def on_frame(self, at_s: float, bits: int) -> None:
        """A frame of so many bits on the wire."""
        number = int(at_s / self.bin_s)
        while number >= MOST_BINS:
            self._bits = [sum(self._bits[i : i + 2]) for i in range(0, len(self._bits), 2)]
            self.bin_s *= 2.0
            number = int(at_s / self.bin_s)
        if number >= len(self._bits):
            self._bits.extend([0] * (number + 1 - len(self._bits)))
        self._bits[number] += bits

    @property
    def shares(self) -> list[tuple[float, float]]:
        """Begin of each bin [s] and the share of it, 0 to 1 and more where `bitrate` is wrong."""
        return [(i * self.bin_s, bits / self.bin_s / self.bitrate) for i, bits in enumerate(self._bits)]

    @property
    def highest(self) -> float:
        """The greatest share; of the last, unfinished bin it is the least that it can be."""
        return max((share for _, share in self.shares), default=0.0)

    @property
    def mean(self) -> float:
        """Over the whole recording."""
        shares = self.shares
        return sum(share for _, share in shares) / len(shares) if shares else 0.0
