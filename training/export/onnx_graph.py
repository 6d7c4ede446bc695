"""A policy as an ONNX graph in double precision: the last observations in, action and command out.

Needs the `onnx` extra to write; any ONNX runtime runs it. ONNX has no arctangent of two arguments, and
runtimes know only the single-precision one of one argument, so the bearing is made of that and one Newton
step in double precision.
"""

from __future__ import annotations

import json
from typing import TYPE_CHECKING, Any, Final

import numpy as np
import numpy.typing as npt

from mecanum_env.errors import BackendError, install_command
from mecanum_env.tankendo.actions import FULL_V_RPM, FULL_VC_RPM
from mecanum_env.tankendo.constants import GUARD_TIP_M
from mecanum_env.tankendo.sword import GUARD_HEIGHT_M
from training.controllers.features import (
    DRAWN_SHARE,
    FAR_S,
    LEAST_RATE_PER_S,
    LEAST_SHARE,
    WAY_DIRECTIONS,
    WAY_LENGTHS_M,
)
from training.export.contract import Contract

if TYPE_CHECKING:
    import onnx

_OPSET: Final = 17
_IR_VERSION: Final = 8
"""What goes with that opset: runtimes since 2022 read it."""
_TINY: Final = 1e-300
"""Keeps a quotient finite where the opponent stands exactly here."""


def onnx_model(contract: Contract) -> onnx.ModelProto:
    """Return the graph of a contract's policy, with the contract as its metadata.

    Its input `observations`, double, shape (n, stack, k), holds the last observations, oldest first; at the
    start of a fight the first one is repeated. Its outputs are `action`, shape (n, 3), within [-1, 1], and
    `command`, shape (n, 3): whole numbers V [rpm], theta [deg], VC [rpm], as doubles.

    Raises:
        BackendError: onnx is not installed.
    """
    try:
        from onnx import TensorProto, checker, helper
    except ImportError as error:
        raise BackendError(f"policy.onnx needs onnx; install it with {install_command('onnx')}") from error
    network = contract.policy.network
    graph = _Graph()
    action = _network(graph, contract, _stacked(graph, contract))
    command = _command(graph, contract, action)
    graph.add("Identity", [action], name="action")
    graph.add("Identity", [command], name="command")
    shape = ["n", network.stack, network.observation_size]
    built = helper.make_graph(
        graph.nodes,
        "policy",
        [helper.make_tensor_value_info("observations", TensorProto.DOUBLE, shape)],
        [helper.make_tensor_value_info(name, TensorProto.DOUBLE, ["n", 3]) for name in ("action", "command")],
        graph.constants,
    )
    model = helper.make_model(built, producer_name="mecanum-tankendo")
    model.ir_version = _IR_VERSION
    del model.opset_import[:]
    model.opset_import.append(helper.make_opsetid("", _OPSET))
    helper.set_model_props(model, {"contract": json.dumps(contract.to_json(), allow_nan=False)})
    checker.check_model(model, full_check=True)
    return model


