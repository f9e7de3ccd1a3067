"""A survey adjusted by GTSAM, in its own environment, with its own C++ factors and no other.

    python gtsam_survey.py JOB.npz FOUND.npz

Seconds of processor time come as a line of JSON: to build the graph, to the minimum, covariances
of all poses and points, variances of distances between pairs of points from their joint ones. FOUND
holds points and sigmas.
"""

from __future__ import annotations

import json
import sys
import time

import gtsam
import numpy as np
from gtsam.symbol_shorthand import C, L, X

LENS = C(0)
SKEW_SIGMA_PX = 1e-3  # as good as none; less, and its system is too poorly conditioned


def graph_of(job: dict[str, np.ndarray]) -> tuple[gtsam.NonlinearFactorGraph, gtsam.Values]:
    """Factors and first values."""
    graph, first = gtsam.NonlinearFactorGraph(), gtsam.Values()
    gaussian, diagonal = gtsam.noiseModel.Gaussian.Covariance, gtsam.noiseModel.Diagonal.Sigmas
    fx, fy, cx, cy, *distortion = job["lens"]
    first.insert(LENS, gtsam.Cal3DS2(fx, fy, 0.0, cx, cy, *distortion))
    s = job["lens_sigma"]  # GTSAM has a skew between the focal lengths and the principal point
    lens_noise = diagonal(np.array([s[0], s[1], SKEW_SIGMA_PX, *s[2:]]))
    graph.add(gtsam.PriorFactorCal3DS2(LENS, first.atCal3DS2(LENS), lens_noise))
    for k, (center, turn) in enumerate(zip(job["center"], job["rotation"], strict=True)):
        pose = gtsam.Pose3(gtsam.Rot3(turn), center)
        first.insert(X(k), pose)
        graph.add(gtsam.PriorFactorPose3(X(k), pose, gaussian(job["pose_covariance"])))
    on_ground = diagonal(job["ground_sigma"])
    for k, place in enumerate(job["point"]):
        first.insertPoint3(L(k), place)
        graph.add(gtsam.PriorFactorPoint3(L(k), np.array([*place[:2], 0.0]), on_ground))
    pick = gtsam.noiseModel.Isotropic.Sigma(2, float(job["pick_sigma"]))
    for frame, label, pixel in zip(
        job["frame"].tolist(), job["label"].tolist(), job["pixel"], strict=True
    ):
        graph.add(gtsam.GeneralSFMFactor2Cal3DS2(pixel, pick, X(frame), L(label), LENS))
    tape = gtsam.noiseModel.Isotropic.Sigma(1, float(job["length_sigma"]))
    for (a, b), length in zip(job["line"].tolist(), job["length"].tolist(), strict=True):
        graph.add(gtsam.RangeFactor3(L(a), L(b), length, tape))
    return graph, first


def sigma_of_distance(
    marginals: gtsam.Marginals, found: gtsam.Values, pair: tuple[int, int]
) -> float:
    """By the joint covariance of both ends."""
    a, b = (L(k) for k in pair)
    way = found.atPoint3(b) - found.atPoint3(a)
    along = way / np.linalg.norm(way)
    joint = marginals.jointMarginalCovariance([a, b])
    both = joint.at(a, a) + joint.at(b, b) - joint.at(a, b) - joint.at(b, a)
    return float(np.sqrt(along @ both @ along))


def main(job_path: str, found_path: str) -> None:
    """Adjust, and print seconds."""
    with np.load(job_path) as file:
        job = dict(file)
    clock = [time.process_time()]
    graph, first = graph_of(job)
    clock.append(time.process_time())
    parameters = gtsam.LevenbergMarquardtParams.CeresDefaults()
    parameters.setRelativeErrorTol(1e-10)
    parameters.setlambdaInitial(1e-9)  # first values as good as the log's
    parameters.setLinearSolverType("MULTIFRONTAL_CHOLESKY")
    parameters.setOrderingType("METIS")
    optimizer = gtsam.LevenbergMarquardtOptimizer(graph, first, parameters)
    found = optimizer.optimize()
    clock.append(time.process_time())
    marginals = gtsam.Marginals(graph, found)
    pose = np.array([marginals.marginalCovariance(X(k)) for k in range(len(job["center"]))])
    point = np.array([marginals.marginalCovariance(L(k)) for k in range(len(job["point"]))])
    clock.append(time.process_time())
    sigma = [sigma_of_distance(marginals, found, (a, b)) for a, b in job["asked"].tolist()]
    clock.append(time.process_time())
    np.savez(
        found_path,
        point=[found.atPoint3(L(k)) for k in range(len(point))],
        pose_covariance=pose,
        point_covariance=point,
        distance_sigma=np.array(sigma),
    )
    print(json.dumps({"seconds": np.diff(clock).tolist(), "steps": optimizer.iterations()}))


if __name__ == "__main__":
    main(*sys.argv[1:])
