"""Datagrams of any kind, as released and under sanitizers, and a short run of the fuzzer."""

import os
import random
import re
import subprocess
from pathlib import Path

import pytest

from ivl import silproc
from ivl.silproc import SilProcess

ROOT = Path(__file__).parents[2]


@pytest.fixture(params=["release", "san"])
def tough(request, world, monkeypatch):
    """The program as released, and with the sanitizers, which end it at the first error."""
    if request.param == "san":
        program = ROOT / "build" / "san" / "ivl_sil"
        assert program.is_file(), "run `make test-sil`, which builds it"
        monkeypatch.setenv(silproc.SERVER_ENV, str(program))
    with SilProcess(world, speed=None) as process:
        yield process


def test_datagrams_of_any_kind_change_nothing_for_a_client(tough, Raw):
    rng = random.Random(4)
    with Raw(tough.uri) as client:
        client.connect()
        for size in (0, 32, 33, 100, 1400, 60000):
            client.send(bytes(size))
        for i in range(3000):
            client.send(rng.randbytes(rng.choice((1, 2, 3, 5, 8, 15, 17, 30, 31, 32, 64))))
            if i % 40 == 0:
                client.ask("fc00")  # not faster than they are read
        tough.set("sil.lockstep", 0)
        for name in ("loss", "delay_ms", "jitter_ms", "reorder", "duplicate", "freeze_ms", "cut_ms"):
            tough.set(f"fault.{name}", 0)
        tough.set("sil.speed_factor", 0)
        client.connect()
        assert tough.get("sil.n_bad") > 500


def test_server_answers_on_after_every_length_of_every_packet(tough, Raw):
    with Raw(tough.uri) as client:
        client.connect()
        for port in range(16):
            for channel in range(4):
                for size in range(31):
                    client.send(bytes([port << 4 | channel]) + bytes([size % 14]) * size)
            # all that came of it is read before the next
            client.send(b"\xfcend" + bytes([port]))
            while client.receive() != b"\xfcend" + bytes([port]):
                pass
        client.connect()


def test_noise_on_the_control_channel_is_answered_with_an_error(tough):
    rng = random.Random(9)
    for _ in range(300):
        line = rng.randbytes(rng.randrange(1, 200)).decode("latin1")
        with pytest.raises((silproc.LinkError, UnicodeEncodeError)):
            tough.get(line)
    assert tough.get("sil.n_bad") == 0


@pytest.fixture
def fuzz(tmp_path, world):
    """Runs the fuzzer on the corpus; returns what it says."""
    program = ROOT / "build" / "fuzz" / "fuzz_crtp"
    assert program.is_file(), "run `make test-sil`, which builds it"
    (tmp_path / "model.txt").write_text(silproc.model_text(world), encoding="ascii")
    (tmp_path / "new").mkdir()
    corpus = ROOT / "tests" / "fuzz" / "corpus"
    assert len(list(corpus.iterdir())) > 50

    def run(*options: str) -> str:
        result = subprocess.run(
            [str(program), *options, f"-artifact_prefix={tmp_path}/", str(tmp_path / "new"), str(corpus)],
            env={**os.environ, "IVL_FUZZ_MODEL": str(tmp_path / "model.txt")},
            capture_output=True,
            text=True,
            check=False,
        )
        assert result.returncode == 0, result.stderr[-3000:]
        return result.stderr

    return run


def test_the_fuzzer_finds_nothing_in_a_few_seconds(fuzz):
    assert "Done 12000 runs" in fuzz("-runs=12000", "-max_len=400", "-seed=1")


def test_an_input_of_the_fuzzer_meets_a_vehicle_that_no_other_has_touched(fuzz):
    # else the answers would depend on the order of the inputs
    answers = {
        re.search(r"answers ([0-9a-f]{16})", fuzz("-runs=0", "-prefer_small=0", f"-seed={seed}"))[1]
        for seed in (1, 2, 3)
    }
    assert len(answers) == 1
