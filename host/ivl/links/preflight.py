"""Checks before a flight: what was found, what is allowed, and what to do about it.

Each check is a function of a vehicle; one that cannot be made because the vehicle lacks what it looks at fails, and
says so. A check never changes what the vehicle does.
"""

import math
from collections.abc import Iterable, Iterator
from itertools import product

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.check import Check
from ivl.experiment import Experiment, Policy
from ivl.links import sil
from ivl.links.packets import Phase
from ivl.links.vehicle import Supervisor, Vehicle

PINGS_MIN, LOST_MAX, P95_S_MAX = 20, 0.15, 0.1
BATTERY_V_MIN, BATTERY_S = 3.7, 2.0
SIGMA_M_MAX, SIGMA_S = 0.1, 10.0
_LINK_S, _PING_S, _PONG_S = 3.0, 0.02, 0.5
_TYPES = {"f4": "<f", "u1": "<B", "u2": "<H", "u4": "<L"}
_CONTROLLER_APP = 6
_CORNER_DIMENSIONS_MAX = 8


def checks(
    vehicle: Vehicle, experiment: Experiment | None = None, battery_V_min: float = BATTERY_V_MIN
) -> Iterator[Check]:
    """Make the checks one by one, those of an experiment's ranges and configuration if it is given.

    Args:
        vehicle: Connected.
        experiment: What is to be flown.
        battery_V_min: Least rest voltage, V; that of the site, if it has one.

    Raises:
        LinkError: The link broke on the way.
        RolloutError: The vehicle refuses the configuration.
    """
    for check in (tables, link, supervisor, controller, bypass, tumble_check):
        yield check(vehicle)
    yield battery(vehicle, battery_V_min)
    for check in (estimator, phase):
        yield check(vehicle)
    if experiment is not None:
        yield policy_range(vehicle, experiment)
        yield configuration(vehicle, experiment)
        if sil.is_sil(vehicle.session):
            yield simulated_world(vehicle, experiment)


def tables(vehicle: Vehicle) -> Check:
    """Every parameter and log variable of the flight core, with the type that this host expects."""
    session = vehicle.session
    params, _ = native.library().layout(native.LAYOUT_CONFIG)
    logs, _ = native.library().layout(native.LAYOUT_LOGS)
    wrong = [n for n, f in params.items() if not session.has_param(n) or session.param_type(n) != _TYPES[f.type]]
    wrong += [n for n, f in logs.items() if not session.has_log(n) or session.log_type(n) != _TYPES[f.type]]
    found = f"{len(wrong)} differ, the first {wrong[0]}" if wrong else "all as expected"
    return Check(
        "tables", not wrong, found, f"{len(params)} parameters and {len(logs)} log variables of this version",
        "flash the firmware of this version (ivl flash), or use the host of that firmware",
    )  # fmt: skip


def link(vehicle: Vehicle) -> Check:
    """A burst of pings, and half a second for the answers."""
    session = vehicle.session
    session.forget_pings()
    usual_s, session.ping_s = session.ping_s, _PING_S
    vehicle.wait_in_wall_time(lambda: session.quality(0.0).sent >= PINGS_MIN, _LINK_S)
    session.ping_s = usual_s
    vehicle.wait_in_wall_time(lambda: session.quality(0.0).lost == 0, _PONG_S)
    quality = session.quality(0.0)
    lost = quality.lost / quality.sent if quality.sent else 1.0
    ok = quality.sent >= PINGS_MIN and lost <= LOST_MAX and quality.p95_s <= P95_S_MAX
    return Check(
        "link", ok, f"{100 * lost:.0f} % of {quality.sent} pings lost, 95 % within {1e3 * quality.p95_s:.1f} ms",
        f"at most {100 * LOST_MAX:.0f} % lost, {1e3 * P95_S_MAX:.0f} ms",
        "bring the antenna nearer, choose another channel, stop other traffic",
    )  # fmt: skip


def supervisor(vehicle: Vehicle) -> Check:
    """State bits."""
    bits = vehicle.supervisor()
    bad = bits & (Supervisor.LOCKED | Supervisor.CRASHED | Supervisor.TUMBLED)
    ok = not bad and bool(bits & (Supervisor.ARMED | Supervisor.CAN_BE_ARMED))
    names = ", ".join(str(bit.name).lower().replace("_", " ") for bit in Supervisor if bit in bits) or "nothing set"
    remedy = "set the vehicle upright and level, wait for its self-test"
    if Supervisor.LOCKED in bits:
        remedy = "switch the vehicle off and on again"
    elif Supervisor.CRASHED in bits:
        remedy = "set it upright; the next flight asks for recovery"
    return Check("supervisor", ok, names, "can be armed; not locked, crashed or tumbled", remedy)


def controller(vehicle: Vehicle) -> Check:
    """The app must have the motors."""
    return _param(vehicle, "stabilizer.controller", _CONTROLLER_APP, "write stabilizer.controller 6, or flash the app")