class _Graph:
    """Nodes and constants in the order of their making; every method returns the name of its result."""

    def __init__(self) -> None:
        self.nodes: list[Any] = []
        self.constants: list[Any] = []

    def constant(self, value: npt.ArrayLike, kind: Any = np.float64) -> str:
        from onnx import numpy_helper

        name = f"c{len(self.constants)}"
        self.constants.append(numpy_helper.from_array(np.asarray(value, kind), name))
        return name

    def add(self, kind: str, inputs: list[str], name: str = "", **attributes: Any) -> str:
        from onnx import helper

        name = name or f"v{len(self.nodes)}"
        self.nodes.append(helper.make_node(kind, inputs, [name], **attributes))
        return name

    def take(self, source: str, first: int, last: int) -> str:
        """Return the numbers from `first` up to, not including, `last` along the last axis."""
        ends = [self.constant([number], np.int64) for number in (first, last, -1)]
        return self.add("Slice", [source, *ends])

    def length(self, x: str, y: str) -> str:
        squares = [self.add("Mul", [one, one]) for one in (x, y)]
        return self.add("Sqrt", [self.add("Add", squares)])

    def angle(self, y: str, x: str) -> str:
        """Return the angle of the vector (x, y) within +-pi [rad]; that of no vector at all is 0."""
        from onnx import TensorProto

        zero, tiny = self.constant(0.0), self.constant(_TINY)
        size = self.add("Max", [self.add("Abs", [x]), tiny])
        slope = self.add("Cast", [self.add("Div", [y, size])], to=TensorProto.FLOAT)
        near = self.add("Cast", [self.add("Atan", [slope])], to=TensorProto.DOUBLE)
        half = self.add("Where", [self.add("Less", [y, zero]), *map(self.constant, (-np.pi, np.pi))])
        behind = self.add("Less", [x, zero])
        rough = self.add("Where", [behind, self.add("Sub", [half, near]), near])
        # Newton's step: the sine of what is left of the angle, which is some 1e-7.
        across = self.add("Mul", [y, self.add("Cos", [rough])])
        along = self.add("Mul", [x, self.add("Sin", [rough])])
        left = self.add("Div", [self.add("Sub", [across, along]), self.add("Max", [self.length(x, y), tiny])])
        return self.add("Add", [rough, left])


def _stacked(graph: _Graph, contract: Contract) -> str:
    """Return the features of all observations, shape (n, stack * (k + 1))."""
    network = contract.policy.network
    size = network.observation_size
    whole = "observations"

    def minus(first: str, second: str | float) -> str:
        other = second if isinstance(second, str) else graph.constant(second)
        return graph.add("Sub", [first, other])

    o = [graph.take(whole, i, i + 1) for i in range(12)]
    tip_x, tip_y = minus(o[4], o[0]), minus(o[5], o[1])
    drawn, raised = minus(graph.length(tip_x, tip_y), GUARD_TIP_M), minus(o[6], GUARD_HEIGHT_M)
    own = [
        minus(graph.length(o[0], o[1]), contract.policy.maai_m),
        graph.angle(o[1], o[0]),
        minus(o[2], o[10]),
        minus(o[3], o[11]),
        tip_x,
        tip_y,
        raised,
        graph.length(drawn, raised),
        minus(o[7], o[2]),
        minus(o[8], o[3]),
        o[9],
    ]
    own.append(graph.take(whole, 10, size))
    if network.has_time_to_cut:
        own.append(_time_to_cut(graph, (tip_x, tip_y), (drawn, raised), (own[8], own[9], own[10])))
    features = graph.add("Concat", own, axis=-1)
    flat = graph.constant([-1, network.stack * network.feature_count], np.int64)
    return graph.add("Reshape", [features, flat])


