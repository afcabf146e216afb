"""The printable models: closed meshes with the lengths and angles of the gear file, also of a design of our own."""

import importlib.util
import math
import re
from collections import Counter
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

from ivl import model, yamlfile
from ivl.errors import ConfigError

ROOT = Path(__file__).parents[2]
TOOL = ROOT / "tools" / "cad.py"
_SPEC = importlib.util.spec_from_file_location("cad", TOOL)
assert _SPEC is not None
assert _SPEC.loader is not None
cad = importlib.util.module_from_spec(_SPEC)
_SPEC.loader.exec_module(cad)

Mesh = npt.NDArray[np.float64]
OWN = {"length": 0.0613, "angle": 41.3, "stiffness": 0.052, "mass": 5.1e-4, "foot_radius": 0.0027, "hip_xy": 0.0195}


def read_stl(path: Path) -> Mesh:
    """Corners of each triangle, shape (n, 3, 3), mm."""
    found = re.findall(r"vertex\s+(\S+)\s+(\S+)\s+(\S+)", path.read_text())
    return np.array(found, dtype=np.float64).reshape(-1, 3, 3)


def check_closed(mesh: Mesh) -> None:
    """Each edge belongs to two triangles, which run along it in opposite directions; none has no area."""
    corners = [[tuple(corner) for corner in triangle] for triangle in mesh.tolist()]
    edges = Counter((t[i], t[(i + 1) % 3]) for t in corners for i in range(3))
    assert set(edges.values()) == {1}
    assert all((b, a) in edges for a, b in edges)
    assert np.linalg.norm(np.cross(mesh[:, 1] - mesh[:, 0], mesh[:, 2] - mesh[:, 0]), axis=1).min() > 0.0


def volume_mm3(mesh: Mesh) -> float:
    return float(np.einsum("ij,ij->i", mesh[:, 0], np.cross(mesh[:, 1], mesh[:, 2])).sum() / 6.0)


def along_leg(mesh: Mesh, angle_deg: float) -> Mesh:
    """All corners in the leg's own axes, shape (n, 2): across, outward positive; from the hip towards the foot."""
    sin, cos = math.sin(math.radians(angle_deg)), math.cos(math.radians(angle_deg))
    x, y, _ = mesh.reshape(-1, 3).T
    return np.column_stack([x * cos + y * sin, x * sin - y * cos])


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A design of the paper, and one of our own, made as `make cad` makes them."""
    folder = tmp_path_factory.mktemp("cad")
    data = yamlfile.read(model.GEARS_DIR / "table1.yaml")
    for name, value in OWN.items():
        for group in (data["common"]["leg"], data["designs"]["narrow_short"]["leg"]):
            if name in group:
                group[name]["value"] = value
    (folder / "mine.yaml").write_text(yamlfile.dump(data))
    assert cad.main(["--gear", "extra_narrow_long", "--out", str(folder)]) == 0
    assert cad.main(["--gear-set", str(folder / "mine.yaml"), "--gear", "narrow_short", "--out", str(folder)]) == 0
    return folder


CASES = {
    "table1/extra_narrow_long": {"length": 0.1, "angle": 0.0, "stiffness": 0.08, "mass": 8.8e-4, "foot_radius": 0.002,
                                 "hip_xy": 0.017},
    "mine/narrow_short": OWN,
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_a_leg_has_the_length_angle_stiffness_and_mass_of_its_gear(made: Path, name: str) -> None:
    gear, mesh = CASES[name], read_stl(made / f"{name}_leg.stl")
    check_closed(mesh)
    across, down = along_leg(mesh, gear["angle"]).T
    length_mm, foot_mm = 1000 * gear["length"], 1000 * gear["foot_radius"]
    assert down.max() == pytest.approx(length_mm + foot_mm, abs=1e-3)
    foot = down > length_mm - 1e-3
    assert (across[foot].max(), across[foot].min()) == pytest.approx((foot_mm, -foot_mm), abs=1e-3)
    rod = (down > 3.1) & (down < length_mm - foot_mm - 0.5)
    thick_mm = across[rod].max() - across[rod].min()
    width_mm = float(np.ptp(mesh[:, :, 2]))
    assert width_mm == pytest.approx(4.0)
    rod_g = 1.24e-3 * thick_mm * width_mm * length_mm
    assert rod_g == pytest.approx(1000 * gear["mass"], rel=1e-3)
    leaf = np.abs(down) < 3.4
    leaf_mm = 2 * np.abs(across[leaf & (np.abs(across) < 0.8)]).min()
    stiffness = 3000.0 * width_mm * leaf_mm**3 / (12 * 6.4) / 1000.0
    assert stiffness == pytest.approx(gear["stiffness"], rel=0.01)


@pytest.mark.parametrize("name", CASES)
def test_a_jig_holds_hips_and_feet_where_the_gear_has_them(made: Path, name: str) -> None:
    gear, mesh = CASES[name], read_stl(made / f"{name}_jig.stl")
    check_closed(mesh)
    length_mm, angle = 1000 * gear["length"], math.radians(gear["angle"])
    x, y, z = mesh.reshape(-1, 3).T
    assert z.min() == 0.0
    assert z.max() == pytest.approx(length_mm * math.cos(angle), abs=1e-3)
    out_mm = 1000 * gear["hip_xy"] + length_mm * math.sin(angle) / math.sqrt(2.0)
    radius_mm = 1000 * gear["foot_radius"] + 0.25
    for i, j in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
        away_mm = np.hypot(x - i * out_mm, y - j * out_mm)
        rim = away_mm < radius_mm + 0.01
        assert rim.sum() >= 48
        assert away_mm[rim] == pytest.approx(np.full(rim.sum(), radius_mm), abs=1e-3)
    assert volume_mm3(mesh) > 0.0


def test_a_mesh_with_a_hole_is_found_out(made: Path) -> None:
    mesh = read_stl(made / "mine/narrow_short_leg.stl")
    with pytest.raises(AssertionError):
        check_closed(mesh[1:])
    with pytest.raises(AssertionError):
        check_closed(np.concatenate([mesh[:1, ::-1], mesh[1:]]))


def test_a_model_that_is_refused_is_said(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"leg\.scad with .*modulus_MPa=nonsense"):
        cad.main(["--gear", "wide_short", "--set", "modulus_MPa=nonsense", "--out", str(tmp_path)])
    assert not list(tmp_path.rglob("*.stl"))