def bypass(vehicle: Vehicle) -> Check:
    """Nobody may drive the motors past the controller."""
    return _param(vehicle, "motorPowerSet.enable", 0, "write motorPowerSet.enable 0")


def tumble_check(vehicle: Vehicle) -> Check:
    """On, outside of flips."""
    return _param(vehicle, "supervisor.tmblChckEn", 1, "restart the vehicle; if it stays, the app does not run")


def battery(vehicle: Vehicle, least_V: float = BATTERY_V_MIN) -> Check:
    """Rest voltage."""
    vehicle.wait_in_wall_time(lambda: vehicle.battery_V > 0.0, BATTERY_S)
    return Check(
        "battery", vehicle.battery_V >= least_V, f"{vehicle.battery_V:.2f} V", f"{least_V:.2f} V or more",
        "charge or change the battery",
    )  # fmt: skip


def estimator(vehicle: Vehicle) -> Check:
    """Certainty of the position, within a time-out."""
    vehicle.wait_in_wall_time(lambda: vehicle.position_sigma_m <= SIGMA_M_MAX, SIGMA_S)
    sigma_m = vehicle.position_sigma_m
    return Check(
        "estimator", sigma_m <= SIGMA_M_MAX, "unknown" if math.isnan(sigma_m) else f"{1e3 * sigma_m:.1f} mm",
        f"at most {1e3 * SIGMA_M_MAX:.0f} mm within {SIGMA_S:.0f} s",
        "check motion capture: body seen, streamed, stabilizer.estimator 2; write kalman.resetEstimation 1",
    )  # fmt: skip


def phase(vehicle: Vehicle) -> Check:
    """Nobody flies it."""
    resting = vehicle.phase in (Phase.IDLE, Phase.ATTACHED, Phase.DONE, Phase.ABORTED)
    return Check(
        "phase", resting, vehicle.phase.name.lower(), "idle, or a landing that is over",
        "another host flies this vehicle: stop it",
    )  # fmt: skip


def policy_range(vehicle: Vehicle, experiment: Experiment) -> Check:
    """The bounds of the search lie within what the vehicle will accept."""
    del vehicle
    model, policy = experiment.make_world().native_model, experiment.policy
    ok = all(model.accepts(policy.shape.number, policy.shape.to_si(theta)) for theta in _corners(policy))
    spans = zip(policy.shape.params, policy.bounds, strict=True)
    most_Nmm = 1e3 * float(model.config()[0]["ivl.flip_moment_max"][0])
    return Check(
        "policy bounds", ok, ", ".join(f"{p.name} {low:g} .. {high:g}" for p, (low, high) in spans),
        f"accepted by the flight core; moments up to {most_Nmm:g} N mm",
        "change policy.*.bounds of the experiment, or firmware.flip_moment_max",
    )  # fmt: skip


def _corners(policy: Policy) -> Iterable[npt.ArrayLike]:
    """Where a box may stick out: its corners, or as many random ones as can be asked; and where the search begins."""
    yield policy.mu0
    if policy.shape.n <= _CORNER_DIMENSIONS_MAX:
        yield from product(*policy.bounds)
        return
    bounds = np.array(policy.bounds)
    yield from bounds.T
    choices = np.random.default_rng(0).integers(0, 2, (2**_CORNER_DIMENSIONS_MAX, len(bounds)))
    yield from np.where(choices == 0, bounds[:, 0], bounds[:, 1])


def configuration(vehicle: Vehicle, experiment: Experiment) -> Check:
    """The configuration that is in force."""
    _, crc = experiment.make_world().native_model.config()
    vehicle.wait_in_wall_time(lambda: "ivl.cfg_crc" in vehicle.config.values, BATTERY_S)
    found = int(vehicle.config.values.get("ivl.cfg_crc", 0))
    return Check(
        "configuration", found == crc, f"CRC {found:08x}", f"CRC {crc:08x} of {experiment.name}",
        "send it: ivl doctor --send, ivl fly or ivl learn with this experiment",
    )  # fmt: skip


def simulated_world(vehicle: Vehicle, experiment: Experiment) -> Check:
    """What a software vehicle simulates."""
    found = sil.differences(vehicle.session, experiment.make_world())
    return Check(
        "simulated world", not found, f"{len(found)} differ, the first {found[0]}" if found else "as here",
        f"all parameters of {experiment.name}", "start it with: ivl sil --experiment FILE",
    )  # fmt: skip


def _param(vehicle: Vehicle, name: str, wanted: int, remedy: str) -> Check:
    session = vehicle.session
    if not session.has_param(name):
        return Check(name, False, "no such parameter", str(wanted), "flash a firmware that has it")
    value = session.read([name])[name]
    return Check(name, value == wanted, f"{value:g}", str(wanted), remedy)
