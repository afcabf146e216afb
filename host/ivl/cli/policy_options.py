"""Options that say a policy: a file, `--theta` for any form, `--rrev` and `--moment` for the paper's."""

from pathlib import Path
from typing import Annotated

import typer

from ivl import forms
from ivl.errors import ArgumentError, ConfigError
from ivl.policy import file
from ivl.policy.file import PolicyFile

Rrev = Annotated[
    float | None, typer.Option("--rrev", "--rrev-c", help="Trigger threshold RREV_c of the paper's policy, 1/s.")
]
Moment = Annotated[
    float | None, typer.Option(help="Flip moment M_yd of the paper's policy, N mm (magnitude, nose up).")
]
FormName = Annotated[str | None, typer.Option("--form", help="Form of the policy; see `ivl list forms`.")]
FileOption = Annotated[
    Path | None, typer.Option("--policy", metavar="FILE", help="Policy file, as `ivl policy learn` writes one.")
]
Theta = Annotated[
    str | None, typer.Option(metavar="A,B,...", help="Parameters of the policy, in the form's order and units.")
]


def load(path: Path | None, **said: str | float | None) -> PolicyFile | None:
    """The policy of a file, None if none is named.

    Args:
        path: The file.
        **said: Other options that say a policy, by name.

    Raises:
        ConfigError: The file is wrong, or another option says a policy, too.
    """
    if path is None:
        return None
    only("--policy", path, **said)
    return file.load(path)


def only(option: str, path: Path, **others: object) -> None:
    """Refuse options that say what another one says already.

    Raises:
        ConfigError: One of them was given.
    """
    for name, value in others.items():
        if value is not None:
            raise ConfigError(f"{option} {path}: already given by --{name}")


def theta_of(name: str, theta: str | None, rrev: float | None, moment: float | None) -> list[float]:
    """The parameters that the options say.

    Raises:
        ConfigError: They are not those of the form, or a value is out of range.
    """
    try:
        form = forms.by_name(name)
        named = {"--rrev": rrev, "--moment": moment}
        said = [option for option, value in named.items() if value is not None]
        if theta is not None and said:
            raise ConfigError(f"--theta: already given by {said[0]}")
        if theta is None and form.name != forms.PAPER:
            names = ", ".join(form.names)
            raise ConfigError(f"--theta is missing: the form {form.name} has {form.n} parameters ({names})")
        if theta is None:
            missing = [option for option, value in named.items() if value is None]
            if missing:
                raise ConfigError(f"{missing[0]} is missing")
            values = [value for value in named.values() if value is not None]
        else:
            values = [float(text) for text in theta.split(",")]
        form.to_si(values)
    except ArgumentError as error:
        raise ConfigError(f"policy: {error}") from error
    except ValueError as error:
        raise ConfigError(f"--theta {theta}: numbers with commas between them are needed") from error
    return values
