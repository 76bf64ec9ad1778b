"""The paper's case by exudyn, a multibody program with geometrically exact beams: the peer of ``benchmarks.rfem_peer``.

``python exudyn_peer.py CASE.json RESULT.json``, with the Python of an environment of its own that has exudyn. What the
crane is and how it moves stands in the case alone; see ``peer_case.py``. The result has x_L3 every output
interval and the solver's own time.

How exudyn is used, as its documentation and examples recommend:

- Members are chains of ``ObjectBeamGeometricallyExact``, shear deformable, two nodes, interpolated on SE(3), with a
  lumped (Lobatto) mass. ``ObjectANCFBeam`` is marked as in need of development, and ``ObjectANCFCable`` has neither
  shear nor torsion. The nodes have Euler parameters or, on request, a Lie group's rotation vector.
- Two members meet in two nodes that a ``GenericJoint`` holds together, as in its own example of a right-angle frame.
- The deck is a rigid body whose six coordinates are prescribed. The law is a symbolic user function, which exudyn
  evaluates in C++: nothing of Python runs during a step.
- The rope is its ``ReevingSystemSprings``: load, S, drum; force E F (L - l) / l, none in compression (to within 1 N).
- The compiled module without range checks (``sys.exudynFast``), implicit second-order integrator, solution file off.
"""

from __future__ import annotations

import contextlib
import json
import sys
import time
from pathlib import Path
from typing import Any

sys.exudynFast = True  # type: ignore[attr-defined]

import exudyn as exu  # noqa: E402
import exudyn.itemInterface as item  # noqa: E402
import exudyn.rigidBodyUtilities as rigid  # noqa: E402
import numpy as np  # noqa: E402
from exudyn.advancedUtilities import CreateSymbolicUserFunction  # noqa: E402

TRANSLATIONS = ("surge", "sway", "heave")


def law(harmonics: list[dict[str, Any]], order: int) -> Any:
    """Prescribed coordinate (``order`` 0) as a sum of sines, or its rate (1), to be made a symbolic function."""

    def offset(mbs: Any, t: Any, itemNumber: Any, lOffset: Any) -> Any:
        total = 0.0
        for harmonic in harmonics:
            frequency = 2.0 * np.pi / harmonic["period"]
            turned = frequency * t + (harmonic["phase"] + 0.5 * np.pi * order)
            total = total + harmonic["amplitude"] * frequency**order * exu.symbolic.sin(turned)
        return total

    return offset


