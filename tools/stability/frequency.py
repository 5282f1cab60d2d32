"""Responses that fall by many powers of ten, far above the modes and down long chains."""

from __future__ import annotations

from typing import Any

import numpy as np

from suspension_cli.analyses.export import solve as export
from suspension_cli.design import reader
from suspension_cli.linear import eigenmodes, response, signals, statespace
from suspension_cli.linear.system import LinearSystem
from suspension_cli.models import registry
from tests.support.paths import CONFIGS
from tools.stability import naive
from tools.stability.references import compare, design
from tools.stability.row import SHIPPED, Row, relative, sample

FREQUENCY = np.geomspace(0.1, 1e5, 31)
STAGES = np.array([1, 2, 3, 4, 5, 6, 8, 10, 12, 15, 20, 25, 30])
CHAIN_FREQUENCY = 30.0
"""Hz; above all longitudinal modes of the chain."""


def quadruple() -> LinearSystem:
    """Build the quadruple pendulum of `configs/quadruple.toml`."""
    return registry.STRING.system(reader.parse((CONFIGS / "quadruple.toml").read_text()))


def chain(stages: int) -> LinearSystem:
    """Build a chain of equal masses on four wires each, attached at COM height: x is uncoupled."""
    body = {"mass": 10.0, "inertia": [0.05, 0.05, 0.05]}
    wires = {"count": 4, "l": 0.3, "s": 0.03, "t1": 0.1, "t2": 0.1, "d": 0.0, "k": 2e5}
    every = [{"name": f"mass{n}", "body": body, "wires": wires} for n in range(1, stages + 1)]
    return registry.STRING.system(design({"design": {"name": "chain"}, "stage": every}))


def _signals(model: LinearSystem) -> tuple[signals.Signal, signals.Signal]:
    known = signals.bodies_with_signals(model)
    return signals.parse_input("support.x", known), signals.parse_output(
        f"{model.body[-1]}.x", known
    )


def roll_off(frequency: Any = FREQUENCY) -> Row:
    """Compute errors of the response from support to mirror of a quadruple pendulum."""
    model = quadruple()
    into, out = _signals(model)
    compared = compare(model, frequency, [into], [out])
    reference = compared.exact[:, 0, 0]
    system = statespace.build(model, [into], [out])
    found = {
        f"{SHIPPED} export: state space": system.at(frequency)[:, 0, 0],
        f"{SHIPPED} export: zpk": export.compute_zero_pole_gain(system).at(frequency)[:, 0, 0],
        "modal sum": naive.modal_sum(model, frequency, into, out),
        "zpk, roots of polynomials": naive.polynomials(system, frequency),
        "state space in SI": naive.unbalanced(system, frequency),
        "dense solve": naive.dense(model, frequency, into, out),
    }
    return Row(
        title="Roll-off at high frequency",
        driver="frequency (Hz)",
        quantity="support.x to mirror x, quadruple",
        value=np.asarray(frequency),
        error={f"{SHIPPED}: body by body": compared.error[:, 0, 0]}
        | {name: relative(value, reference) for name, value in found.items()},
        finding=(
            "A response that falls as 1/f⁸ is a tiny difference of modes, or a product over"
            " zeros known to the rounding of the largest one. Transmissions of stages multiply:"
            " nothing cancels."
        ),
        limit="none found; `export` prints the band in which a state space or zpk is right",
        mark={"highest mode": float(eigenmodes.solve(model).frequency[-1])},
    )


def long_chain(stages: Any = STAGES) -> Row:
    """Compute errors of the response from support to the last of many equal masses."""

    def compute(count: float) -> Any:
        model = chain(int(count))
        into, out = _signals(model)
        at = np.array([CHAIN_FREQUENCY])
        reference = compare(model, at, [into], [out]).exact[0, 0, 0]
        return reference, {
            f"{SHIPPED}: body by body": response.solve(model, at, [into], [out]).value[0, 0, 0],
            "modal sum": naive.modal_sum(model, at, into, out)[0],
            "state space in SI": naive.unbalanced(statespace.build(model, [into], [out]), at)[0],
            "dense solve": naive.dense(model, at, into, out)[0],
            "transfer matrices": naive.cascade(model, at, "x")[0],
        }

    return Row(
        title="Very long chains",
        driver="number of stages",
        quantity=f"support.x to the last mass at {CHAIN_FREQUENCY:g} Hz",
        value=np.asarray(stages, dtype=float),
        error=sample(stages, compute),
        finding=(
            "Thirty stages transmit 10⁻⁵⁸: a sum over modes cannot resolve this, and transfer"
            " matrices from the top grow by as much. Elimination from the mirror up keeps all"
            " digits."
        ),
        limit="none found; below 10⁻³⁰⁸ a response is 0",
    )
