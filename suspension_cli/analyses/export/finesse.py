"""A suspension as an element of finesse 3: its mirror's motions and forces, and those of stages.

`pendsus export --format finesse` writes this text with the numbers of a design, so that the file
needs numpy and finesse alone. Motions of the mirror and forces on it are those of finesse's mirror:
z is along its normal on side 1, x to the side, y up, pitch about x and yaw about y, right-handed.
If that normal points along the design's x (`facing` 1), these are its x, pitch and yaw; if it
points against it (-1), z and pitch have the opposite sign.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from finesse.components.general import Connector
from finesse.components.node import NodeDirection, NodeType
from finesse.components.workspace import ConnectorWorkspace

NODES = {
    "x": "z",
    "pitch": "pitch",
    "yaw": "yaw",
    "force_x": "F_z",
    "torque_pitch": "F_pitch",
    "torque_yaw": "F_yaw",
}
"""Nodes of finesse's mirror by the names of our motions and forces."""
TURNED = ("x", "pitch", "force_x", "torque_pitch")
"""Those that change sign with the side that the mirror faces."""


class Workspace(ConnectorWorkspace):
    """Workspace of a simulation: output, input and sign of the couplings that it uses."""

    edges: list[list[int]]


class Suspension(Connector):
    """A suspension of a mirror, with a port per body and a node per motion or force.

    Parameters
    ----------
    name
        Of the element: its nodes are ``name.upper.force_x``, ``name.support.x``, ...; those of the
        mirror are the nodes of its own mechanical port: ``name.test.z``, ``name.test.F_pitch``.
    mirror
        Element of finesse to suspend.
    facing
        1 if its normal on side 1 points along the design's x, -1 if against it.
    plant
        State space: `a`, `b`, `c`, `d` (SI), `input`, `output` (signals) and `mirror` (body).

    Raises
    ------
    ValueError
        If `facing` is neither 1 nor -1, or a stage has the name of an attribute of finesse.
    """

    def __init__(self, name: str, mirror: Any, facing: int, plant: dict[str, Any]) -> None:
        super().__init__(name)
        if facing not in (1, -1):
            raise ValueError(f"facing = {facing!r} is neither 1 nor -1")
        self._plant = plant
        port = mirror.mech
        sign = dict.fromkeys(TURNED, facing)
        found: dict[str, tuple[Any, int]] = {}
        for signal in (*plant["input"], *plant["output"]):
            body, _, kind = signal.rpartition(".")
            if body not in [own.name for own in self.ports]:
                if hasattr(self, body):
                    raise ValueError(f"finesse has a {body} of its own: rename this stage")
                self._add_port(body, NodeType.MECHANICAL)
            if body == plant["mirror"]:
                getattr(self, body)._add_node(NODES[kind], None, getattr(port, NODES[kind]))
                found[signal] = getattr(getattr(self, body), NODES[kind]), sign.get(kind, 1)
            else:
                getattr(self, body)._add_node(kind, NodeDirection.BIDIRECTIONAL)
                found[signal] = getattr(getattr(self, body), kind), 1
        self._edges = []
        for o, i in zip(*np.nonzero(self.response(np.pi)), strict=True):
            source, one = found[plant["input"][i]]
            target, other = found[plant["output"][o]]
            self._register_node_coupling(f"edge_{o}_{i}", source, target)
            self._edges.append((source, target, o, i, one * other))

    def response(self, frequency: float) -> np.ndarray:
        """Transfer matrix from all inputs to all outputs at a frequency in Hz."""
        a, b, c, d = (self._plant[key] for key in "abcd")
        return c @ np.linalg.solve(2j * np.pi * frequency * np.eye(len(a)) - a, b) + d

    def _get_workspace(self, sim: Any) -> Workspace | None:
        if not sim.signal:
            return None
        result = Workspace(self, sim)
        result.edges = [
            how
            for source, target, *how in self._edges
            if source.full_name in sim.signal.nodes and target.full_name in sim.signal.nodes
        ]
        result.signal.add_fill_function(self._fill, sim.model.fsig.f.is_changing)
        return result

    def _fill(self, workspace: Workspace) -> None:
        sim = workspace.sim
        response = self.response(sim.model_settings.fsig)
        for number, (o, i, sign) in enumerate(workspace.edges):
            with sim.signal.component_edge_fill3(workspace.owner_id, number, 0, 0) as value:
                value[:] = sign * response[o, i]
