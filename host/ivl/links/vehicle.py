"""A vehicle with the app of this project, over any link: configuration, policy, commands, supervisor, recorder.

Whatever is put in force is confirmed by the vehicle itself before a call returns. Time is that of `clock`; each wait
repeats the present command at the clock's pace, which is the vehicle's proof that its host lives.
"""

import secrets
import struct
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import IntFlag

import numpy as np
import numpy.typing as npt

from ivl import native
from ivl.errors import ArgumentError, LinkError, RolloutError
from ivl.forms import Form
from ivl.links import recorder
from ivl.links.clock import Clock, WallClock
from ivl.links.packets import (
    STATUS_TEXT,
    Packet,
    PacketType,
    Phase,
    Recording,
    Request,
    Status,
    decode,
    encode,
    encode_policy,
    encode_reading,
)
from ivl.links.tables import LogBlock, Session
from ivl.links.trouble import Cause, Trouble, of_rule
from ivl.world import World

UNHEARD_S_MAX = 0.4
"""Vehicle time since the last answered command, from which on it is sent again and again; `host_s_max` is 0.5 s."""
_PORT_SUPERVISOR, _PORT_HL, _PORT_PLATFORM, _APP = 9, 8, 13, 2
_ECHO_S, _CALL_S, _WALL_LOOK_S = 2.0, 0.01, 0.01
_WALL_POLL_S = 0.005
_LOGS_S = 3.0
# what the vehicle refuses although it is in its range
_REMEDY = {"ivl.motor_thrust_max": " of the motors that its image was made for (choose them: `make -C firmware`)"}
_ABORT_S, _DOWN_S, _STOP_LAND_S = 3.0, 60.0, 4.0
_FLYING = (Request.HOVER, Request.APPROACH)
_FLIPPED = (Phase.FLIP, Phase.COAST, Phase.ATTACHED)
_EMERGENCY_STOP = b"\x03"
_ON_ITS_WAY = (Status.INCOMPLETE, Status.CRC)
"""What an echo says while the parts of a policy have not all come."""
_WHOLE_MAX = 4
"""So often a policy is sent as a whole; its checksum is wrong each time if the vehicle's form is another one."""


class Supervisor(IntFlag):
    """Bits that the vehicle's supervisor tells."""

    CAN_BE_ARMED = 1 << 0
    ARMED = 1 << 1
    AUTO_ARM = 1 << 2
    CAN_FLY = 1 << 3
    FLYING = 1 << 4
    TUMBLED = 1 << 5
    LOCKED = 1 << 6
    CRASHED = 1 << 7


class OtherForms(RolloutError):
    """The vehicle does not have the form of a policy as this host has it; no policy of that form can be flown there."""


class PolicyRefused(RolloutError):
    """The vehicle refused a policy for its values; flying it again would not help."""


@dataclass(frozen=True)
class Command:
    """What the vehicle is asked to do, again and again.

    Attributes:
        request: What.
        hover_W_m: Where to hover; used by HOVER.
        speed_mps: Approach speed; used by APPROACH.
        angle_rad: Approach angle above the horizontal; used by APPROACH.
    """

    request: Request
    hover_W_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    speed_mps: float = 0.0
    angle_rad: float = 0.0


@dataclass(frozen=True)
class Snapshot:
    """What the vehicle latched at its last trigger."""

    policy_seq: int
    d_ceil_m: float
    rrev_per_s: float
    of_y_radps: float
    vx_mps: float
    vz_mps: float


class Offer:
    """A policy on its way."""

    def __init__(self, seq: int, form: Form, theta: npt.ArrayLike) -> None:
        """Number it; theta is in the units of the form.

        Raises:
            ArgumentError: theta is not one of the form.
        """
        self.seq, self.form = seq, form.number
        self.crc = form.crc(theta)
        self.n_whole = 0  # times that all parts were sent
        self.form_name = form.name
        self._parts = encode_policy(seq, form, theta)
        self._text = f"policy {form.name}: {form.describe(theta)}"

    def due(self, echo: Packet | None) -> list[bytes]:
        """Packets to send now: all at first, then those that the vehicle says are missing.

        While it says nothing, the last one alone is repeated: the vehicle answers to it.
        """
        if not self.n_whole or (echo is not None and echo["status"] == Status.CRC):
            self.n_whole += 1
            return self._parts
        if echo is None:
            return self._parts[-1:]
        return [part for i, part in enumerate(self._parts) if int(echo["missing"]) >> i & 1]

    def __str__(self) -> str:
        """As people know it."""
        return self._text


