"""Presolve: reductions of covering and packing rows over binaries that keep an optimal plan, and the way back.

>>> import numpy as np
>>> from scipy.sparse import csr_array
>>> from pscover.model import CoverForm
>>> W, P = csr_array(np.array([[0.6, 0.5, 0.4]])), csr_array(np.array([[0.0, 1.0, 1.0]]))
>>> reduced = presolve(CoverForm(c=np.ones(3), W=W, P=P, allowed=np.ones(3, dtype=bool)))
>>> reduced.status.value, reduced.forced.tolist(), reduced.lift([]).tolist()
('solved', [0, 1], [0, 1])

One step is one module with its proof; `presolve` composes them by name, `components` splits what is left into independent
blocks, `fix_by_reduced_cost` fixes columns once a bound and a plan are known.
"""

from .chain import DEFAULT, STEPS, presolve
from .change import never
from .components import components
from .reduced import Applied, Outcome, Reduced
from .reduced_cost import Fixed, fix_by_reduced_cost, lagrangian

__all__ = [
    "DEFAULT",
    "STEPS",
    "Applied",
    "Fixed",
    "Outcome",
    "Reduced",
    "components",
    "fix_by_reduced_cost",
    "lagrangian",
    "never",
    "presolve",
]
