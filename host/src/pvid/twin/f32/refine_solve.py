"""Twin of refine_solve_f32.c: the end of a block, in jobs."""

from __future__ import annotations

from enum import Enum

import numpy as np

from pvid.twin.f32.refine_model import Float32, RefineModel
from pvid.twin.f32.refine_pass import Pass

_F = np.float32
_LEAST_PART = _F(2e-6)
_MOST_HALVINGS = 12
_ROTATIONS = 4
_WIDTH_STEP = _F(0.7)


class Solution(Enum):
    """pvid_refine_solution."""

    SOLVING = 0
    SOLVED = 1
    UNSOLVED = 2


class Steps:
    """Steps of r: of the logarithm where r is logarithmic."""

    def __init__(self, model: RefineModel) -> None:
        shape = model.shape
        self.logarithmic = np.array(shape.logarithmic)
        self.is_width = np.arange(shape.parameters) < shape.widths

    def difference(self, to: Float32, source: Float32) -> Float32:
        """pvid_refine_difference_f32 of all entries."""
        difference = to - source
        return np.where(self.logarithmic, (_F(2) * difference) / (to + source), difference)

    def moved(self, r: Float32, step: Float32) -> Float32:
        """pvid_refine_move_f32."""
        half = _F(0.5) * step
        return np.where(self.logarithmic, r * ((_F(1) + half) / (_F(1) - half)), r + step)


def inverse_column(triangle: Float32, column: int) -> Float32:
    """pvid_refine_inverse_column_f32 of an upper triangle [n, n]."""
    out = np.zeros(len(triangle), _F)
    out[column] = _F(1) / triangle[column, column]
    for k in range(column - 1, -1, -1):
        total = _F(0)
        for j in range(k + 1, column + 1):
            total = total - triangle[k, j] * out[j]
        out[k] = total / triangle[k, k]
    return out


