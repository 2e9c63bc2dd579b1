"""Yaw-moment allocation that releases the driver's brakes on one side before it brakes the other.

    D_i < 0   the driver's brake force on wheel i, equal left and right, in fixed shares front and rear
    released  F_i = (1 - s) D_i   on the side whose brake force opposes M,
              s = min(|M| / sum(|D_i arm_i|), release_limit)
    braked    the rest of M shared among the wheels of the other side, in the shares of the driver's force

A braking car thus gets its moment by braking less: wheels that already slide, as those of the slippery side
on split friction, could not give it by braking more. 1 - `release_limit` is the share of the released side's
brake force that the driver always keeps. Without driver braking all of M comes from braking one side. Wheels
whose arm is below an eighth of the track do not take part.

Source: chosen: the principle of the yaw-moment delay in anti-lock brakes on split friction, with a
controller's moment in place of a fixed delay.
"""

from dataclasses import dataclass

from yawbench.vocabulary.wheels import Four

from ..cars.published_cars import PaperC
from ..cars.wheel_kinematics import lever_arms
from ..control_laws.allocator import Allocator, DriveParameters
from ..control_laws.moment_sharing import NO_FORCE, add_drive_force, share_moment
from ..fmi.variables import like, parameter


@dataclass(frozen=True)
class ReleasingParameters:
    """Geometry of the car, limit of the release, and distribution of the driver's force."""

    cg_to_front_axle: float = like(PaperC, "cg_to_front_axle")
    track_width: float = like(PaperC, "track_width")
    release_limit: float = parameter(
        0.8,
        "1",
        "Largest share of the driver's brake force that is released on one side",
        "chosen: the driver always brakes",
        minimum=0.0,
        maximum=1.0,
    )
    drive_front_share: float = like(DriveParameters, "drive_front_share", 0.67, "chosen: brakes, two to one")


def release_and_brake(
    moment: float,
    drive: float,
    *,
    delta: float,
    front_share: float,
    limit: float,
    a: float,
    half_track: float,
) -> Four:
    """Return the longitudinal forces [N] of fl, fr, rl, rr.

    Args:
        moment, drive: yaw moment [N.m] and sum of the driver's forces [N], negative when braking.
        delta: steer angle [rad].
        front_share: share of `drive` on the front axle [1].
        limit: largest share of a wheel's brake force that is released [1].
        a, half_track: distances of front axle and wheels from the centre of mass [m].
    """
    pedal = add_drive_force(NO_FORCE, drive, front_share)
    if moment == 0.0:
        return pedal
    arms = lever_arms(delta, a, half_track)
    least_arm = 0.25 * half_track
    turns = [arm * moment > 0.0 and abs(arm) >= least_arm for arm in arms]  # driving this wheel gives M
    holding = [max(-force * abs(arm), 0.0) * t for force, arm, t in zip(pedal, arms, turns, strict=True)]
    against = (holding[0] + holding[1]) + (holding[2] + holding[3])
    share = min(abs(moment), limit * against) / against if against > 0.0 else 0.0
    rest = moment - share * against * (1.0 if moment > 0.0 else -1.0)
    front = 0.5 * front_share
    fl, fr, rl, rr = (
        0.0 if turning or abs(arm) < least_arm else weight
        for turning, arm, weight in zip(turns, arms, (front, front, 0.5 - front, 0.5 - front), strict=True)
    )
    braked = share_moment(rest, (fl, fr, rl, rr), arms, least_arm)
    y_fl, y_fr, y_rl, y_rr = (
        force * (1.0 - share) + more if turning and force < 0.0 else force + more
        for force, more, turning in zip(pedal, braked, turns, strict=True)
    )
    return y_fl, y_fr, y_rl, y_rr


class Releasing(Allocator):
    """Yaw-moment allocation by releasing the driver's brakes on one side, then braking the other."""

    Parameters = ReleasingParameters

    def output(self, t: float, u: list[float]) -> Four:
        p = self.p
        moment, drive, delta = u
        return release_and_brake(
            moment,
            drive,
            delta=delta,
            front_share=p.drive_front_share,
            limit=p.release_limit,
            a=p.cg_to_front_axle,
            half_track=self.half_track,
        )
