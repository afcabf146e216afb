"""What a motion-capture file says; every number has its unit in its name, and a range."""

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ivl import yamlfile
from ivl.errors import ConfigError

CONFIGS_DIR = Path(__file__).parent
SYSTEMS_WITH_HOST = ("vicon", "optitrack", "qualisys", "vrpn")

Number = Annotated[float, Field(allow_inf_nan=False)]


class MocapConfig(BaseModel):
    """A tracking system, the body that is the vehicle, and when its pose is believed."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True)

    doc: str = ""
    system: Literal["vicon", "optitrack", "qualisys", "vrpn", "mock", "simulator"]
    host: str = Field(default="", description="computer of the tracking system")
    options: dict[str, str] = Field(default_factory=dict, description="passed on to the system's client as they are")
    body: str = Field(min_length=1, description="name of the rigid body that is the vehicle")
    up: Literal["z", "y"] = Field(default="z", description="axis of the tracking system that points up")

    send_hz: Number = Field(default=100.0, ge=1, le=200, description="poses sent to the vehicle, at most")
    rate_hz_min: Number = Field(default=80.0, ge=1, le=1000, description="slower is not good enough to fly")
    jitter_ms_max: Number = Field(default=25.0, ge=1, le=1000, description="99 % of the intervals stay below")
    connect_s: Number = Field(default=10.0, ge=0.1, le=120, description="until the first frame")
    restart_s: Number = Field(default=5.0, ge=0.2, le=120, description="silent for so long: connect anew")

    lost_s: Number = Field(default=0.1, ge=0.02, le=1, description="without a pose for so long: lost")
    frozen_s: Number | None = Field(
        default=0.1, ge=0.02, le=1, description="the same pose for so long: frozen; null: not looked for"
    )
    settle_s: Number = Field(default=0.2, gt=0, le=5, description="poses agree for so long after a loss: good again")
    speed_mps_max: Number = Field(default=10.0, ge=0.5, le=50, description="faster is a jump")
    rate_radps_max: Number = Field(default=60.0, ge=1, le=200, description="faster is a jump")
    accel_mps2_max: Number = Field(default=20.0, ge=1, le=200, description="what motors and gravity can do, at most")
    angular_accel_radps2_max: Number = Field(default=500.0, ge=10, le=5000, description="what motors can do, at most")

    position_sigma_m: Number = Field(default=0.01, ge=1e-4, le=1, description="told to the vehicle's estimator")
    attitude_sigma_rad: Number = Field(default=0.03, ge=1e-4, le=1, description="told to the vehicle's estimator")

    @model_validator(mode="after")
    def _has_host(self) -> Self:
        if (self.system in SYSTEMS_WITH_HOST) != bool(self.host):
            needs = "needs a host" if self.system in SYSTEMS_WITH_HOST else "has no host"
            raise ValueError(f"system {self.system} {needs} (host: value {self.host!r})")
        return self

    @model_validator(mode="after")
    def _tells_jumps(self) -> Self:
        if not self.settle_s > self.lost_s:
            raise ValueError(
                f"settle_s {self.settle_s:g} must be above lost_s {self.lost_s:g}: a jump would be followed untold"
            )
        return self

    def vehicle_params(self) -> dict[str, float]:
        """Parameters of the stock firmware that make it follow external poses."""
        return {
            "stabilizer.estimator": 2,
            "locSrv.extPosStdDev": self.position_sigma_m,
            "locSrv.extQuatStdDev": self.attitude_sigma_rad,
        }


def list_configs() -> list[str]:
    """Examples that ship with the package, by name."""
    return sorted(path.stem for path in CONFIGS_DIR.glob("*.yaml"))


def load(path: str) -> MocapConfig:
    """Read and check a file, or an example by its name; a lab file may hold it under the key `mocap`.

    Raises:
        ConfigError: One line naming file, field and value.
    """
    file = Path(path) if Path(path).is_file() else CONFIGS_DIR / f"{path}.yaml"
    if not file.is_file():
        raise ConfigError(f"--config {path}: no such file, and no such example (examples: {', '.join(list_configs())})")
    data = yamlfile.read(file)
    if isinstance(data, dict) and isinstance(data.get("mocap"), dict):
        data = data["mocap"]
    return yamlfile.validate(MocapConfig, data, file.name)