def _time_to_cut(
    graph: _Graph, tip: tuple[str, str], place: tuple[str, str], velocity: tuple[str, str, str]
) -> str:
    """Return the last feature, `training.controllers.features.time_to_cut`.

    Args:
        graph: what it is added to.
        tip: where the tip is, relative to the opponent, along x and y.
        place: how far it is drawn away from guard, and up.
        velocity: its velocity relative to the opponent, along x and y, and up.
    """

    def calculated(kind: str, first: str | float, second: str | float) -> str:
        ends = [one if isinstance(one, str) else graph.constant(one) for one in (first, second)]
        return graph.add(kind, ends)

    along = graph.add(
        "Add", [graph.add("Mul", [velocity[0], tip[0]]), graph.add("Mul", [velocity[1], tip[1]])]
    )
    drawing = graph.add("Div", [along, calculated("Max", graph.length(*tip), 1e-6)])
    directions = graph.constant(WAY_DIRECTIONS.T)
    lengths = graph.constant(WAY_LENGTHS_M)
    ways = graph.add("MatMul", [graph.add("Concat", list(place), axis=-1), directions])
    rates = graph.add("MatMul", [graph.add("Concat", [drawing, velocity[2]], axis=-1), directions])
    technique = graph.add("ArgMax", [ways], axis=-1, keepdims=1)
    share, rate = (
        graph.add("GatherElements", [graph.add("Div", [one, lengths]), technique], axis=-1)
        for one in (ways, rates)
    )
    # The arc sine of x is the angle of (sqrt(1 - x^2), x).
    x = calculated(
        "Sub", 1.0, calculated("Mul", 2.0, graph.add("Clip", [share, *map(graph.constant, (0.0, 1.0))]))
    )
    beside = graph.add("Sqrt", [calculated("Max", 0.0, calculated("Sub", 1.0, graph.add("Mul", [x, x])))])
    third = calculated("Div", graph.angle(x, beside), 3.0)
    elapsed = calculated("Sub", 0.5, graph.add("Sin", [third]))
    rest = calculated("Sub", 1.0, elapsed)
    rises = graph.add(
        "And",
        [calculated("Greater", share, LEAST_SHARE), calculated("Greater", rate, LEAST_RATE_PER_S)],
    )
    numerator = calculated("Mul", 6.0, graph.add("Mul", [elapsed, graph.add("Mul", [rest, rest])]))
    left = graph.add("Div", [numerator, graph.add("Where", [rises, rate, graph.constant(1.0)])])
    still = graph.add(
        "Where", [calculated("Greater", share, DRAWN_SHARE), graph.constant(0.0), graph.constant(FAR_S)]
    )
    near = graph.add("Clip", [left, *map(graph.constant, (0.0, FAR_S))])
    return graph.add("Where", [rises, near, still])


def _network(graph: _Graph, contract: Contract, stacked: str) -> str:
    """Return the action, shape (n, 3), for stacked features."""
    network = contract.policy.network
    ends = [graph.constant(end) for end in (-network.clip, network.clip)]
    centred = graph.add("Sub", [stacked, graph.constant(network.mean)])
    x = graph.add("Clip", [graph.add("Div", [centred, graph.constant(network.scale)]), *ends])
    activation = {"tanh": "Tanh", "relu": "Relu"}[network.activation]
    for layer, (weight, bias) in enumerate(zip(network.weights, network.biases, strict=True)):
        x = graph.add(activation, [x]) if layer else x
        x = graph.add("Add", [graph.add("MatMul", [x, graph.constant(weight.T)]), graph.constant(bias)])
    if network.squashes:
        return graph.add("Tanh", [x])
    return graph.add("Clip", [x, graph.constant(-1.0), graph.constant(1.0)])


def _command(graph: _Graph, contract: Contract, action: str) -> str:
    """Return the command, shape (n, 3), of an action, as `mecanum_env.tankendo.actions` does."""
    mode = contract.policy.network.action_mode
    a, b, turn = (graph.take(action, i, i + 1) for i in range(3))

    def times(one: str, factor: float) -> str:
        return graph.add("Mul", [one, graph.constant(factor)])

    if mode == "cartesian":
        full = graph.add("Min", [graph.length(a, b), graph.constant(1.0)])
        v, theta = times(full, FULL_V_RPM), times(graph.angle(b, a), float(np.rad2deg(1.0)))
    elif mode == "polar":
        v = times(graph.add("Add", [a, graph.constant(1.0)]), 0.5 * FULL_V_RPM)
        theta = times(b, 180.0)
    else:
        v, theta = times(a, FULL_V_RPM), times(b, 180.0)
    quantum = graph.constant(contract.policy.quantum_rpm)

    def rounded(speed: str) -> str:
        steps = graph.add("Round", [graph.add("Div", [speed, quantum])])
        return graph.add("Round", [graph.add("Mul", [steps, quantum])])

    parts = [rounded(v), graph.add("Round", [theta]), rounded(times(turn, FULL_VC_RPM))]
    return graph.add("Concat", parts, axis=-1)
