"""Sensors: what every channel does, measured, equals what its parameters say."""

from __future__ import annotations

from itertools import pairwise
from math import cos, pi, sin, sqrt
from statistics import correlation, fmean, pstdev

import pytest

from yawbench.components.sensing.channel import Channel, ChannelSpec
from yawbench.components.sensing.cluster_parameters import CHANNELS
from yawbench.components.sensing.noise import key, normal, uniform
from yawbench.components.sensors.ideal import Ideal
from yawbench.components.sensors.poor import POOR, Poor
from yawbench.components.sensors.production import PRODUCTION, Production

from .stand import Stand

OF_WHEELS = ("wheel_speed", "brake_pressure")
every_channel = pytest.mark.parametrize("channel", CHANNELS)


def name_of(channel: str) -> str:
    return f"{channel}_rl" if channel in OF_WHEELS else channel


def received(
    channel: str, true=lambda t: 0.0, *, until: float, h: float = 0.001, sensor=Ideal, **parameters
) -> tuple[list[float], list[float]]:
    """Return the times and values of one channel, whose figures alone are given, from the first step on."""
    own = {f"{channel}_{figure}": value for figure, value in parameters.items()}
    stand = Stand(sensor, **own)
    name = name_of(channel)
    stand.start(**{f"{name}_true": true(0.0)})
    times = [(k + 1) * h for k in range(round(until / h))]
    return times, [stand.step(h, **{f"{name}_true": true(t)})[name] for t in times]


def test_noise_has_the_rms_and_no_mean_and_neighbours_are_strangers():
    _, y = received("yaw_rate", until=8.0, h=0.01, noise=0.02, sample_time=0.01)
    assert pstdev(y) == pytest.approx(0.02, rel=4 / sqrt(2 * len(y)))
    assert abs(fmean(y)) < 4 * 0.02 / sqrt(len(y))
    assert abs(correlation(y[1:], y[:-1])) < 4 / sqrt(len(y))


@every_channel
def test_bias_gain_and_drift_add_up(channel):
    times, y = received(channel, lambda t: 3.0, until=0.1, gain=0.97, bias=-0.2, drift=0.5)
    assert y == pytest.approx([0.97 * 3.0 - 0.2 + 0.5 * t for t in times], rel=1e-12)


