from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pydantic import BaseModel, ConfigDict, field_validator, model_validator

from ivl import yamlfile
from ivl.errors import ConfigError


class Sample(BaseModel):
    model_config = ConfigDict(strict=True, extra="forbid")
    size: float
    name: str = "x"

    @field_validator("size")
    @classmethod
    def _positive(cls, size: float) -> float:
        if not size > 0:
            raise ValueError("must be positive")
        return size

    @model_validator(mode="after")
    def _fit(self) -> "Sample":
        if self.name == "tiny" and self.size > 1:
            raise ValueError("size and name do not fit")
        return self


def test_parse_names_line_and_column_when_a_key_is_given_twice() -> None:
    with pytest.raises(ConfigError, match=r"^f\.yaml: line 2, column 1: key 'a' is given twice$"):
        yamlfile.parse("a: 1\na: 2\n", "f.yaml")


@pytest.mark.parametrize("text", ["a: [1", "{", "a: b: c", "\t- x", "[a, b]: 1\n? {x: 1}\n: 2", "!!python/object:x {}"])
def test_parse_refuses_broken_text_with_one_line(text: str) -> None:
    with pytest.raises(ConfigError) as caught:
        yamlfile.parse(text, "f.yaml")
    assert str(caught.value).startswith("f.yaml: ")
    assert "\n" not in str(caught.value)


def test_read_names_the_file_when_it_is_missing(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.yaml: cannot be read"):
        yamlfile.read(tmp_path / "none.yaml")


def test_read_names_the_file_when_it_is_not_text(tmp_path: Path) -> None:
    (tmp_path / "bad.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ConfigError, match=r"bad\.yaml: "):
        yamlfile.read(tmp_path / "bad.yaml")


def test_validate_explains_a_number_in_quotes() -> None:
    data = yamlfile.parse("size: '1e-6'", "f.yaml")
    with pytest.raises(ConfigError, match=r"f\.yaml: size: value '1e-6': .*write the number without them"):
        yamlfile.validate(Sample, data, "f.yaml")


@pytest.mark.parametrize(
    ("data", "message"),
    [
        ({}, "f: size: is missing"),
        ({"size": True}, "f: size: value True: "),
        ({"size": 1.0, "colour": "red"}, "f: colour: unknown key (value 'red')"),
        ([1], "f: expected a mapping of fields, got list"),
        ({"size": "big", "name": 3}, "f: size: value 'big': "),
        ({"size": "big", "name": 3}, "; name: value 3: "),
        ({"colour": "red"}, "f: colour: unknown key (value 'red'); size: is missing"),
        ({"size": 1.0, **dict.fromkeys("abcd")}, "c: unknown key (value None) (and 1 more)"),
        ({"size": 1.0, "colour": "r" * 200}, f"colour: unknown key (value '{'r' * 59}...)"),
        ({"size": -1.0}, "f: size: value -1.0: must be positive"),
        ({"size": 2.0, "name": "tiny"}, "f: size and name do not fit"),
    ],
)
def test_validate_says_what_is_wrong_in_one_line(data: object, message: str) -> None:
    with pytest.raises(ConfigError) as caught:
        yamlfile.validate(Sample, data, "f")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


@given(st.floats(allow_nan=False))
def test_dump_writes_floats_that_read_back_as_the_same_number(value: float) -> None:
    assert yamlfile.parse(yamlfile.dump({"v": value}), "f") == {"v": value}
