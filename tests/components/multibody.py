"""A sprung body and four wheels with exact rotations, to compare the equations of `cars.ride` with.

Independent of the components and of their derivation: one rigid body, four point masses that slide in it
along straight lines, positions written down exactly, Jacobians by complex step, Newton's and Euler's
equations with d'Alembert's principle. No coordinate is small. The line of a wheel is fixed in the body, with
the slope p_i = h_ci / y_i in its contact point's path; the body rolls about no given centre.

Coordinates q: x, y, psi, z, phi, theta of the sprung mass's centre (z from rest), then the travels c_fl,
c_fr, c_rl, c_rr along the lines; velocities are their time derivatives.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from yawbench.components.cars.ride import Ride
from yawbench.components.cars.sprung_car import FourteenDofParameters, G, ride_of

Vector = np.ndarray[Any, Any]

STEP = 1e-25
"""Complex step of the Jacobians."""
CURVE = 2e-4
"""Step [s] of the second difference along the velocity; its error is of the order of its square."""


def rotation(psi: complex, theta: complex, phi: complex) -> Vector:
    """Return the matrix from body to earth axes; yaw, pitch, roll."""
    cy, sy, cp, sp = np.cos(psi), np.sin(psi), np.cos(theta), np.sin(theta)
    cr, sr = np.cos(phi), np.sin(phi)
    yaw = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    pitch = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    roll = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    return yaw @ pitch @ roll


class MultiBody:
    """The car of `p`.

    Args:
        sideways: whether wheel centres follow the slope of their contact points' paths, as on parallel arms
            of equal length; else they do not move sideways in the body, as `cars.ride` assumes.
    """

    def __init__(self, p: FourteenDofParameters, *, sideways: bool = False) -> None:
        ride = self.ride = ride_of(p)
        t = ride.half_track
        self.sideways = sideways
        self.wheels = np.array([ride.m_f, ride.m_f, ride.m_r, ride.m_r])
        self.sprung_height = (p.mass * p.cg_height - sum(self.wheels) * p.unsprung_height) / ride.m_s
        self.wheel_height = p.unsprung_height
        self.x = np.array([ride.a, ride.a, -ride.b, -ride.b])
        self.y = np.array([t, -t, t, -t])
        self.slopes = np.array([ride.p_f, -ride.p_f, ride.p_r, -ride.p_r])
        self.static_loads = np.array([ride.load_f, ride.load_f, ride.load_r, ride.load_r])
        self.inertia = np.diag([p.sprung_roll_inertia, p.sprung_pitch_inertia, ride.yaw_sprung])
        self.springs = np.array([ride.k_f, ride.k_f, ride.k_r, ride.k_r])
        self.dampers = np.array([ride.d_f, ride.d_f, ride.d_r, ride.d_r])
        self.bars = np.array([ride.s_f, ride.s_f, ride.s_r, ride.s_r])

    def places(self, q: Vector) -> tuple[Vector, Vector]:
        """Return the centres of the five masses (15,) and the contact points (12,), earth axes [m]."""
        turn = rotation(q[2], q[5], q[4])
        centre = np.array([q[0], q[1], self.sprung_height + q[3]])
        along = self.slopes * q[6:]
        beside = self.y + (along if self.sideways else 0.0 * along)
        drop = self.wheel_height - self.sprung_height
        wheels = centre + np.array([self.x + 0.0 * along, beside, drop + q[6:]]).T @ turn.T
        contacts = (
            centre + np.array([self.x + 0.0 * along, self.y + along, q[6:] - self.sprung_height]).T @ turn.T
        )
        return np.concatenate([centre, wheels.ravel()]), contacts.ravel()

    def spin(self, q: Vector) -> Vector:
        """Return the matrix (3, 10) from velocities to the angular velocity in body axes."""
        rows = np.zeros((3, 10), q.dtype)
        rows[:, 2] = -np.sin(q[5]), np.cos(q[5]) * np.sin(q[4]), np.cos(q[5]) * np.cos(q[4])
        rows[0, 4] = 1.0
        rows[1, 5], rows[2, 5] = np.cos(q[4]), -np.sin(q[4])
        return rows

    def loads(self, q: Vector) -> Vector:
        """Return the vertical loads (4,) [N] from the heights of the contact points."""
        heights = self.places(q)[1][2::3]
        return np.maximum(self.static_loads - self.ride.k_t * heights, 0.0)

    def accelerations(self, q: Vector, v: Vector, f_y: Sequence[float]) -> tuple[Vector, Vector]:
        """Return dv/dt (10,) and the vertical accelerations (4,) of the contact points.

        Args:
            f_y: lateral forces (4,) [N] on the contact points, in axes that yaw with the car.
        """
        masses, contacts = np.zeros((15, 10)), np.zeros((12, 10))
        for column, step in enumerate(STEP * np.eye(10)):
            moved = self.places(q + 1j * step)
            masses[:, column], contacts[:, column] = moved[0].imag / STEP, moved[1].imag / STEP
        ahead, here, behind = (self.places(q + s * CURVE * v) for s in (1, 0, -1))
        curving = [(ahead[k] - 2.0 * here[k] + behind[k]) / CURVE**2 for k in (0, 1)]
        spin = self.spin(q)
        turning = self.spin(q + 1j * STEP * v).imag / STEP @ v
        omega = spin @ v
        weight = np.repeat([self.ride.m_s, *self.wheels], 3)
        matrix = masses.T @ (weight[:, None] * masses) + spin.T @ self.inertia @ spin
        force = masses.T @ (weight * (np.tile([0.0, 0.0, -G], 5) - curving[0]))
        force -= spin.T @ (self.inertia @ turning + np.cross(omega, self.inertia @ omega))
        sideways = np.array([-np.sin(q[2]), np.cos(q[2]), 0.0])
        road = np.outer(f_y, sideways)
        road[:, 2] = self.loads(q)
        force += contacts.T @ road.ravel()
        c = q[6:]
        other = c[[1, 0, 3, 2]]
        carried = self.static_loads - self.wheels * G
        force[6:] -= carried + self.springs * c + self.dampers * v[6:] + self.bars * (c - other)
        dv = np.linalg.solve(matrix, force)
        return dv, (contacts @ dv + curving[1])[2::3]

    def at(self, z: float, phi: float, heights: Vector) -> Vector:
        """Return the coordinates at which the contact points have these heights (4,) [m]."""
        q = np.zeros(10)
        q[3], q[4] = z, phi
        for _ in range(30):
            q[6:] += heights - self.places(q)[1][2::3]
        return q


def straight_path_forces(
    ride: Ride, y: Sequence[float], f_y: Sequence[float], *, tilt: bool = True, sideways: float | None = None
) -> tuple[float, Vector]:
    """Return what lines fixed in the body add to equations (3) and (6): Q_phi [N.m] and e_i (4,) [N].

    e_i is less by N_i0 p_i phi - f_yi phi, Q_phi more by the sum of (c_i + y_i phi) (N_i0 p_i - f_yi).

    Args:
        y: coordinates of `cars.ride` and their rates.
        tilt: whether the parts with f_yi, of second order, are counted.
        sideways: the car's lateral acceleration [m/s2], if wheel centres follow the paths of their contact
            points: the links then carry neither the wheels' weight nor what accelerates them.
    """
    z, phi, theta = y[:3]
    t = ride.half_track
    beside = np.array([t, -t, t, -t])
    c = np.array(y[3:7]) - z - beside * phi + np.array([ride.a, ride.a, -ride.b, -ride.b]) * theta
    slopes = np.array([ride.p_f, -ride.p_f, ride.p_r, -ride.p_r])
    loads = np.array([ride.load_f, ride.load_f, ride.load_r, ride.load_r])
    force = np.array(f_y)
    wheels = np.array([ride.m_f, ride.m_f, ride.m_r, ride.m_r])
    linked = loads if sideways is None else loads - wheels * G
    links = linked * slopes * phi
    moment = np.sum(slopes * (linked * c + loads * beside * phi))
    if tilt:
        links -= phi * force
        moment -= np.sum((c + beside * phi) * force)
    if sideways is not None:
        links -= slopes * wheels * sideways
    return float(moment), -links


def follow(
    derivatives: Callable[[float, Vector], Vector], state: Vector, *, until: float, step: float
) -> list[Vector]:
    """Return the states at multiples of `step` [s]; classical Runge-Kutta."""
    states = [state]
    for k in range(round(until / step)):
        t = k * step
        k1 = derivatives(t, state)
        k2 = derivatives(t + 0.5 * step, state + 0.5 * step * k1)
        k3 = derivatives(t + 0.5 * step, state + 0.5 * step * k2)
        k4 = derivatives(t + step, state + step * k3)
        state = state + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        states.append(state)
    return states