@every_channel
@pytest.mark.parametrize("latency", [0.004, 0.0125, 0.03])
def test_a_message_is_held_from_its_arrival_to_the_next(channel, latency):
    times, y = received(channel, lambda t: t, until=0.2, h=0.0005, sample_time=0.01, latency=latency)
    expected = [max((t - latency + 1e-9) // 0.01, 0.0) * 0.01 for t in times]
    assert y == pytest.approx(expected, abs=1e-12)


@every_channel
def test_values_are_whole_steps_and_the_nearest_ones(channel):
    times, y = received(channel, lambda t: 0.37 * t, until=1.0, quantum=0.01)
    assert all(abs(x / 0.01 - round(x / 0.01)) < 1e-9 for x in y)
    assert max(abs(x - 0.37 * t) for t, x in zip(times, y, strict=True)) <= 0.005 + 1e-12
    assert len(set(y)) == 38


@every_channel
def test_values_end_at_the_range(channel):
    _, y = received(channel, lambda t: 5.0 * sin(2 * pi * t), until=1.0, range=2.0)
    assert (min(y), max(y)) == (-2.0, 2.0)


@every_channel
def test_steps_and_range_count_from_the_offset(channel):
    _, y = received(channel, lambda t: 5 * sin(2 * pi * t), until=1.0, quantum=0.01, offset=1.003, range=2.0)
    assert (min(y), max(y)) == pytest.approx((-0.997, 3.003))
    assert all(abs((x - 1.003) / 0.01 - round((x - 1.003) / 0.01)) < 1e-9 for x in y)


@every_channel
@pytest.mark.sampled(6)
@pytest.mark.parametrize(("frequency", "gain"), [(2.1, 1.0), (21.0, 1 / sqrt(2)), (63.0, 1 / sqrt(82))])
def test_the_low_pass_has_minus_3_db_at_its_bandwidth_and_40_db_per_decade(channel, frequency, gain):
    times, y = received(
        channel, lambda t: sin(2 * pi * frequency * t), until=1.0 + 2 / frequency, bandwidth=21.0
    )
    late = [(t, x) for t, x in zip(times, y, strict=True) if t > times[-1] - 2 / frequency + 1e-9]
    turns = [(2 * x * sin(2 * pi * frequency * t), 2 * x * cos(2 * pi * frequency * t)) for t, x in late]
    measured = sqrt(fmean(a for a, _ in turns) ** 2 + fmean(b for _, b in turns) ** 2)
    assert measured == pytest.approx(gain, rel=0.02)


def test_the_seed_makes_other_noise_and_so_does_the_channel_and_the_wheel():
    firsts = {
        tuple(normal(key(seed, channel), k) for k in range(3))
        for seed in (1, 2, 3)
        for channel in ("yaw_rate", "acceleration_x", "wheel_speed_fl", "wheel_speed_fr")
    }
    assert len(firsts) == 12


def test_the_integers_are_those_of_the_reference_implementation_of_splitmix64():
    expected = [0xE220A8397B1DCDAF, 0x6E789E6AA1B965F4, 0x06C45D188009454F]
    assert [int(uniform(0, n) * 2**52) for n in range(3)] == [z >> 12 for z in expected]


@pytest.mark.parametrize("h", [0.0004, 0.002, 0.01, 0.025])
def test_messages_are_the_same_for_any_step(h):
    """Sampled at 10 ms with all there is; the signal is a straight line, which every step describes."""

    def messages(step: float) -> list[float]:
        channel = Channel(ChannelSpec(21.0, 1.01, 0.3, 0.1, 0.5, 40.0, 1e-3, sample_time=0.01), 7, 0.0, 0.0)
        seen = []
        for k in range(round(0.5 / step)):
            channel.advance(k * step, step, 20.0 * (k + 1) * step)
            seen.append(((k + 1) * step, channel.received))
        return [y for t, y in seen if abs(t / 0.05 - round(t / 0.05)) < 1e-6]

    assert messages(h) == messages(0.001)
    assert len(messages(h)) == 10


def test_another_channels_figures_change_nothing():
    _, alone = received("yaw_rate", until=0.2, noise=1.0, sample_time=0.01)
    stand = Stand(
        Ideal, sample_time=0.01, yaw_rate_noise=1.0, wheel_speed_noise=2.0, acceleration_y_latency=0.02
    )
    stand.start()
    assert [stand.step(0.001)["yaw_rate"] for _ in range(200)] == alone


def test_accelerometers_feel_gravity_when_the_body_leans():
    lean = {"roll_angle_true": 0.06, "pitch_angle_true": -0.04}
    true = {"acceleration_x_true": 2.0, "acceleration_y_true": 3.0}
    felt = Stand(Ideal, feels_gravity=True).start(**true, **lean)
    assert felt["acceleration_y"] == pytest.approx(3.0 * cos(0.06) + 9.81 * sin(0.06))
    assert felt["acceleration_x"] == pytest.approx(2.0 * cos(0.04) + 9.81 * sin(0.04))
    on_road = Stand(Ideal, feels_gravity=True).start(**true, **lean, slope_true=-0.04, bank_true=-0.06)
    assert (on_road["acceleration_x"], on_road["acceleration_y"]) == pytest.approx((2.0, 3.0))
    ideal = Stand(Ideal).start(**true, **lean)
    assert (ideal["acceleration_x"], ideal["acceleration_y"]) == (2.0, 3.0)


@pytest.mark.parametrize(("sensor", "given"), [(Production, PRODUCTION), (Poor, POOR)])
def test_a_kind_of_cluster_has_the_figures_of_its_table(sensor, given):
    """Zero in: what comes out is noise, bias and steps of the table, of every channel."""
    stand = Stand(sensor)
    stand.start()
    period = stand["sample_time"]
    rows = [stand.step(period) for _ in range(500)]
    for channel, figures in given.items():
        y = [row[name_of(channel)] for row in rows]
        quantum = figures["quantum"][0]
        noise, bias = (figures.get(name, (0.0,))[0] for name in ("noise", "bias"))
        assert pstdev(y) == pytest.approx(sqrt(noise**2 + (quantum**2 / 12 if noise else 0.0)), rel=0.1)
        assert fmean(y) == pytest.approx(bias, abs=4 * noise / sqrt(len(y)) + quantum / 2)
        assert all(
            abs(a - b) / quantum % 1.0 < 1e-6 or abs(a - b) / quantum % 1.0 > 1 - 1e-6 for a, b in pairwise(y)
        )


def test_noise_without_a_sample_time_is_refused():
    stand = Stand(Ideal, yaw_rate_noise=0.01)
    with pytest.raises(AssertionError, match=r"yaw_rate_noise.* sample_time"):
        stand.start()
