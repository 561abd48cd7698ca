"""What the paper reports (Adler et al. 2023, arXiv 2310.16951, Table 1 and its text), to be set beside one's own numbers."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Published:
    """A row of the paper.

    Parameters
    ----------
    opt, bound
        Objects per transport, and the half width of its 95 % interval.
    pph
        Picks per hour; None where the paper gives none.
    """

    opt: float
    bound: float
    pph: float | None = None


TABLE_1 = {
    "random": Published(opt=1.07, bound=0.07, pph=125),
    "volume": Published(opt=1.27, bound=0.11, pph=147),
    "height": Published(opt=1.22, bound=0.07, pph=145),
    "segment": Published(opt=1.55, bound=0.11, pph=174),
    "hybrid-volume": Published(opt=1.34, bound=0.10),
    "hybrid-height": Published(opt=1.45, bound=0.14),
    "consolidation": Published(opt=1.94, bound=0.15, pph=160),
}
"""By policy. The text has 1.57 for segment and 1.91 for consolidation."""
