"""What a row's need costs at least when cliques to come meet it, and which needs are alike."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .problem import FloatArray, IntArray

LABELS = 128
"""Most points of a price curve; of more, neighbours are joined to one with the supply of one at the price of the other."""
SUMS = 192
"""Most sums that entries can have; with more of them, needs are told apart as they are."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Table:
    """Of one row or of several.

    Parameters
    ----------
    prices
        Where each row's points begin, their supplies, rising, and the price at which so much or more is had.
    sums
        Where each row's sums begin, and the sums, rising; none where they are too many.
    """

    prices: tuple[IntArray, FloatArray, FloatArray]
    sums: tuple[IntArray, FloatArray]

    def price_of(self, need: float) -> float:
        """What a need of the first row costs at least; infinite if it cannot be met."""
        start, supply, price = self.prices
        at = int(np.searchsorted(supply[: start[1]], need - 1e-12))
        return float(price[at]) if at < start[1] else np.inf

    def with_group(self, amount: FloatArray, share: FloatArray) -> Table:
        """The row with one more clique, of which it may have one entry."""
        _, supply, price = self.prices
        supply, price = np.concatenate(([0.0], supply)), np.concatenate(([0.0], price))
        supplies = np.concatenate((supply, np.minimum(1.0, (supply[:, None] + amount)).ravel()))
        prices = np.concatenate((price, (price[:, None] + share).ravel()))
        order = np.lexsort((prices, -supplies))
        supplies, prices = supplies[order], prices[order]
        below = np.minimum.accumulate(prices)
        is_kept = np.ones(len(prices), dtype=np.bool_)
        is_kept[1:] = prices[1:] < below[:-1]
        supplies, prices = supplies[is_kept][::-1], prices[is_kept][::-1]
        # Nothing for nothing goes without saying; a free entry has replaced it already.
        first = int(supplies[0] <= 0.0)
        supplies, prices = supplies[first:], prices[first:]
        while len(supplies) > LABELS:
            odd = len(supplies) % 2
            supplies, prices = (
                np.concatenate((supplies[:odd], supplies[odd + 1 :: 2])),
                np.concatenate((prices[:odd], prices[odd::2])),
            )
        return Table(prices=(_span(supplies), supplies.copy(), prices.copy()), sums=self._sums(amount))

    def _sums(self, amount: FloatArray) -> tuple[IntArray, FloatArray]:
        old = self.sums[1]
        if len(old) == 0 and len(self.prices[1]):
            return self.sums
        old = np.concatenate(([0.0], old))
        new = np.unique(np.minimum(1.0, np.concatenate((old, (old[:, None] + amount).ravel()))))[1:]
        return (_span(new), new) if len(new) <= SUMS else (_span(new[:0]), new[:0])

    @classmethod
    def joined(cls, tables: list[Table]) -> Table:
        """Several rows as one table."""
        return cls(
            prices=(
                _starts([table.prices[1] for table in tables]),
                np.concatenate([table.prices[1] for table in tables]),
                np.concatenate([table.prices[2] for table in tables]),
            ),
            sums=(_starts([table.sums[1] for table in tables]), np.concatenate([table.sums[1] for table in tables])),
        )


def _span(values: FloatArray) -> IntArray:
    return np.array([0, len(values)], dtype=np.int32)


def _starts(parts: list[FloatArray]) -> IntArray:
    return np.cumsum([0, *map(len, parts)]).astype(np.int32)


NOTHING = Table(
    prices=(np.zeros(2, dtype=np.int32), np.zeros(0), np.zeros(0)), sums=(np.zeros(2, dtype=np.int32), np.zeros(0))
)
"""Of a row that nothing meets."""
