"""Adjusts the network that the benchmark wrote with Ceres Solver and compares; see `scripts/bench geometry`.

Residuals are ours: measured line and place minus those of the line that sees the point. The initial orientation of a
view goes on evenly from the line that sees its point in the end, where both agree to second order.

The cost functions are Python with analytic Jacobians: Ceres calls back into the interpreter for every view, so
that its time is mostly theirs. It bounds nothing but what one gets from pyceres without writing C++.
"""

import json
import sys
import time

import numpy as np
import pyceres

SIGMA0_TOLERANCE = 1e-6  # relative; both stop where the sum of squares changes by 1e-8 of itself or less


def cross(r):
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def rotation_and_jacobian(r):
    """exp([r]x), and its left Jacobian."""
    square = float(r @ r)
    angle = square**0.5
    if angle < 1e-2:
        sinc = 1.0 - square / 6.0 + square**2 / 120.0
        first = 0.5 - square / 24.0 + square**2 / 720.0
        second = 1.0 / 6.0 - square / 120.0 + square**2 / 5040.0
    else:
        sinc = np.sin(angle) / angle
        first = (1.0 - np.cos(angle)) / square
        second = (angle - np.sin(angle)) / (square * angle)
    k = cross(r)
    k2 = k @ k
    identity = np.eye(3)
    return identity + sinc * k + first * k2, identity + first * k + second * k2


class View(pyceres.CostFunction):
    def __init__(self, view, image):
        super().__init__()
        self.set_num_residuals(2)
        self.set_parameter_block_sizes([18, 3])
        near = view["near"]
        self.near = near["x_lines"]
        self.position = np.array(near["position_m"])
        self.base = np.array(near["mars_to_camera"])
        self.advance = np.array(near["advance_m"])
        self.turn = np.array(near["turn_rad"])
        self.half_lines = image["half_lines"]
        self.focal_length = image["focal_length_px"]
        self.line = view["x_lines"]
        self.px_per_line = view["px_per_line"]
        self.y = view["y_px"]
        self.sigma = np.array(view["sigma_px"])

    def see(self, coefficients, point):
        """The line that sees the point, its camera vector there, the vector's change per line, and the pose."""
        line = self.near
        for _ in range(20):
            t = line / self.half_lines
            powers = np.array([1.0, t, t * t])
            values = coefficients @ powers
            slopes = coefficients @ (np.array([0.0, 1.0, 2.0 * t]) / self.half_lines)
            rotation, left = rotation_and_jacobian(values[3:])
            along = line - self.near
            matrix = rotation @ rotation_and_jacobian(along * self.turn)[0] @ self.base
            q = matrix @ (point - self.position - along * self.advance - values[:3])
            turn = left @ slopes[3:] + rotation @ self.turn
            rate = np.cross(turn, q) - matrix @ (self.advance + slopes[:3])
            step = -q[0] / rate[0]
            line += step
            if abs(step) < 1e-2:
                return line, q + rate * step, rate, matrix, left, powers
        raise ArithmeticError("no line sees the point")

    def Evaluate(self, parameters, residuals, jacobians):
        line, q, rate, matrix, left, powers = self.see(parameters[0].reshape(6, 3), parameters[1])
        scale = -self.focal_length / q[2]
        residuals[0] = self.px_per_line * (self.line - line) / self.sigma[0]
        residuals[1] = (scale * q[1] - self.y) / self.sigma[1]
        if jacobians is None:
            return True
        along, across = scale * np.array([[1.0, 0.0, -q[0] / q[2]], [0.0, 1.0, -q[1] / q[2]]])
        along /= along @ rate
        by_q = np.array([self.px_per_line * along, across - (across @ rate) * along])
        by_q /= self.sigma[:, None]
        by_point = by_q @ matrix
        by_rotation = -by_q @ cross(q) @ left
        if jacobians[0] is not None:
            by_image = np.hstack([-by_point, by_rotation])[:, :, None] * powers
            jacobians[0][:] = by_image.ravel()
        if jacobians[1] is not None:
            jacobians[1][:] = by_point.ravel()
        return True