class Model:
    """The crane in exudyn, undeformed or, with ``placed``, where a static solution put its nodes."""

    def __init__(self, case: dict[str, Any], *, lie_group: bool, placed: dict[int, Any] | None = None) -> None:
        self.case, self.lie_group, self.placed = case, lie_group, placed
        self.container = exu.SystemContainer()
        self.mbs = self.container.AddSystem()
        self.laws: list[tuple[int, str, Any]] = []
        self.nodes: list[int] = []
        self.places: list[np.ndarray] = []
        fixed = self.mbs.AddNode(item.NodePointGround())
        self.ground = self.mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=fixed, coordinate=0))
        self.moving = self._deck_velocity()
        self._add_deck()
        self.ends = [self._add_member(member) for member in case["members"]]
        for before, behind in ((0, 1), (1, 2)):
            self._join(before, behind)
        for place in case["feet"]:
            node = self._node_at(place)
            self.mbs.AddObject(item.SphericalJoint(markerNumbers=[self._on_deck(place), self._on_node(node)]))
        for link in case["servomotors"]:
            markers = [self._on_deck(link["deck"]), self._on_node(self._node_at(link["leg"]))]
            length = float(np.linalg.norm(np.subtract(link["leg"], link["deck"])))
            self.mbs.AddObject(item.DistanceConstraint(markerNumbers=markers, distance=length))
        self._add_load_and_rope()
        self.mbs.Assemble()

    def _harmonics(self, coordinate: str) -> list[dict[str, Any]]:
        return [harmonic for harmonic in self.case["motion"] if harmonic["coordinate"] == coordinate]

    def _deck_velocity(self) -> list[float]:
        return [
            sum(h["amplitude"] * 2.0 * np.pi / h["period"] * np.cos(h["phase"]) for h in self._harmonics(coordinate))
            for coordinate in TRANSLATIONS
        ]

    def _add_deck(self) -> None:
        node = self.mbs.AddNode(
            item.NodeRigidBodyRotVecLG(referenceCoordinates=[0.0] * 6, initialVelocities=[*self.moving, 0.0, 0.0, 0.0])
        )
        self.deck = self.mbs.AddObject(item.RigidBody(mass=1e3, inertia=[1e3] * 3 + [0.0] * 3, nodeNumber=node))
        for coordinate in range(6):
            constraint = self._hold(node, coordinate)
            harmonics = self._harmonics(TRANSLATIONS[coordinate]) if coordinate < 3 else []
            if harmonics:
                for order, name in enumerate(("offsetUserFunction", "offsetUserFunction_t")):
                    function = CreateSymbolicUserFunction(self.mbs, law(harmonics, order), name, constraint)
                    self.laws.append((constraint, name, function))

    def _hold(self, node: int, coordinate: int) -> int:
        marker = self.mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=coordinate))
        return self.mbs.AddObject(item.CoordinateConstraint(markerNumbers=[self.ground, marker]))

    def _on_deck(self, place: Any) -> int:
        return self.mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=self.deck, localPosition=list(place)))

    def _on_node(self, node: int) -> int:
        return self.mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=node))

    def _add_node(self, place: np.ndarray, axes: np.ndarray) -> int:
        number = len(self.nodes)
        moved, turned = (np.zeros(3), axes) if self.placed is None else self.placed[number]
        if self.lie_group:
            kind, parameters = item.NodeRigidBodyRotVecLG, rigid.RotationMatrix2RotationVector
        else:
            kind, parameters = item.NodeRigidBodyEP, rigid.RotationMatrix2EulerParameters
        reference, now = np.array(parameters(axes)), np.array(parameters(turned))
        if not self.lie_group and reference @ now < 0.0:
            now = -now
        node = self.mbs.AddNode(
            kind(
                referenceCoordinates=[*place, *reference],
                initialCoordinates=[*moved, *(now - reference)],
                initialVelocities=[*self.moving, *np.zeros(reference.size)],
            )
        )
        self.nodes.append(node)
        self.places.append(np.array(place))
        return node

    def _add_member(self, member: dict[str, Any]) -> tuple[int, int]:
        section = exu.BeamSection()
        section.stiffnessMatrix = np.diag(member["stiffness"])
        section.massPerLength = member["mass_per_length"]
        section.inertia = np.diag(member["inertia_per_length"])
        start, end, count = np.array(member["start"]), np.array(member["end"]), member["elements"]
        axes = np.array(member["axes"])
        places = [start + (end - start) * k / count for k in range(count + 1)]
        nodes = [self._add_node(place, axes) for place in places]
        length = float(np.linalg.norm(end - start)) / count
        for k in range(count):
            beam = self.mbs.AddObject(
                item.ObjectBeamGeometricallyExact(nodeNumbers=nodes[k : k + 2], length=length, sectionData=section)
            )
            self._weigh(beam)
        return nodes[0], nodes[-1]

    def _weigh(self, body: int) -> None:
        marker = self.mbs.AddMarker(item.MarkerBodyMass(bodyNumber=body))
        self.mbs.AddLoad(item.Gravity(markerNumber=marker, loadVector=[0.0, 0.0, -self.case["gravity"]]))

    def _join(self, before: int, behind: int) -> None:
        axes = [np.array(self.case["members"][k]["axes"]) for k in (before, behind)]
        last = self._on_node(self.ends[before][1])
        local = exu.HT(rotation=axes[1].T @ axes[0], translation=[0.0, 0.0, 0.0])
        first = self.mbs.AddMarker(item.MarkerNodeRigid(nodeNumber=self.ends[behind][0], localHT=local))
        self.mbs.AddObject(item.GenericJoint(markerNumbers=[last, first]))

    def _node_at(self, place: Any) -> int:
        gaps = [float(np.linalg.norm(node - np.array(place))) for node in self.places]
        nearest = int(np.argmin(gaps))
        if gaps[nearest] > 1e-9:
            raise SystemExit(f"no node at {place}: the nearest is {gaps[nearest]:g} m away; choose another mesh")
        return self.nodes[nearest]

    def _add_load_and_rope(self) -> None:
        case, mbs = self.case, self.mbs
        moved = np.zeros(3) if self.placed is None else self.placed[-1][0]
        velocity = self.moving if case["initial"] == "comoving" else [0.0] * 3
        self.load = mbs.AddNode(
            item.NodeRigidBodyRotVecLG(
                referenceCoordinates=[*case["load"]["place"], 0.0, 0.0, 0.0],
                initialCoordinates=[*moved, 0.0, 0.0, 0.0],
                initialVelocities=[*velocity, 0.0, 0.0, 0.0],
            )
        )
        mass = case["load"]["mass"]
        # The rope wants a rigid body at its end; its rotation is held.
        self._weigh(mbs.AddObject(item.RigidBody(mass=mass, inertia=[mass] * 3 + [0.0] * 3, nodeNumber=self.load)))
        for coordinate in (3, 4, 5):
            self._hold(self.load, coordinate)
        self.pulley = self._node_at(case["pulley"])
        rope = case["rope"]
        mbs.AddObject(
            item.ReevingSystemSprings(
                markerNumbers=[self._on_node(self.load), self._on_node(self.pulley), self._on_deck(case["drum"])],
                hasCoordinateMarkers=False,
                stiffnessPerLength=rope["axial_stiffness"],
                dampingPerLength=rope["damping"] * rope["unstretched_length"],
                referenceLength=rope["unstretched_length"],
                regularizationForce=1.0,
                sheavesAxes=exu.Vector3DList([[0.0, 1.0, 0.0]] * 3),
                sheavesRadii=[0.0, 0.0, 0.0],
            )
        )
        self.sensor = mbs.AddSensor(
            item.SensorNode(
                nodeNumber=self.load, storeInternal=True, outputVariableType=exu.OutputVariableType.Position
            )
        )

    def rest(self) -> dict[int, Any]:
        """Solve for static equilibrium; displacement and orientation of every node, the load's as -1."""
        settings = exu.SimulationSettings()
        settings.solution.file.write = False
        static = settings.staticSolver
        static.numberOfLoadSteps, static.verboseMode = 1, 0
        static.newton.relativeTolerance, static.newton.absoluteTolerance = 1e-9, 1e-3
        static.newton.maxIterations = 50
        static.newton.numericalDifferentiation.jacobianConnectorDerivative = True
        self.mbs.SolveStatic(settings)
        kind = exu.OutputVariableType
        placed = {
            number: (
                self.mbs.GetNodeOutput(node, kind.Displacement),
                self.mbs.GetNodeOutput(node, kind.RotationMatrix).reshape(3, 3),
            )
            for number, node in enumerate(self.nodes)
        }
        return placed | {-1: (self.mbs.GetNodeOutput(self.load, kind.Displacement), np.eye(3))}

    def run(self, settings: dict[str, Any]) -> dict[str, Any]:
        """Integrate; x_L3 every output interval, the solver's time and the size of the system."""
        for constraint, name, function in self.laws:
            self.mbs.SetObjectParameter(constraint, name, function)
        simulation = exu.SimulationSettings()
        simulation.solution.file.write = False
        simulation.solution.sensors.writePeriod = self.case["output_interval"]
        simulation.linearSolver.solverType = getattr(exu.LinearSolverType, settings["linear_solver"])
        scheme = simulation.timeIntegration
        scheme.verboseMode = 0
        scheme.endTime = self.case["duration"]
        scheme.numberOfSteps = round(self.case["duration"] / settings["step"])
        scheme.generalizedAlpha.spectralRadius = settings["spectral_radius"]
        scheme.newton.useModifiedNewton = settings["modified_newton"]
        scheme.newton.relativeTolerance = scheme.newton.absoluteTolerance = settings["tolerance"]
        solver = getattr(exu.DynamicSolverType, settings["solver"])
        wall, busy = time.perf_counter(), time.process_time()
        self.mbs.SolveDynamic(simulation, solverType=solver)
        wall, busy = time.perf_counter() - wall, time.process_time() - busy
        return {
            "wall_s": wall,
            "cpu_s": busy,
            "x_L3": self.mbs.GetSensorStoredData(self.sensor)[1:, 3].tolist(),
            "coordinates": len(self.mbs.systemData.GetODE2Coordinates()),
            "constraints": len(self.mbs.systemData.GetAECoordinates()),
        }


def main() -> None:
    """Run the case of the first argument, write the second."""
    given = json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))
    case, settings = given["case"], given["settings"]
    # The static solver does not take Lie group nodes: the equilibrium is always that of Euler parameters.
    with contextlib.redirect_stdout(sys.stderr):
        placed = Model(case, lie_group=False).rest()
        result = Model(case, lie_group=settings["lie_group"], placed=placed).run(settings)
    result["versions"] = {"exudyn": exu.__version__, "python": sys.version.split()[0], "numpy": np.__version__}
    Path(sys.argv[2]).write_text(json.dumps(result), encoding="utf-8")


if __name__ == "__main__":
    main()
