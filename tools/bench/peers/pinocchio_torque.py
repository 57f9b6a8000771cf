"""Pinocchio: the regressor of joint torques, as FIGAROH does it.

Zero-phase Butterworth filter, central differences, the base columns of the regressor with friction, least squares
weighted by joint.
"""

from __future__ import annotations

import tempfile
from typing import Any

import numpy as np

from bench.peers.arm import JOINTS, RATE, mjcf
from bench.peers.rigs import Fit, Float, Run

PACKAGE = "pin==4.1.0 scipy==1.17.1"
RIGS = ("arm3",)
CUT, EVERY = 10.0, 5  # of the filter [Hz]; rows that are kept
ORDER = (0, 1, 2, 3, 4, 5, 7, 6, 8, 9)  # places of Pinocchio's m, h, Ixx, Ixy, Iyy, Ixz, Iyz, Izz


def fit(rig: Any, run: Run, guess: Any) -> Fit:
    import pinocchio
    from scipy.signal import butter, filtfilt

    with tempfile.NamedTemporaryFile("w", suffix=".xml") as file:
        file.write(mjcf())
        file.flush()
        model = pinocchio.buildModelFromMJCF(file.name)
    data, low = model.createData(), butter(4, CUT / (RATE / 2))

    def smooth(x: Float) -> Float:
        return np.asarray(filtfilt(*low, x, axis=1))

    q = smooth(np.stack([run[f"q{k + 1}"] for k in range(JOINTS)]))
    v = np.gradient(q, 1 / RATE, axis=1)
    a = np.gradient(v, 1 / RATE, axis=1)
    held = np.stack([run[f"tau{k + 1}"] for k in range(JOINTS)])
    tau = smooth((held + np.roll(held, 1, 1)) / 2)
    inside = range(100, q.shape[1] - 100, EVERY)
    to_base = np.linalg.pinv(rig.base)
    rows = []
    for k in inside:
        full = pinocchio.computeJointTorqueRegressor(model, data, q[:, k], v[:, k], a[:, k])
        standard = np.zeros((JOINTS, 10 * JOINTS))
        for body in range(JOINTS):
            standard[:, 10 * body + np.array(ORDER)] = full[:, 10 * body : 10 * body + 10]
        friction = np.zeros((JOINTS, 2 * JOINTS))
        for joint in range(JOINTS):
            friction[joint, 2 * joint : 2 * joint + 2] = (v[joint, k], np.sign(v[joint, k]))
        rows.append(np.hstack([standard @ to_base, friction]))
    w, y = np.array(rows), tau[:, inside].T
    weight = np.ones(JOINTS)
    for _ in range(2):
        whole, right = ((w * weight[:, np.newaxis]).reshape(-1, w.shape[2]), (y * weight).ravel())
        found = np.linalg.lstsq(whole, right, rcond=None)[0]
        weight = 1 / (y - w @ found).std(0)
    whole, right = ((w * weight[:, np.newaxis]).reshape(-1, w.shape[2]), (y * weight).ravel())
    variance = np.sum((right - whole @ found) ** 2) / (len(right) - len(found))
    errors = np.sqrt(np.diag(np.linalg.inv(whole.T @ whole)) * variance)
    count = len(rig.base)
    return (rig.named(found[:count], found[count:]), rig.named(errors[:count], errors[count:]), "")