class Solve:
    """pvid_refine_solve_f32."""

    def __init__(self, model: RefineModel) -> None:
        shape = self.shape = model.shape
        self.model = model
        self.steps = Steps(model)
        n = shape.parameters
        self.triangle = np.zeros((n, n), _F)
        self.step = np.zeros(n, _F)
        self.shift = np.zeros(shape.states, _F)
        self.size = self.bend = self.residual = self.clash = _F(0)
        self.dropped = np.zeros(shape.width, bool)
        self.begin()

    def begin(self) -> None:
        """pvid_refine_solve_begin_f32."""
        self.job = self.halvings = self.row = self.rotation = 0

    def _copy(self, sums: Float32, triangle: Float32, past: Float32, linear: Float32) -> None:
        self.sum = sums.copy()
        self.triangle = triangle.copy()
        self.clash = _F(0)
        source = self.steps.difference(past, linear)
        n = self.shape.parameters
        self.right = np.zeros(n, _F)
        for i in range(n):
            total = _F(0)
            for j in range(i, n):
                total = total + triangle[i, j] * source[j]
            self.right[i] = total

    def _chart_sides(self, linear: Float32) -> None:
        first, end = self.shape.states, self.shape.columns
        chart = self.model.chart
        for i in range(first):
            self.sum[i, first:end] = chart(linear, self.sum[i, first:end])
        for j in range(end, self.shape.width):
            self.sum[first:end, j] = chart(linear, self.sum[first:end, j])

    def _to_steps(self, linear: Float32) -> None:
        first, end = self.shape.states, self.shape.columns
        chart = self.model.chart
        corner = np.triu(self.sum[first:end, first:end])
        corner = np.where(np.tri(len(corner), k=-1, dtype=bool), corner.T, corner)
        corner = np.array([chart(linear, row) for row in corner])
        corner = np.array([chart(linear, corner[:, j]) for j in range(len(corner))]).T
        self.sum[first:end, first:end] = corner
        self.whole = np.diag(self.sum).copy()

    def _eliminate(self, column: int) -> None:
        square = self.sum[column, column]
        if column == self.shape.width - 1:
            self.residual = square if square > 0 else _F(0)
            return
        row = self.sum[column, column:].copy()
        if self.dropped[column] or not square > _LEAST_PART * self.whole[column]:
            self.dropped[column] = True
            self.sum[column, column:] = 0
            return
        row = row * (_F(1) / np.sqrt(square))
        self.sum[column, column:] = row
        below = self.sum[column + 1 :, column + 1 :]
        self.sum[column + 1 :, column + 1 :] = below - np.multiply.outer(row[1:], row[1:])

    def _join(self) -> bool:
        first, n, row = self.shape.states, self.shape.parameters, self.row
        left = self.sum[first + row, first:-1]
        for i in range(self.rotation, min(self.rotation + _ROTATIONS, n)):
            a, b = self.triangle[i, i], left[i]
            self.rotation += 1
            square = a * a + b * b
            if not square > 0:
                continue
            scale = _F(1) / np.sqrt(square)
            cosine, sine = a * scale, b * scale
            x, y = self.triangle[i, i:].copy(), left[i:].copy()
            self.triangle[i, i:] = cosine * x + sine * y
            left[i:] = cosine * y - sine * x
            own, rest = self.right[i], self.sum[first + row, -1]
            self.right[i] = cosine * own + sine * rest
            self.sum[first + row, -1] = cosine * rest - sine * own
        if self.rotation == n:
            rest = self.sum[first + row, -1]
            self.clash = self.clash + rest * rest
            self.row += 1
            self.rotation = self.row
        return self.row == n

    def _solve(self, prior_sd: Float32, step_limit: np.float32) -> bool:
        n = self.shape.parameters
        step = self.step
        longest = largest = bend = self.reduction = _F(0)
        for k in range(n - 1, -1, -1):
            total = self.right[k]
            for j in range(k + 1, n):
                total = total - self.triangle[k, j] * step[j]
            if not self.triangle[k, k] > 0:
                return False
            step[k] = total / self.triangle[k, k]
            self.reduction = self.reduction + self.right[k] * self.right[k]
            if self.steps.is_width[k]:
                step[k] = _WIDTH_STEP if step[k] > _WIDTH_STEP else step[k]
                step[k] = -_WIDTH_STEP if step[k] < -_WIDTH_STEP else step[k]
            size = (-step[k] if step[k] < 0 else step[k]) / prior_sd[k]
            longest = longest if size <= longest else size
            if self.steps.is_width[k]:
                continue
            largest = largest if size <= largest else size
            bend = bend if size <= bend or not self.shape.logarithmic[k] else size
        self.size, self.bend = largest, bend
        if not longest < _F(1e6):
            return False
        if longest > step_limit:
            step *= step_limit / longest
        return True

    def _limit(self, linear: Float32) -> bool:
        if self.model.region(self.steps.moved(linear, self.step)) or self.halvings == _MOST_HALVINGS:
            return True
        self.step *= _F(0.5)
        self.halvings += 1
        return False

    def _shift(self) -> None:
        first = self.shape.states
        for k in range(first - 1, -1, -1):
            total = self.sum[k, -1]
            for j in range(self.shape.parameters):
                total = total - self.sum[k, first + j] * self.step[j]
            for j in range(k + 1, first):
                total = total - self.sum[k, j] * self.shift[j]
            self.shift[k] = total / self.sum[k, k] if self.sum[k, k] > 0 else _F(0)

    def do(
        self,
        sums: Float32,
        triangle: Float32,
        past: Float32,
        linear: Float32,
        prior_sd: Float32,
        step_limit: np.float32,
    ) -> Solution:
        """pvid_refine_solve_job_f32."""
        job, width = self.job, self.shape.width
        joined = 3 + width
        solved = joined + 1
        self.job += 1
        if job == 0:
            self._copy(sums, triangle, past, linear)
        elif job == 1:
            self._chart_sides(linear)
        elif job == 2:
            self._to_steps(linear)
        elif job < joined:
            self._eliminate(job - 3)
        elif job == joined:
            self.job = solved if self._join() else joined
        elif job == solved:
            return Solution.SOLVING if self._solve(prior_sd, step_limit) else Solution.UNSOLVED
        elif job == solved + 1:
            self.job = solved + (2 if self._limit(linear) else 1)
        else:
            self._shift()
            return Solution.SOLVED
        return Solution.SOLVING

    def end_state(self, done: Pass, linear: Float32) -> Float32:
        """pvid_refine_end_state_f32."""
        first = self.shape.states
        state = np.empty(first, _F)
        for i in range(first):
            x = done.state[i]
            for j in range(first):
                x = x + done.column[j, i] * self.shift[j]
            by_r = self.model.chart(linear, done.column[first:, i])
            for j in range(self.shape.moving):
                x = x + by_r[j] * self.step[j]
            state[i] = x
        return state
