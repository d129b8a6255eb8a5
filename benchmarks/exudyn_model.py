"""The two-pulley benchmark in Exudyn, for `exudyn.py`, which lies beside it.

The belt is made of ANCF cable elements, each divided into segments for the contact with pulleys,
with a bristle for every segment (`ObjectContactFrictionCircleCable2D`). Data and settings are those
that its authors use for the article: reference length 0.4 pi m, reference strain -0.05, contact per
area, a static computation without friction at the start, the trapezoidal rule with constraints at
velocity level, modified Newton, one thread, at most five iterations for what switches. Sources:
https://github.com/jgerstmayr/EXUDYN, main/pythonDev/Examples/beltDriveReevingSystem.py, and
https://github.com/THREAD-2-3/beltDriveSimulation, src/beltDriveParameterVariation.py.

Nothing is written or recorded but the speed and the torque; its build without range checks is used.
"""

from __future__ import annotations

import importlib
import math
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

T_END = 2.45
RADIUS, HEIGHT = 0.1, 1e-4  # of the belt's centre line, and of the belt above its inner side
APART, WIDTH = 0.1 * math.pi, 0.08
EA, DAMPING, EI, DENSITY = 8000.0, 1.0, 4e-3 / 3.0, 0.8288
CONTACT, CONTACT_DAMPING = 4e9, 8e4  # per area
BRISTLES, BRISTLE_DAMPING, MU = 5e9, 3.219e5, 0.5
INERTIA, DRAG, SPEED, LOAD = 0.25, 2.0, 12.0, 25.0
SAMPLES = 1e-3  # between samples [s]


@dataclass(frozen=True)
class Setting:
    elements: int
    segments: int
    step: float
    newton: float  # relative tolerance of its Newton iteration

    def __str__(self) -> str:
        return (
            f"{self.elements} elements x {self.segments} segments, h = {self.step:g} s, "
            f"Newton {self.newton:g}"
        )


#: Defaults of its documented example; and of a search for the cheapest that is as accurate.
DOCUMENTED = [Setting(n, 4, 5e-5, 1e-8) for n in (60, 120, 240)]
TUNED = [Setting(*mesh, 1e-4, 1e-4) for mesh in ((60, 8), (120, 8), (120, 12), (240, 8))]


@dataclass(frozen=True)
class Run:
    """Samples (n_t,), tensions of the spans at the end [N], CPU seconds of statics and dynamics."""

    t: np.ndarray
    omega: np.ndarray
    torque: np.ndarray
    tight: float
    slack: float
    static_cpu: float
    cpu: float


@contextmanager
def _without_this_folder() -> Iterator[None]:
    """`exudyn.py` beside this file has the name of the package."""
    here, path = Path(__file__).resolve().parent, list(sys.path)
    sys.path[:] = [entry for entry in path if Path(entry or ".").resolve() != here]
    try:
        yield
    finally:
        sys.path[:] = path


def package() -> tuple[ModuleType, ModuleType, ModuleType]:
    """The package, its items and its beams.

    Raises:
        SystemExit: It is not installed.
    """
    sys.exudynFast = True  # type: ignore[attr-defined]
    with _without_this_folder():
        try:
            return (
                importlib.import_module("exudyn"),
                importlib.import_module("exudyn.itemInterface"),
                importlib.import_module("exudyn.beams"),
            )
        except ModuleNotFoundError as error:
            if error.name != "exudyn":
                raise
            raise SystemExit(f"{error}: python -m pip install exudyn") from None


def drive_speed(_mbs: Any, t: float, _item: int, _offset: float) -> float:
    return SPEED * min(max((t - 0.05) / 0.55, 0.0), 1.0)


def load_torque(_mbs: Any, t: float, _load: float) -> float:
    part = min(max(t - 1.0, 0.0), 0.5)
    return -LOAD * (0.5 - 0.5 * math.cos(2.0 * math.pi * part))


