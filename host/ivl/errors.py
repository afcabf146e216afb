"""The one tree of exceptions of this package.

Each message is one line that names the place, the value and what is allowed, so that the command line can print it as
it is.
"""


class IvlError(Exception):
    """Base of every error that this package raises on purpose."""


class ConfigError(IvlError):
    """A file, an option or an override is wrong: unknown key, bad unit, value out of range."""


class NativeError(IvlError):
    """The native library is missing, of another version, or refused a model."""


class RolloutError(IvlError):
    """A rollout could not be flown."""


class ArgumentError(RolloutError, ValueError):
    """A rollout was asked for with an argument that is out of range or of the wrong kind (also a ValueError)."""


class LearnerError(IvlError, ValueError):
    """A learner was told something that its mathematics cannot use (also a ValueError)."""


class StoreError(IvlError):
    """A run folder cannot be created, read, or continued."""


class MissingError(IvlError, ImportError):
    """A package that this use needs is not installed (also an ImportError)."""


class LinkError(IvlError):
    """The link to a vehicle is missing, was lost, or did not do what was asked."""
