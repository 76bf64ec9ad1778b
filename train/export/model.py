"""Controllers as ONNX models, and the JSON that says what is in their tensors."""

from __future__ import annotations

import json
import logging
import warnings
from typing import TYPE_CHECKING, Any, Final

import torch
from gymnasium.error import DependencyNotInstalled
from torch.overrides import TorchFunctionMode

from agents.learned.agent import LearnedPolicy
from train.export.controller import Controller
from train.export.interface import DRUM_SPEED, FAULT, Tensor

if TYPE_CHECKING:
    import onnx

OPSET: Final = 18


class _Doubles(TorchFunctionMode):
    """Make tensors in double precision of the numbers in a formula: the exporter would round them to single."""

    def __torch_function__(
        self, func: Any, types: Any, args: tuple[Any, ...] = (), kwargs: dict[str, Any] | None = None
    ) -> Any:
        doubles = (torch.tensor(arg, dtype=torch.float64) if type(arg) is float else arg for arg in args)
        named = {
            name: torch.tensor(arg, dtype=torch.float64) if type(arg) is float else arg
            for name, arg in (kwargs or {}).items()
        }
        return func(*doubles, **named)


def description(agent: LearnedPolicy, controller: Controller) -> dict[str, Any]:
    """Inputs and outputs with names, shapes, units and ranges, and which agent it is."""
    next_state = Tensor("next_state", controller.state.fields)
    return {
        "agent": agent.name,
        "sha256": agent.card.sha256,
        "control_period": {"value": controller.period, "unit": "s"},
        "opset": OPSET,
        "inputs": [tensor.described() for tensor in (controller.readings, controller.told, controller.state)],
        "outputs": [tensor.described() for tensor in (DRUM_SPEED, FAULT, next_state)],
    }


def export(agent: LearnedPolicy) -> tuple[onnx.ModelProto, dict[str, Any]]:
    """The controller of an agent as a model, and its description, which lies in the model's metadata too."""
    try:
        import onnx
        import onnxscript  # noqa: F401 - the exporter needs it
    except ImportError as error:
        raise DependencyNotInstalled(f'{error.name} is not installed: pip install "aframe-heave[onnx]"') from None

    controller = Controller(agent).eval()
    described = description(agent, controller)
    examples = tuple(
        torch.zeros(tensor.size, dtype=torch.float64)
        for tensor in (controller.readings, controller.told, controller.state)
    )
    # The exporter warns of torchvision that is not there, and of its own deprecated parts.
    logging.getLogger("torch.onnx").setLevel(logging.ERROR)
    with warnings.catch_warnings(), _Doubles():
        warnings.simplefilter("ignore")
        program = torch.onnx.export(
            controller,
            examples,
            dynamo=True,
            verbose=False,
            opset_version=OPSET,
            external_data=False,
            input_names=[tensor["name"] for tensor in described["inputs"]],
            output_names=[tensor["name"] for tensor in described["outputs"]],
        )
    assert program is not None
    model: onnx.ModelProto = program.model_proto
    onnx.helper.set_model_props(
        model,
        {
            name: value if isinstance(value, str) else json.dumps(value, ensure_ascii=False)
            for name, value in described.items()
        },
    )
    onnx.checker.check_model(model, full_check=True)
    return model, described
