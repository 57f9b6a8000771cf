"""Models of the arms of the tests, and what the C core of one is made from."""

from typing import Any

import numpy as np
import robot_arms

from pvid.codegen.files_robot import RobotFiles
from pvid.configuration.robot_core import robot_core_design
from pvid.model import Robot
from pvid.model.chain import Chain
from pvid.model.compiled import CompiledModel
from pvid.rig.run import Recording
from pvid.settings.robot_core import RobotCoreDesign

ARMS = {"spatial": 500.0, "panda": 1000.0}  # samples a second


def model_of(chain: Chain, hold: Any = "sampled", name: str = "robot") -> CompiledModel:
    robot = Robot("arm", chain.gravity)
    robot.joints = list(chain.joints)
    for k in range(1, len(chain.joints) + 1):
        robot.sensor(f"q{k}", "rad", resolution=1e-4)
        robot.input(f"tau{k}", "N*m", hold=hold)
    return robot.compiled(name)


def truth_of(chain: Chain) -> Any:
    friction = {"Fv": 0.5, "Fc": 1.0}
    return np.array([friction.get(chain.standard[one.standard].kind, chain.of_file(one)) for one in chain.base])


def made(name: str, seed: int, seconds: float = 20.0, **how: Any) -> tuple[CompiledModel, RobotCoreDesign, Any]:
    """Model, design, and samples [ticks, 2 n] of a recording of an arm."""
    chain = robot_arms.arm(name, seed=5)
    model, log = model_of(chain, name="arm"), robot_arms.log_of(chain, seed, rate=ARMS[name], seconds=seconds, **how)
    design = robot_core_design(model, Recording(log.pop("t"), log, ARMS[name]))
    return model, design, np.stack([log[one] for one in RobotFiles(model, "").samples], axis=1)