class Vehicle:
    """A connected vehicle. `watch`, `state` and `trigger` are its log blocks, running from the start."""

    def __init__(self, session: Session, clock: Clock | None = None) -> None:
        """Start the log blocks; `clock` is the wall clock unless given.

        Raises:
            LinkError: The firmware is another, or the link is gone.
        """
        self.session, self.clock = session, clock or WallClock()
        self.command = Command(Request.IDLE)
        self.abort_reason = ""
        """Why `abort` was called; empty if it was not."""
        self.abort_cause = Cause.TRACKING
        """What the reason means: motion capture, unless whoever asked has said otherwise."""
        self.aborted_by = ""
        """Safety rule by which the vehicle aborted ("none": it was asked to); empty if it has not."""
        self.stopped = ""
        """Why nothing is flown any more over this connection; empty while it may be."""
        self._motors_off = False
        self.has_begun = False
        """Whether this flight has left the floor, or was put into the air."""
        self.spoiled_by = ""
        """Why this flight must not be scored, however it ends; empty if there is no reason."""
        self._has_flipped = False
        self._seq = secrets.randbits(16)
        self._policy_seq = secrets.randbits(31)
        self._offer: Offer | None = None
        self._unheard_s = 0.0
        self._echo: dict[PacketType, Packet] = {}
        self.watch = LogBlock(
            ("ivl.phase", "ivl.rule", "ivl.cause", "ivl.policy_seq", "ivl.trg_seq", "pm.vbat", "supervisor.info"), 20
        )
        self.state = LogBlock(
            ("stateEstimate.x", "stateEstimate.y", "stateEstimate.z", "kalman.varPX", "kalman.varPY", "kalman.varPZ"),
            50,
        )
        self.trigger = LogBlock(
            ("ivl.trg_seq", "ivl.trg_d", "ivl.trg_rrev", "ivl.trg_of_y", "ivl.trg_vx", "ivl.trg_vz"), 50
        )
        self._decision = LogBlock(("ivl.decided", "ivl.p_decided", "ivl.d_decided", "ivl.n_no_go"), 50)
        self._n_no_go = 0
        self.config = LogBlock(("ivl.cfg_seq", "ivl.cfg_status", "ivl.cfg_bad", "ivl.cfg_crc"), 100)
        session.listen(_PORT_PLATFORM, _APP, self._on_app)
        for block in (self.watch, self.state, self.trigger, self._decision, self.config):
            session.start_log(block)
        if not self.wait_in_wall_time(lambda: bool(self.watch.values and self._decision.values), _LOGS_S):
            raise LinkError(f"{session.uri}: no log variables came within {_LOGS_S:g} s")

    def _on_app(self, data: bytes) -> None:
        packet = decode(data)
        if packet is None or (packet.type == PacketType.COMMAND_ECHO and self._is_late(packet)):
            return
        self._echo[packet.type] = packet
        if packet.type == PacketType.COMMAND_ECHO and packet["phase"] in _FLIPPED:
            self._has_flipped = True
        if packet.type == PacketType.COMMAND_ECHO and packet["phase"] == Phase.ABORTED and not self.aborted_by:
            self.aborted_by = native.library().rule_name(int(packet["cause"]))

    def _is_late(self, packet: Packet) -> bool:
        """Whether a later command has been answered before."""
        last = self._echo.get(PacketType.COMMAND_ECHO)
        return last is not None and _is_before(int(packet["seq"]), int(last["seq"]))

    # ---- time

    def pause(self, span_s: float) -> None:
        """Let vehicle time pass, with heartbeats; a vehicle that does not answer them is called more often."""
        left_s = span_s
        while left_s > 0.0:
            seq = self.send_command()
            step_s = min(left_s, self.clock.pace.beat_s, max(UNHEARD_S_MAX - self._unheard_s, _CALL_S))
            self.clock.pause(step_s)
            self._unheard_s = step_s if self._has_heard(seq) else self._unheard_s + step_s
            left_s -= step_s

    def _has_heard(self, seq: int) -> bool:
        echo = self._echo.get(PacketType.COMMAND_ECHO)
        return echo is not None and not _is_before(int(echo["seq"]), seq)

    def wait(self, condition: Callable[[], bool], limit_s: float, what: str, step_s: float | None = None) -> None:
        """Let time pass until a condition holds, which is looked at every `step_s`, or else with each heartbeat.

        Raises:
            Trouble: It did not within `limit_s` of vehicle time; its cause is that of the rule that holds.
            LinkError: The vehicle fell silent.
        """
        end_s = self.clock.now_s() + limit_s
        while not condition():
            if self.clock.now_s() >= end_s:
                raise Trouble(of_rule(self.rule), f"{what}: not within {limit_s:g} s ({self.describe()})")
            self.pause(step_s or self.clock.pace.beat_s)
            if self.session.silence_s > self.session.deadlines.answer_s:
                raise LinkError(f"{self.session.uri}: nothing was heard for {self.session.silence_s:.1f} s")

    def pause_until(self, condition: Callable[[], bool], limit_s: float, step_s: float) -> bool:
        """Let time pass until a condition holds; returns whether it does within `limit_s` of vehicle time."""
        end_s = self.clock.now_s() + limit_s
        while not (found := condition()) and self.clock.now_s() < end_s:
            self.pause(step_s)
        return found

    def wait_in_wall_time(self, condition: Callable[[], bool], limit_s: float) -> bool:
        """Let time pass until a condition holds; returns whether it does after `limit_s` at the latest."""
        end_s = time.monotonic() + limit_s
        while not (found := condition()) and time.monotonic() < end_s:
            self.clock.pause(_WALL_LOOK_S)
            time.sleep(_WALL_POLL_S)
        return found

    # ---- commands

    def send_command(self) -> int:
        """Send the present command once, and a policy that is not confirmed yet; returns the command's number."""
        self._seq = (self._seq + 1) % 0x10000
        c = self.command
        request = Request.ABORT if self.stopped and c.request in _FLYING else c.request
        data = encode(
            PacketType.COMMAND, seq=self._seq, request=request, hover_x_m=c.hover_W_m[0], hover_y_m=c.hover_W_m[1],
            hover_z_m=c.hover_W_m[2], speed_mps=c.speed_mps, angle_rad=c.angle_rad,
        )  # fmt: skip
        self.session.send(_PORT_PLATFORM, _APP, data)
        if self._offer is not None and self._policy_echo(self._offer) is None:
            answer = self._echo.pop(PacketType.POLICY_ECHO, None)
            own = answer if answer is not None and answer["seq"] == self._offer.seq else None
            for part in self._offer.due(own):
                self.session.send(_PORT_PLATFORM, _APP, part)
        return self._seq

    def tell_reading(self, rrev_per_s: float | None, of_y_radps: float | None = None, age_s: float = 0.0) -> None:
        """Tell what a camera saw, as `packets.encode_reading`; the vehicle does not answer."""
        self.session.send(_PORT_PLATFORM, _APP, encode_reading(rrev_per_s, of_y_radps, age_s))

    def begin_flight(self) -> None:
        """Forget how the last flight was aborted, or called off, and a policy that was never confirmed.

        Raises:
            Trouble: It was stopped; a new connection may fly again.
        """
        self.check_stop()
        self.abort_reason = self.aborted_by = self.spoiled_by = ""
        self.abort_cause, self.has_begun, self._has_flipped = Cause.TRACKING, False, False
        self._n_no_go = int(self._decision.values.get("ivl.n_no_go", 0))
        self._offer = None

    def abort(self, reason: str, cause: Cause = Cause.TRACKING) -> None:
        """Ask for an abort, once; before the trigger it is obeyed, later it changes nothing. From any thread."""
        self.abort_reason, self.abort_cause = reason, cause
        self.command = replace(self.command, request=Request.ABORT)
        self.send_command()

    def stop(self, reason: str, motors_off: bool) -> None:
        """From now on HOVER and APPROACH are an abort; to be followed by `send_stop`. From any thread."""
        self.abort_reason, self.abort_cause, self._motors_off = reason, Cause.STOPPED, motors_off
        self.stopped = reason

    def send_stop(self) -> None:
        """Send once what stops the vehicle, whoever controls it; nobody waits for an answer. From any thread."""
        if self._motors_off:
            self.session.send(_PORT_SUPERVISOR, 1, _EMERGENCY_STOP)
        elif self.phase == Phase.IDLE and self.seems_to_fly:
            self.session.send(_PORT_HL, 0, _land(0.0, _STOP_LAND_S))
        self.send_command()

    def check_stop(self) -> bool:
        """Raise Trouble if it was stopped; false if not, so that it can stand before a condition that is waited for."""
        if self.stopped:
            raise Trouble(Cause.STOPPED, self.stopped)
        return False

    def spoil(self, reason: str) -> None:
        """This flight must not be scored, unless its flip has begun; the first reason is kept. From any thread.

        After the flip nothing flies by the cameras any more, and a vehicle that falls may well be lost by them.
        """
        if not self._has_flipped:
            self.spoiled_by = self.spoiled_by or reason

    def come_down(self) -> None:
        """Land where it hovers after a flight that is over: its landing is that of an abort, but it is none.

        Raises:
            RolloutError: It did not come down in time.
            LinkError: The link is gone.
        """
        aborted_by = self.aborted_by
        self.ask_for(Command(Request.ABORT), (Phase.ABORTED,), _ABORT_S)
        self.wait(lambda: self.rule in ("landed", "lost"), _DOWN_S, "landing after a no-go")
        # the planner still has the start point: with IDLE its controller gets the motors back
        self.stop_planner()
        self.ask_for(Command(Request.IDLE), (Phase.IDLE,), _ABORT_S)
        self.aborted_by = aborted_by

    def ask_for(self, command: Command, phases: tuple[Phase, ...], limit_s: float) -> Phase:
        """Put a command in force and wait until the vehicle is in one of the phases.

        Raises:
            RolloutError: The vehicle refuses, or does something else; the message has its rule.
        """
        self.command = command
        first = self.send_command()
        what = f"request {command.request.name}"
        self.wait(lambda: self._has_answered(first, phases), limit_s, what, self.clock.pace.poll_s)
        return self.phase

    def _has_answered(self, first: int, phases: tuple[Phase, ...]) -> bool:
        if self.command.request in _FLYING and self.phase not in phases:
            self.check_stop()
        if not self._has_heard(first):
            return False
        if self._echo[PacketType.COMMAND_ECHO]["status"] == Status.RANGE:
            raise RolloutError(f"request {self.command.request.name}: {STATUS_TEXT[Status.RANGE]}: {self.command}")
        return self.phase in phases

    @property
    def phase(self) -> Phase:
        """Phase that the last answered command led to; from the log before one was answered."""
        echo = self._echo.get(PacketType.COMMAND_ECHO)
        return Phase(int(echo["phase"] if echo is not None else self.watch.values.get("ivl.phase", 0)))

    @property
    def rule(self) -> str:
        """Name of the safety rule that holds, "none" if none does."""
        return self._rule_name("rule")

    @property
    def cause(self) -> str:
        """Name of the safety rule that last ended a phase of this cycle, "none" if none did."""
        return self._rule_name("cause")

    def _rule_name(self, member: str) -> str:
        echo = self._echo.get(PacketType.COMMAND_ECHO)
        code = echo[member] if echo is not None else self.watch.values.get(f"ivl.{member}", 0)
        return native.library().rule_name(int(code))

    def describe(self) -> str:
        """Phase, rule and cause in words."""
        echo = self._echo.get(PacketType.COMMAND_ECHO)
        if echo is None:
            return "no command was answered"
        text = f"phase {Phase(int(echo['phase'])).name}"
        text += f", {STATUS_TEXT[Status(int(echo['status']))]}" if echo["status"] else ""
        text += f", rule {self.rule}" if echo["rule"] else ""
        return text + (f", cause {self.cause}" if echo["cause"] else "")

    # ---- configuration

    def configure(self, world: World) -> int:
        """Write what differs from the world's configuration, put it in force, and return its CRC as confirmed.

        Raises:
            RolloutError: The vehicle refused a value, or has something else in force.
        """
        record, crc = world.native_model.config()
        fields, _ = native.library().layout(native.LAYOUT_CONFIG)
        wanted = {name: record[0][name].item() for name in fields}
        present = self.session.read(wanted)
        self.session.write({name: value for name, value in wanted.items() if not _same(present[name], value)})
        seq = secrets.randbits(31) + 1
        self.session.write({"ivl.commit": seq})
        self.wait(lambda: self._config_answer(seq) is not None, _ECHO_S, "configuration", self.clock.pace.poll_s)
        status, bad, found = self._config_answer(seq) or (Status.PHASE, 255, 0)
        if status != Status.OK:
            name = list(fields)[bad] if bad < len(fields) else ""
            what = f"{name}: value {wanted[name]:g}: " if name else ""
            why = STATUS_TEXT[Status(status)] + _REMEDY.get(name, "")
            raise RolloutError(f"configuration: {what}the vehicle refused it: {why}")
        if found != crc:
            raise RolloutError(f"configuration: the vehicle has CRC {found:08x} in force, not {crc:08x}")
        return crc

    def _config_answer(self, seq: int) -> tuple[int, int, int] | None:
        """Status, refused row and CRC that answer a commit, from the packet or from the log, whichever came through."""
        echo, log = self._echo.get(PacketType.CONFIG_ECHO), self.config.values
        if echo is not None and echo["seq"] == seq:
            return int(echo["status"]), int(echo["bad"]), int(echo["crc"])
        if log.get("ivl.cfg_seq") == seq:
            return int(log["ivl.cfg_status"]), int(log["ivl.cfg_bad"]), int(log["ivl.cfg_crc"])
        return None

    # ---- policy

    def put_policy(self, form: Form, theta: npt.ArrayLike) -> int:
        """`offer_policy`, and then `confirm_policy`."""
        self.offer_policy(form, theta)
        return self.confirm_policy()

    def offer_policy(self, form: Form, theta: npt.ArrayLike) -> None:
        """From now on each command is followed by this policy, until the vehicle has confirmed it.

        Args:
            form: Its form.
            theta: Its parameters in the units of the form, shape (n,).

        Raises:
            PolicyRefused: theta is not one of the form: no vehicle would take it.
        """
        self._policy_seq = self._policy_seq % 0xFFFF_FFFE + 1
        try:
            self._offer = Offer(self._policy_seq, form, theta)
        except ArgumentError as error:
            raise PolicyRefused(f"policy: {error}") from error

    def confirm_policy(self) -> int:
        """The number of the policy on offer, once the vehicle has said that this one is in force.

        Raises:
            PolicyRefused: It is out of the vehicle's range.
            OtherForms: The vehicle does not have its form, or has another one in its place.
            RolloutError: It was not confirmed.
        """
        offer = self._offer
        if offer is None:
            raise ValueError("no policy is on offer")
        self.wait(
            lambda: self._policy_echo(offer) is not None or offer.n_whole > _WHOLE_MAX,
            _ECHO_S, f"confirmation of {offer}", 2 * _CALL_S,
        )  # fmt: skip
        self._offer = None
        echo = self._policy_echo(offer)
        status = Status(int(echo["status"])) if echo else Status.CRC
        if status == Status.RANGE:
            raise PolicyRefused(f"{offer}: the vehicle refused it: {STATUS_TEXT[status]}")
        if status in (Status.FORM, Status.CRC):
            raise OtherForms(
                f"{self.session.uri}: the vehicle does not have the policy form {offer.form_name} of this host "
                f"({STATUS_TEXT[status]}): flash the firmware of this host, or start its software vehicle"
            )
        found = (echo["seq_in_force"], echo["crc_in_force"], echo["form_in_force"]) if echo else ()
        if status != Status.OK or found != (offer.seq, offer.crc, offer.form):
            raise RolloutError(f"{offer}: not in force: {STATUS_TEXT[status]}, the vehicle has {found}")
        return offer.seq

    def _policy_echo(self, offer: "Offer") -> Packet | None:
        echo = self._echo.get(PacketType.POLICY_ECHO)
        is_final = echo is not None and echo["seq"] == offer.seq and echo["status"] not in _ON_ITS_WAY
        return echo if is_final else None

    # ---- supervisor and high-level commander

    def supervisor(self) -> Supervisor:
        """The supervisor's bits, asked for now."""
        answer = self.session.ask(_PORT_SUPERVISOR, 0, b"\x0c", b"\x8c", "state of the supervisor")
        return Supervisor(int.from_bytes(answer[1:3], "little") & 0xFF)

    @property
    def seems_to_fly(self) -> bool:
        """The same as `is_flying`, as the vehicle's log told last, without asking."""
        return Supervisor.FLYING in Supervisor(int(self.watch.values.get("supervisor.info", 0)) & 0xFF)

    def is_flying(self) -> bool:
        """Whether the supervisor believes that it flies."""
        return Supervisor.FLYING in self.supervisor()

    def arm(self, do: bool) -> bool:
        """Arm or disarm; returns whether the vehicle is armed afterwards."""
        answer = self.session.ask(_PORT_SUPERVISOR, 1, bytes((1, do)), b"\x81", "arming" if do else "disarming")
        return len(answer) > 2 and bool(answer[2])

    def recover(self) -> bool:
        """Ask to forget a crash; returns whether it is forgotten (only upright)."""
        answer = self.session.ask(_PORT_SUPERVISOR, 1, b"\x02", b"\x82", "recovery from a crash")
        return len(answer) > 2 and bool(answer[2])

    def take_off(self, height_m: float, duration_s: float) -> None:
        """Climb to a height, by the high-level commander; returns when the vehicle has taken the order."""
        self.has_begun, self._has_flipped = True, False
        self._high_level(struct.pack("<BBff?f", 7, 0, height_m, 0.0, True, duration_s), "take-off")

    def go_to(self, position_W_m: tuple[float, float, float], duration_s: float) -> None:
        """Fly to a point, by the high-level commander."""
        self._high_level(
            struct.pack("<BBBBfffff", 12, 0, 0, 0, *position_W_m, 0.0, duration_s), "go to the start point"
        )

    def land(self, height_m: float, duration_s: float) -> None:
        """Descend, by the high-level commander."""
        self._high_level(_land(height_m, duration_s), "landing")

    def stop_planner(self) -> None:
        """Let the high-level commander ask for nothing any more: on the ground, or it takes off again."""
        data = struct.pack("<BB", 3, 0)
        self.session.ask(_PORT_HL, 0, data, data[:1], "stop of the high-level commander")

    def _high_level(self, data: bytes, what: str) -> None:
        answer = self.session.ask(_PORT_HL, 0, data, data[:1], what)
        error = answer[3] if len(answer) > 3 else 0xFF
        if error != 0:
            raise RolloutError(f"{what}: the vehicle refused it (error {error}; {self.supervisor()!r})")

    # ---- what it tells

    def identity(self) -> str:
        """Which vehicle it is: the number of its processor; empty if it does not tell."""
        names = ("cpu.id0", "cpu.id1", "cpu.id2")
        if not all(self.session.has_param(name) for name in names):
            return ""
        return "".join(f"{int(value):08x}" for value in self.session.read(names).values())

    @property
    def battery_V(self) -> float:
        """Voltage of the battery, NaN if it is not known yet."""
        return float(self.watch.values.get("pm.vbat", float("nan")))

    def hear_battery(self, limit_s: float) -> None:
        """Another battery may be in place: forget the voltage, and wait until the vehicle tells it again.

        Raises:
            Trouble: It did not within `limit_s` of vehicle time.
            LinkError: The vehicle fell silent; a change of battery takes its power.
        """
        self.watch.values.pop("pm.vbat", None)
        self.wait(lambda: self.battery_V > 0.0, limit_s, "the battery's voltage")

    @property
    def position_W_m(self) -> tuple[float, float, float]:
        """Estimated position, NaN if it is not known yet."""
        x, y, z = (float(self.state.values.get(f"stateEstimate.{axis}", float("nan"))) for axis in "xyz")
        return x, y, z

    @property
    def position_sigma_m(self) -> float:
        """Standard deviation of the estimate, of the worst axis; NaN if it is not known yet."""
        names = ("kalman.varPX", "kalman.varPY", "kalman.varPZ")
        return float(np.sqrt(max(self.state.values.get(name, float("nan")) for name in names)))

    def snapshot(self) -> Snapshot:
        """What was latched at the last trigger."""
        names = ("ivl.trg_seq", "ivl.trg_d", "ivl.trg_rrev", "ivl.trg_of_y", "ivl.trg_vx", "ivl.trg_vz")
        seq, *rest = (self.trigger.values.get(name, float("nan")) for name in names)
        return Snapshot(int(seq), *(float(value) for value in rest))

    def decision(self) -> tuple[float, float]:
        """Probability of a landing and sensed distance (m) at which this approach decided go or no-go; NaN before."""
        values = self._decision.values
        if not values.get("ivl.decided", 0):
            return float("nan"), float("nan")
        return float(values["ivl.p_decided"]), float(values["ivl.d_decided"])

    def was_called_off(self) -> bool:
        """Whether its policy has called off an approach of this flight, whatever has become of the level-out since."""
        return int(self._decision.values.get("ivl.n_no_go", 0)) != self._n_no_go

    def recording(self, policy_seq: int) -> Recording:
        """Download the flight recorder of the landing that flew a policy (errors as `recorder.download`)."""
        return recorder.download(self.session, policy_seq)


def _land(height_m: float, duration_s: float) -> bytes:
    """The high-level commander's order to descend."""
    return struct.pack("<BBff?f", 8, 0, height_m, 0.0, True, duration_s)


def _same(present: float, wanted: float) -> bool:
    """Equal in every bit of single precision."""
    return struct.pack("<f", present) == struct.pack("<f", wanted)


def _is_before(seq: int, other: int) -> bool:
    """Order of two numbers of 16 bits that wrap."""
    return (seq - other) % 0x10000 >= 0x8000