class Belt:
    """The drive as a system of Exudyn, at rest."""

    def __init__(self, setting: Setting) -> None:
        self.exu, self.item, beams = package()
        self.setting = setting
        self.container = self.exu.SystemContainer()
        self.mbs = mbs = self.container.AddSystem()
        item = self.item
        self.ground = mbs.AddMarker(
            item.MarkerNodeCoordinate(nodeNumber=mbs.AddNode(item.NodePointGround()), coordinate=0)
        )
        centers, inner = [(0.0, 0.0), (APART, 0.0)], RADIUS - 0.5 * HEIGHT
        line = beams.CreateReevingCurve(
            [[list(center), inner, "L"] for center in centers],
            radialOffset=0.5 * HEIGHT,
            closedCurve=True,
            numberOfANCFnodes=setting.elements,
        )
        cable = item.Cable2D(
            physicsMassPerLength=DENSITY,
            physicsBendingStiffness=EI,
            physicsAxialStiffness=EA,
            physicsAxialDamping=DAMPING,
            physicsReferenceAxialStrain=-0.05,
            useReducedOrderIntegration=2,
            strainIsRelativeToReference=False,
        )
        _, self.cables, _, _, self.fixed = beams.PointsAndSlopes2ANCFCable2D(
            mbs,
            line["ancfPointsSlopes"],
            line["elementLengths"],
            cable,
            massProportionalLoad=[0.0, -9.81, 0.0],
            fixedConstraintsNode0=[1, 0, 0, 0],
            firstNodeIsLastNode=True,
        )
        self.length = line["totalLength"] / setting.elements
        self.area = WIDTH * self.length / setting.segments
        self.contacts: list[int] = []
        self.held: list[int] = []
        self.shafts = [self._pulley(center, inner) for center in centers]
        self.sensors = self._drive_and_load()
        mbs.Assemble()

    def _fix(self, marker: int, **how: Any) -> int:
        both = [self.ground, marker]
        return int(self.mbs.AddObject(self.item.CoordinateConstraint(markerNumbers=both, **how)))

    def _pulley(self, center: tuple[float, float], radius: float) -> tuple[int, int]:
        """A pulley with its contacts; its node and the marker of its angle."""
        mbs, item, segments = self.mbs, self.item, self.setting.segments
        node = mbs.AddNode(item.NodeRigidBody2D(referenceCoordinates=[*center, 0.0]))
        body = mbs.AddObject(
            item.ObjectRigidBody2D(physicsMass=50.0, physicsInertia=INERTIA, nodeNumber=node)
        )
        x, y, angle = (
            mbs.AddMarker(item.MarkerNodeCoordinate(nodeNumber=node, coordinate=k))
            for k in range(3)
        )
        self._fix(x)
        self._fix(y)
        self.held.append(self._fix(angle))
        circle = mbs.AddMarker(item.MarkerBodyRigid(bodyNumber=body))
        for cable in self.cables:
            shape = mbs.AddMarker(
                item.MarkerBodyCable2DShape(
                    bodyNumber=cable, numberOfSegments=segments, verticalOffset=-0.5 * HEIGHT
                )
            )
            # of each segment: gap, sticking or not (-2: not known), place where it sticks
            history = mbs.AddNode(
                item.NodeGenericData(
                    initialCoordinates=[0.1] * segments + [-2] * segments + [0] * segments,
                    numberOfDataCoordinates=3 * segments,
                )
            )
            self.contacts.append(
                mbs.AddObject(
                    item.ObjectContactFrictionCircleCable2D(
                        markerNumbers=[circle, shape],
                        nodeNumber=history,
                        numberOfContactSegments=segments,
                        contactStiffness=CONTACT * self.area,
                        contactDamping=CONTACT_DAMPING * self.area,
                        frictionVelocityPenalty=BRISTLE_DAMPING * self.area,
                        frictionStiffness=BRISTLES * self.area,
                        frictionCoefficient=MU,
                        circleRadius=radius,
                    )
                )
            )
        return node, angle

    def _drive_and_load(self) -> tuple[int, int]:
        """Motion of the first pulley, drag and load on the second; sensors of torque and speed."""
        mbs, item, kinds = self.mbs, self.item, self.exu.OutputVariableType
        self.motor = self._fix(
            self.shafts[0][1], velocityLevel=True, offsetUserFunction_t=drive_speed
        )
        node, angle = self.shafts[1]
        mbs.AddObject(item.CoordinateSpringDamper(markerNumbers=[self.ground, angle], damping=DRAG))
        mbs.AddLoad(item.LoadCoordinate(markerNumber=angle, load=0.0, loadUserFunction=load_torque))
        torque = item.SensorObject(
            objectNumber=self.motor, storeInternal=True, outputVariableType=kinds.Force
        )
        speed = item.SensorNode(
            nodeNumber=node, storeInternal=True, outputVariableType=kinds.AngularVelocity
        )
        return mbs.AddSensor(torque), mbs.AddSensor(speed)

    def _friction(self, coefficient: float, stiffness: float) -> None:
        for contact in self.contacts:
            self.mbs.SetObjectParameter(contact, "frictionCoefficient", coefficient)
            self.mbs.SetObjectParameter(contact, "frictionStiffness", stiffness)

    def settings(self, t_end: float) -> Any:
        settings = self.exu.SimulationSettings()
        settings.linearSolverType = self.exu.LinearSolverType.EigenSparse
        settings.parallel.numberOfThreads = 1
        settings.solutionSettings.writeSolutionToFile = False
        settings.solutionSettings.sensorsWritePeriod = SAMPLES
        dynamic = settings.timeIntegration
        dynamic.endTime = t_end
        dynamic.numberOfSteps = round(t_end / self.setting.step)
        dynamic.verboseMode = 0
        dynamic.newton.useModifiedNewton = True
        dynamic.newton.relativeTolerance = self.setting.newton
        dynamic.discontinuous.iterationTolerance = 1e-3
        dynamic.discontinuous.maxIterations = 5
        static = settings.staticSolver
        static.verboseMode = 0
        static.adaptiveStep = False
        static.loadStepGeometric = True
        static.loadStepGeometricRange = 1e4
        static.numberOfLoadSteps = 10
        static.stabilizerODE2term = 1e5
        static.newton.relativeTolerance = 1e-6
        static.newton.absoluteTolerance = 1e-6
        return settings

    def run(self, t_end: float = T_END) -> Run:
        mbs, settings = self.mbs, self.settings(t_end)
        begin = time.process_time()
        mbs.SetObjectParameter(self.motor, "activeConnector", False)
        self._friction(0.0, 1e-8)
        self.exu.SolveStatic(mbs, settings, updateInitialValues=True)
        self._friction(MU, BRISTLES * self.area)
        for fixed in (*self.fixed, *self.held):
            mbs.SetObjectParameter(fixed, "activeConnector", False)
        mbs.SetObjectParameter(self.motor, "activeConnector", True)
        rest = time.process_time()
        trapezoidal = self.exu.DynamicSolverType.TrapezoidalIndex2
        self.exu.SolveDynamic(mbs, settings, solverType=trapezoidal)
        end = time.process_time()
        torque, speed = (mbs.GetSensorStoredData(sensor) for sensor in self.sensors)
        return Run(
            t=speed[:, 0],
            omega=speed[:, 3],
            torque=torque[:, 1],
            tight=self._tension(RADIUS),
            slack=self._tension(-RADIUS),
            static_cpu=rest - begin,
            cpu=end - rest,
        )

    def _tension(self, height: float) -> float:
        """Mean axial force in the middles of the elements of the span at this height."""
        kinds, found = self.exu.OutputVariableType, []
        middle = [0.5 * self.length, 0.0, 0.0]
        for cable in self.cables:
            x, y = self.mbs.GetObjectOutputBody(cable, kinds.Position, middle)[:2]
            if 0.1 * APART < x < 0.9 * APART and abs(y - height) < 0.1 * RADIUS:
                found.append(self.mbs.GetObjectOutputBody(cable, kinds.ForceLocal, middle))
        return float(np.mean(found))