class Range(pyceres.CostFunction):
    def __init__(self, shot, image):
        super().__init__()
        self.set_num_residuals(1)
        self.set_parameter_block_sizes([18, 3])
        t = shot["x_lines"] / image["half_lines"]
        self.powers = np.array([1.0, t, t * t])
        self.position = np.array(shot["position_m"])
        self.range = shot["range_m"]
        self.sigma = shot["sigma_m"]

    def Evaluate(self, parameters, residuals, jacobians):
        shift = parameters[0].reshape(6, 3)[:3] @ self.powers
        away = parameters[1] - self.position - shift
        distance = np.sqrt(away @ away)
        residuals[0] = (distance - self.range) / self.sigma
        if jacobians is None:
            return True
        by_point = away / (distance * self.sigma)
        if jacobians[0] is not None:
            jacobians[0][:9] = -(by_point[:, None] * self.powers).ravel()
            jacobians[0][9:] = 0.0
        if jacobians[1] is not None:
            jacobians[1][:] = by_point
        return True


class Prior(pyceres.CostFunction):
    def __init__(self, values, sigmas):
        super().__init__()
        self.values = np.array(values)
        self.sigmas = np.array(sigmas)
        self.set_num_residuals(len(values))
        self.set_parameter_block_sizes([len(values)])

    def Evaluate(self, parameters, residuals, jacobians):
        residuals[:] = (parameters[0] - self.values) / self.sigmas
        if jacobians is not None and jacobians[0] is not None:
            jacobians[0][:] = np.diag(1.0 / self.sigmas).ravel()
        return True


def adjust(network):
    problem = pyceres.Problem()
    images = [np.zeros(18) for _ in network["images"]]
    points = [np.array(point["ground_m"]) for point in network["points"]]
    costs = []  # Python must keep them alive

    def add(cost, blocks):
        costs.append(cost)
        problem.add_residual_block(cost, None, blocks)

    for view in network["views"]:
        add(View(view, network["images"][view["image"]]), [images[view["image"]], points[view["point"]]])
    for shot in network["ranges"]:
        add(Range(shot, network["images"][shot["image"]]), [images[shot["image"]], points[shot["point"]]])
    for image, unknowns in zip(network["images"], images):
        add(Prior(np.zeros(18), image["sigmas"]), [unknowns])
    for point, ground in zip(network["points"], points):
        if point["sigma_m"]:
            add(Prior(point["ground_m"], point["sigma_m"]), [ground])
    options = pyceres.SolverOptions()
    options.linear_solver_type = pyceres.LinearSolverType.DENSE_SCHUR
    options.function_tolerance = 1e-12
    options.max_num_iterations = 100
    options.minimizer_progress_to_stdout = False
    summary = pyceres.SolverSummary()
    pyceres.solve(options, problem, summary)
    degrees = summary.num_residuals - summary.num_parameters
    return (2.0 * summary.final_cost / degrees) ** 0.5, degrees, summary


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        network = json.load(file)
    began = time.perf_counter()
    sigma0, degrees, summary = adjust(network)
    seconds = time.perf_counter() - began
    ours = network["areograph"]
    difference = abs(sigma0 / ours["sigma0"] - 1.0)
    print(
        f"adjustment, recipe by Ceres with Python cost functions: {seconds:.4f} s "
        f"({summary.num_successful_steps} steps, {summary.linear_solver_time_in_seconds:.4f} s in its linear solver, "
        f"sigma0 {sigma0:.9f}, degrees of freedom {degrees}); ours {ours['seconds']:.4f} s, "
        f"sigma0 differs by {difference:.1e}"
    )
    if degrees != ours["degrees_of_freedom"] or not difference < SIGMA0_TOLERANCE:
        sys.exit("ceres: the two adjustments do not agree")
    if not seconds > ours["seconds"]:
        sys.exit("ceres: Ceres was faster")


main()
