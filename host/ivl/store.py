"""The run folder: everything a run did, safe against `kill -9` and power loss at any moment.

    config.yaml     the resolved experiment
    manifest.json   schema version, seed, trials, hashes of model and library, versions, units
    run.sqlite      rollouts, episodes, learner states, what the columns of policy and reward mean, and seals: digests
                    of finished episodes and learner states, so that a damaged number is found and not read
    files/          copies of the files that the configuration names
    earlier.npz     flights of earlier runs that the learner was told first, if any

SQLite in WAL mode with synchronous=FULL: a commit is on the disk when it returns, and a transaction is there whole or
not at all. An episode passes three commits: *planned* (policies and the learners' states after `ask`), *scored* (each
portion of outcomes as it comes), *told* (episode rows and the learners' states after `tell`). What is between two
commits is repeated on resume with the same random numbers, so a continued run equals an uninterrupted one bit for
bit. SQLite stores float64 exactly, but for the sign of a zero; NaN is stored as NULL.
"""

import errno
import fcntl
import getpass
import hashlib
import json
import math
import os
import shutil
import sqlite3
import tempfile
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import numpy.typing as npt

import ivl
from ivl import files, references
from ivl.errors import IvlError, StoreError
from ivl.layout import Layout
from ivl.learning.recorder import DISCARDED, PLANNED, SCORED, Amendment, EpisodeRow, RolloutRows
from ivl.outcome import Outcomes
from ivl.quantity import Quantity
from ivl.rewards.base import TOTAL, Terms

SCHEMA_VERSION = 4
EARLIER_FILE = "earlier.npz"

_ROLLOUT_KEY = "trial INTEGER, episode INTEGER, idx INTEGER"
_SEARCH = ("mu", "sigma", "recommended")
_OF_LEARNER = -1
"""Number in the table of seals, in place of an episode's, of the seal of a learner's state."""
_SNAPSHOT_TRIES = 20
_SQLITE_ADVICE = {
    sqlite3.SQLITE_FULL: "make room there",
    sqlite3.SQLITE_IOERR: "look at the disk, and whether it is full",
    sqlite3.SQLITE_READONLY: "the folder cannot be written",
    sqlite3.SQLITE_CANTOPEN: "look at the permissions of the folder, and whether the disk is full",
    sqlite3.SQLITE_CORRUPT: "the file is damaged",
    sqlite3.SQLITE_NOTADB: "the file is damaged",
}
_EPISODE_FIGURES = {
    "reward_mean": "REAL",
    "rate_four_leg": "REAL",
    "rate_clean": "REAL",
    "stopped": "INTEGER",
    "insight": "TEXT",
}


class RunStore:
    """One run folder, open for writing by this process alone, or for reading beside others.

    As the recorder of a run it may be killed at any moment. A reader changes nothing in the folder, needs no lock and
    no permission to write, and keeps nobody out.

    Attributes:
        folder: The run folder.
        layout: What its columns of policies and rewards are.
    """

    layout: Layout

    def __init__(self, folder: Path, outcome_dtype: np.dtype[np.void], db: sqlite3.Connection, held: ExitStack) -> None:
        """Use `create`, `open_existing` or `open_reading`; `held` is what to give back at the end."""
        self.folder = folder
        self._outcome_dtype = outcome_dtype
        self._outcome_columns = _outcome_columns(outcome_dtype)
        self._db, self._held = db, held

    @classmethod
    def _writing(cls, folder: Path, outcome_dtype: np.dtype[np.void], mode: str) -> "RunStore":
        """Take the lock and open the database; `mode` is SQLite's: `rwc` makes one, `rw` does not."""
        with ExitStack() as held:
            held.callback(os.close, lock_folder(folder))
            if mode == "rwc":
                _clear_unfinished(folder)
            db = _connect(folder, folder / "run.sqlite", f"mode={mode}")
            held.callback(db.close)
            with _explained(folder):
                db.execute("PRAGMA journal_mode=WAL")
                db.execute("PRAGMA synchronous=FULL")
            return cls(folder, outcome_dtype, db, held.pop_all())

    @classmethod
    def create(
        cls,
        folder: Path,
        config_yaml: str,
        manifest: Mapping[str, Any],
        outcome_dtype: np.dtype[np.void],
        layout: Layout,
        copies: Mapping[str, bytes] | None = None,
    ) -> "RunStore":
        """Make a new run folder; `copies` are the files that the configuration names (`ivl.references.pack`).

        The manifest is written last: a folder without one is a creation that was cut off, and is started over.

        Raises:
            StoreError: The folder holds a run already, holds something else, or cannot be written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
            with ExitStack() as undo:
                store = cls._writing(folder, outcome_dtype, "rwc")
                undo.callback(store.close)
                store.layout = layout
                with store._transaction():
                    store._create_tables()
                references.save(copies or {}, folder)
                files.write(folder / "config.yaml", config_yaml)
                write_json(folder / "manifest.json", manifest)
                undo.pop_all()
        except OSError as error:
            raise StoreError(f"{folder}: cannot be written: {files.reason(error)}") from error
        return store

    @classmethod
    def open_existing(cls, folder: Path, outcome_dtype: np.dtype[np.void]) -> "RunStore":
        """Open a run folder to continue it.

        Raises:
            StoreError: There is no run, it is of another schema version, or another process has it open.
        """
        check_version(folder, read_manifest(folder), SCHEMA_VERSION)
        return cls._writing(folder, outcome_dtype, "rw")._checked()

    @classmethod
    def open_reading(cls, folder: Path, outcome_dtype: np.dtype[np.void]) -> "RunStore":
        """Open a run folder to read what is committed at this moment, whoever else reads or writes there.

        Raises:
            StoreError: There is no run, it is of another schema version, or cannot be read.
        """
        check_version(folder, read_manifest(folder), SCHEMA_VERSION)
        with ExitStack() as held:
            try:
                path, options = _snapshot(folder, held)
            except OSError as error:
                raise StoreError(f"{folder / 'run.sqlite'}: cannot be read: {files.reason(error)}") from error
            db = _connect(folder, path, options)
            held.callback(db.close)
            return cls(folder, outcome_dtype, db, held.pop_all())._checked()

    def _checked(self) -> "RunStore":
        with ExitStack() as undo, _explained(self.folder):
            undo.callback(self.close)
            known = [row[1] for row in self._db.execute("PRAGMA table_info(rollout)")]
            if not known or [c for c in known if c.startswith("out_")] != list(self._outcome_columns):
                raise StoreError(f"{self.folder}: run.sqlite has other columns than the outcomes of this version")
            self.layout = self._read_layout()
            self._check_seals()
            undo.pop_all()
        return self

    def close(self) -> None:
        """Close the database and release the folder."""
        self._held.close()

    def __enter__(self) -> "RunStore":
        """The store itself."""
        return self

    def __exit__(self, *_: object) -> None:
        """Close."""
        self.close()

    def plan(
        self,
        episode: int,
        trials: Sequence[int],
        stream: npt.NDArray[np.uint64],
        theta: Sequence[npt.NDArray[np.float64]],
        states: Iterable[Mapping[str, Any]],
    ) -> None:
        """Commit the policies of one episode, before any is flown, with the learners' states after `ask`."""
        rows = [
            (trial, episode, idx, int(stream[idx]), PLANNED, *policy)
            for trial, policies in zip(trials, theta, strict=True)
            for idx, policy in enumerate(policies.tolist())
        ]
        names = ("trial", "episode", "idx", "stream", "status", *self.layout.policy_columns())
        with self._transaction():
            self._db.executemany(f"INSERT INTO rollout({', '.join(names)}) VALUES({_marks(names)})", rows)
            self._save_states(trials, states)

    def score(
        self,
        episode: int,
        trial: npt.NDArray[np.int64],
        idx: npt.NDArray[np.int64],
        outcomes: Outcomes,
        terms: Terms,
        discarded: str = "",
        recordings: npt.NDArray[np.float64] | None = None,
    ) -> None:
        """Commit the outcomes of some planned rollouts.

        Raises:
            StoreError: One of them was not planned, or is scored already; then none is committed.
        """
        rewards = self._reward_columns()
        names = ("status", "discarded", "recording", *rewards.values(), *self._outcome_columns)
        update = (
            f"UPDATE rollout SET {', '.join(f'{name}=?' for name in names)} "
            f"WHERE trial=? AND episode=? AND idx=? AND status='{PLANNED}'"
        )
        status = DISCARDED if discarded else SCORED
        columns = [terms[name].tolist() for name in rewards]
        columns += self._flatten(outcomes)
        texts = [None] * len(trial) if recordings is None else [_recording_text(row) for row in recordings]
        rows = [
            (status, discarded, text, *map(_to_sql, values), of_trial, episode, place)
            for text, values, of_trial, place in zip(
                texts, zip(*columns, strict=True), trial.tolist(), idx.tolist(), strict=True
            )
        ]
        with self._transaction():
            changed = self._db.executemany(update, rows).rowcount
            if changed != len(rows):
                raise StoreError(
                    f"{self.folder}: {len(rows) - changed} of {len(rows)} scored rollouts were not planned"
                )

    def fly_instead(
        self,
        episode: int,
        trial: npt.NDArray[np.int64],
        idx: npt.NDArray[np.int64],
        theta: npt.NDArray[np.float64],
    ) -> None:
        """Commit other policies in place of planned ones, and keep what was planned.

        Raises:
            StoreError: One of them was not planned, or is scored already; then none is committed.
        """
        names = self.layout.policy_columns()
        key = "trial=? AND episode=? AND idx=?"
        with self._transaction():
            for of_trial, place, policy in zip(trial.tolist(), idx.tolist(), theta.tolist(), strict=True):
                at = (of_trial, episode, place)
                query = f"SELECT {', '.join(names)} FROM rollout WHERE {key} AND status='{PLANNED}'"
                before = self._db.execute(query, at).fetchone()
                if before is None:
                    raise StoreError(f"{self.folder}: a rollout that is flown with another policy was not planned")
                self._db.execute(f"UPDATE rollout SET {', '.join(f'{n}=?' for n in names)} WHERE {key}", (*policy, *at))
                said = [dict(zip(names, values, strict=True)) for values in (before, policy)]
                why = "another policy was flown instead"
                self._keep(Amendment(of_trial, episode, place, _utc(), getpass.getuser(), why, said[0], said[1]))

    def amend(
        self,
        row: RolloutRows,
        discarded: str,
        made: Amendment,
        tell_again: Callable[[], tuple[Sequence[EpisodeRow], Mapping[str, Any]]],
    ) -> None:
        """Commit an outcome in place of another one, keep what was there, and commit what is learned then; all or none.

        Args:
            row: The rollout as it is now.
            discarded: Why it does not count; empty: it does.
            made: What is kept of the change.
            tell_again: Called when the outcome can be read; gives all finished episodes of the trial anew, and its
                learner's state.

        Raises:
            StoreError: There is no such rollout.
        """
        rewards = self._reward_columns()
        names = ("status", "discarded", *rewards.values(), *self._outcome_columns)
        terms = row.terms | {TOTAL: row.reward}
        values = [str(row.status[0]), discarded, *(_to_sql(float(terms[name][0])) for name in rewards)]
        values += [_to_sql(column[0]) for column in self._flatten(row.outcomes)]
        at = (made.trial, made.episode, made.idx)
        with self._transaction():
            query = f"UPDATE rollout SET {', '.join(f'{n}=?' for n in names)} WHERE trial=? AND episode=? AND idx=?"
            if self._db.execute(query, (*values, *at)).rowcount != 1:
                raise StoreError(f"{self.folder}: there is no rollout {at}")
            self._keep(made)
            episodes, state = tell_again()
            for episode in episodes:
                self._db.execute("DELETE FROM episode WHERE trial=? AND episode=?", (episode.trial, episode.episode))
            self._insert_episodes(episodes)
            self._save_states([made.trial], [state])

    def amendments(self) -> list[Amendment]:
        """All changes that people made, the earliest first."""
        with _explained(self.folder):
            if not self._db.execute("SELECT 1 FROM sqlite_master WHERE name='amendment'").fetchone():
                return []
            rows = self._db.execute("SELECT * FROM amendment ORDER BY rowid").fetchall()
            return [
                Amendment(trial, episode, idx, utc, who, why, json.loads(before), json.loads(after))
                for trial, episode, idx, utc, who, why, before, after in rows
            ]

    def _keep(self, made: Amendment) -> None:
        """A row of the table of amendments, which only a run has in which somebody changed something."""
        self._db.execute(
            f"CREATE TABLE IF NOT EXISTS amendment({_ROLLOUT_KEY}, utc TEXT NOT NULL, who TEXT NOT NULL, "
            "why TEXT NOT NULL, before TEXT NOT NULL, after TEXT NOT NULL)"
        )
        said = (json.dumps(said, allow_nan=False) for said in (made.before, made.after))
        values = (made.trial, made.episode, made.idx, made.utc, made.who, made.why, *said)
        self._db.execute("INSERT INTO amendment VALUES(?,?,?,?,?,?,?,?)", values)

    def finish_episode(self, rows: Sequence[EpisodeRow], states: Iterable[Mapping[str, Any]]) -> None:
        """Commit one episode of some trials: its figures and the learners' states after `tell`, in one transaction."""
        with self._transaction():
            self._insert_episodes(rows)
            self._save_states([r.trial for r in rows], states)

    def _insert_episodes(self, rows: Sequence[EpisodeRow]) -> None:
        """Rows of the table of episodes, with their seals."""
        marks = _marks(("trial", "episode", *self._figures()))
        self._db.executemany(f"INSERT INTO episode VALUES({marks})", [self._episode_values(row) for row in rows])
        self._seal((row.trial, row.episode, self._digest(row.trial, row.episode)) for row in rows)

    @staticmethod
    def _episode_values(row: EpisodeRow) -> tuple[Any, ...]:
        """A row of the table of episodes."""
        figures = map(_to_sql, (row.reward_mean, row.rate_four_leg, row.rate_clean))
        said = (*row.mu, *row.sigma, *row.recommended, *figures, int(row.stopped), _insight_text(row))
        return (row.trial, row.episode, row.n_scored, *said)

    def learner_states(self) -> dict[int, dict[str, Any]]:
        """The last saved state of each trial's learner."""
        with _explained(self.folder):
            return {trial: json.loads(text) for trial, text in self._db.execute("SELECT trial, state FROM learner")}

    def episodes(self) -> list[EpisodeRow]:
        """All finished episodes, ordered by (trial, episode)."""
        query = f"SELECT trial, episode, {', '.join(self._figures())} FROM episode ORDER BY trial, episode"
        with _explained(self.folder):
            return [_episode_row(row, len(self.layout.policy)) for row in self._db.execute(query)]

    def rollouts(self, trial: int | None = None, episode: int | None = None) -> RolloutRows:
        """Rollouts of one trial or all, of one episode or all."""
        names = ["trial", "episode", "idx", "stream", "status", "recording", *self.layout.policy_columns()]
        names += [*self._reward_columns().values(), *self._outcome_columns]
        query = f"SELECT {', '.join(names)} FROM rollout"
        wanted = {"trial": trial, "episode": episode}
        given = {name: value for name, value in wanted.items() if value is not None}
        if given:
            query += " WHERE " + " AND ".join(f"{name}=?" for name in given)
        with _explained(self.folder):
            rows = self._db.execute(query + " ORDER BY trial, episode, idx", tuple(given.values())).fetchall()
            columns = zip(*rows, strict=True) if rows else ((),) * len(names)
            return self._rollout_rows(dict(zip(names, columns, strict=True)), len(rows))

    def _rollout_rows(self, column: Mapping[str, Sequence[Any]], n: int) -> RolloutRows:
        rewards = {
            name: np.array([_from_sql(x) for x in column[sql]], dtype=np.float64)
            for name, sql in self._reward_columns().items()
        }
        policies = [column[name] for name in self.layout.policy_columns()]
        return RolloutRows(
            trial=np.array(column["trial"], dtype=np.int64),
            episode=np.array(column["episode"], dtype=np.int64),
            idx=np.array(column["idx"], dtype=np.int64),
            stream=np.array(column["stream"], dtype=np.uint64),
            status=np.array(column["status"], dtype=np.str_),
            theta=np.array(policies, dtype=np.float64).reshape(len(policies), n).T.copy(),
            reward=rewards.pop(TOTAL),
            outcomes=self._unflatten([column[name] for name in self._outcome_columns], n),
            terms=rewards,
            recordings=_recordings(column["recording"]),
        )

    def _reward_columns(self) -> dict[str, str]:
        """Column of the return and of each of its terms, by the name in `Terms`."""
        return {TOTAL: "reward", **self.layout.term_columns()}

    def _figures(self) -> dict[str, str]:
        """Columns of an episode beside its key, with their types."""
        search = [column for prefix in _SEARCH for column in self.layout.policy_columns(prefix)]
        return {"n_scored": "INTEGER", **dict.fromkeys(search, "REAL"), **_EPISODE_FIGURES}

    def _create_tables(self) -> None:
        outcome = ", ".join(f"{name} {kind}" for name, kind in self._outcome_columns.items())
        policy = ", ".join(f"{name} REAL NOT NULL" for name in self.layout.policy_columns())
        rewards = ", ".join(f"{name} REAL" for name in self._reward_columns().values())
        figures = ", ".join(f"{name} {kind}" for name, kind in self._figures().items())
        self._db.execute(
            f"CREATE TABLE rollout({_ROLLOUT_KEY}, stream INTEGER NOT NULL, status TEXT NOT NULL, discarded TEXT, "
            f"{policy}, {rewards}, {outcome}, recording TEXT, PRIMARY KEY(trial, episode, idx)) WITHOUT ROWID"
        )
        self._db.execute(
            f"CREATE TABLE episode(trial INTEGER, episode INTEGER, {figures}, PRIMARY KEY(trial, episode))"
        )
        self._db.execute("CREATE TABLE learner(trial INTEGER PRIMARY KEY, state TEXT NOT NULL)")
        self._db.execute("CREATE TABLE seal(trial INTEGER, episode INTEGER, sha256 TEXT, PRIMARY KEY(trial, episode))")
        self._db.execute("CREATE TABLE quantity(role TEXT, place INTEGER, name TEXT, unit TEXT, doc TEXT)")
        rows = [
            (role, place, quantity.name, quantity.unit, quantity.doc)
            for role, quantities in self.layout.by_role()
            for place, quantity in enumerate(quantities)
        ]
        self._db.executemany("INSERT INTO quantity VALUES(?,?,?,?,?)", rows)

    def _read_layout(self) -> Layout:
        query = "SELECT name, unit, doc FROM quantity WHERE role=? ORDER BY place"
        policy, terms = (
            tuple(Quantity(*row) for row in self._db.execute(query, (role,))) for role in ("policy", "terms")
        )
        return Layout(policy, terms)

    def _save_states(self, trials: Sequence[int], states: Iterable[Mapping[str, Any]]) -> None:
        rows = [(trial, json.dumps(state, allow_nan=False)) for trial, state in zip(trials, states, strict=True)]
        self._db.executemany("INSERT OR REPLACE INTO learner(trial, state) VALUES(?,?)", rows)
        self._seal((trial, _OF_LEARNER, hashlib.sha256(state.encode()).hexdigest()) for trial, state in rows)

    def _seal(self, rows: Iterable[tuple[int, int, str]]) -> None:
        self._db.executemany("INSERT OR REPLACE INTO seal(trial, episode, sha256) VALUES(?,?,?)", rows)

    def _digest(self, trial: int, episode: int) -> str:
        """Digest of a finished episode, of its rollouts and of its figures."""
        said = hashlib.sha256()
        for table, order in (("rollout", " ORDER BY idx"), ("episode", "")):
            query = f"SELECT * FROM {table} WHERE trial=? AND episode=?{order}"
            for row in self._db.execute(query, (trial, episode)):
                said.update(repr(row).encode())
        return said.hexdigest()

    def _check_seals(self) -> None:
        """Refuse a database in which a number is not what was written; SQLite itself would not notice."""
        if not self._db.execute("SELECT 1 FROM sqlite_master WHERE name='seal'").fetchone():
            return  # of an earlier version, which made none
        states = dict(self._db.execute("SELECT trial, state FROM learner"))
        sealed = {(trial, episode): sha for trial, episode, sha in self._db.execute("SELECT * FROM seal")}
        finished = set(self._db.execute("SELECT trial, episode FROM episode"))
        for (trial, episode), sha256 in sealed.items():
            text = states.get(trial, "")
            found = (
                hashlib.sha256(text.encode()).hexdigest() if episode == _OF_LEARNER else self._digest(trial, episode)
            )
            if found != sha256:
                raise ValueError(f"trial {trial}, episode {episode}: not as it was written")
        if finished != {key for key in sealed if key[1] != _OF_LEARNER} or len(states) != len(sealed) - len(finished):
            raise ValueError("episodes are missing")

    def _flatten(self, outcomes: Outcomes) -> list[list[Any]]:
        """One list for each column of `_outcome_columns`."""
        columns: list[list[Any]] = []
        for name in self._outcome_dtype.names or ():
            columns.extend(outcomes[name].reshape(len(outcomes), self._width(name)).T.tolist())
        return columns

    def _unflatten(self, columns: Sequence[Sequence[Any]], n: int) -> Outcomes:
        """Inverse of `_flatten`; NULL is NaN, and zero in the integers of a rollout that was not flown."""
        outcomes, at = np.zeros(n, dtype=self._outcome_dtype), 0
        for name in self._outcome_dtype.names or ():
            target = outcomes[name].reshape(n, self._width(name))
            nothing = np.nan if target.dtype.kind == "f" else 0
            for i in range(target.shape[1]):
                target[:, i] = [nothing if value is None else value for value in columns[at + i]]
            at += target.shape[1]
        return outcomes.view(np.recarray)

    def _width(self, name: str) -> int:
        return math.prod(self._outcome_dtype[name].shape)

    @contextmanager
    def _transaction(self) -> Iterator[None]:
        with _explained(self.folder, "what was stored before is whole; then continue with --resume"):
            try:
                self._db.execute("BEGIN IMMEDIATE")
                yield
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:  # a full disk makes SQLite roll back by itself
                    self._db.execute("ROLLBACK")
                raise


def _connect(folder: Path, path: Path, options: str) -> sqlite3.Connection:
    """Open a database that need not be there only if `options` say so; a path may hold any character."""
    if not (path.is_file() or "mode=rwc" in options):
        raise StoreError(f"{folder / 'run.sqlite'}: is missing")
    uri = f"file:{quote(os.fsencode(path.absolute()))}?{options}"
    with _explained(folder):
        return sqlite3.connect(uri, uri=True, isolation_level=None, timeout=10.0)


def _snapshot(folder: Path, held: ExitStack) -> tuple[Path, str]:
    """What to read: the database itself if all is in it, else a copy of it and of the writer's log."""
    names = ("run.sqlite", "run.sqlite-wal")
    log = folder / names[1]
    if not log.exists() or log.stat().st_size == 0:
        return folder / names[0], "immutable=1"
    copy = Path(held.enter_context(tempfile.TemporaryDirectory(prefix="ivl-reading-")))
    for _ in range(_SNAPSHOT_TRIES):
        before = [_stamp(folder / name) for name in names]
        for name in names:
            shutil.copyfile(folder / name, copy / name)
        if before == [_stamp(folder / name) for name in names]:
            return copy / names[0], "mode=rw"
    raise StoreError(f"{folder}: is written too fast to be read at the moment: try again")


def _stamp(path: Path) -> tuple[int, int]:
    status = path.stat()
    return status.st_mtime_ns, status.st_size


@contextmanager
def _explained(folder: Path, then: str = "") -> Iterator[None]:
    """Turn what SQLite, or a value that does not fit, says into one line; `then` tells what to do after mending it."""
    try:
        yield
    except (IvlError, sqlite3.IntegrityError, sqlite3.ProgrammingError):
        raise
    except sqlite3.Error as error:
        advice = f" ({_SQLITE_ADVICE[error.sqlite_errorcode & 0xFF]})" if _known(error) else ""
        raise StoreError(f"{folder / 'run.sqlite'}: {error}{advice}{f'; {then}' if then else ''}") from error
    except (ValueError, TypeError, OverflowError, KeyError) as error:
        if then:
            raise  # what was to be written is the caller's
        raise StoreError(f"{folder / 'run.sqlite'}: is damaged: {' '.join(str(error).split())[:200]}") from error


def _known(error: sqlite3.Error) -> bool:
    return getattr(error, "sqlite_errorcode", 0) & 0xFF in _SQLITE_ADVICE


def read_manifest(folder: Path) -> dict[str, Any]:
    """The manifest of a run folder.

    Raises:
        StoreError: There is no run, or its manifest cannot be read.
    """
    path = folder / "manifest.json"
    if not path.is_file():
        raise StoreError(f"{folder}: holds no run (no manifest.json)")
    try:
        manifest = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError) as error:
        raise StoreError(f"{path}: cannot be read: {error}") from error
    if not isinstance(manifest, dict):
        raise StoreError(f"{path}: expected an object")
    return manifest


def check_version(folder: Path | str, manifest: Mapping[str, Any], schema_version: int) -> None:
    """Refuse a folder whose files another version of this program wrote in another form.

    Args:
        folder: Run folder of `ivl learn`, `ivl sweep` or `ivl map`.
        manifest: Its manifest.
        schema_version: Version of the form that this program reads and writes in folders of that kind.

    Raises:
        StoreError: The folder's form is another one.
    """
    found = manifest.get("schema_version")
    if found != schema_version:
        writer = manifest.get("ivl_version", "of unknown version")
        raise StoreError(
            f"{folder}: written by ivl {writer} with schema version {found}; "
            f"this is ivl {ivl.__version__}, which reads schema version {schema_version} alone"
        )


def write_json(path: Path, data: Any) -> None:
    """Write JSON so that the file is there whole or not at all."""
    files.write(path, json.dumps(data, indent=2, allow_nan=False) + "\n")


def _outcome_columns(dtype: np.dtype[np.void]) -> dict[str, str]:
    """SQL column name -> type for each element of each outcome field."""
    columns = {}
    for name in dtype.names or ():
        field = dtype[name]
        kind = "REAL" if field.base.kind == "f" else "INTEGER"
        count = math.prod(field.shape)
        names = [f"out_{name}"] if not field.shape else [f"out_{name}_{i + 1}" for i in range(count)]
        columns.update(dict.fromkeys(names, kind))
    return columns


def _recording_text(row: npt.NDArray[np.float64]) -> str:
    """A recording as JSON; null where there is nothing."""
    return json.dumps([_to_sql(value) for value in row.tolist()])


def _utc() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _insight_text(row: EpisodeRow) -> str | None:
    return None if row.insight is None else json.dumps(row.insight, allow_nan=False)


def _recordings(texts: Sequence[str | None]) -> npt.NDArray[np.float64] | None:
    """Inverse of `_recording_text` for many; None if there is none at all."""
    rows = [None if text is None else json.loads(text) for text in texts]
    n = next((len(row) for row in rows if row is not None), 0)
    if not n:
        return None
    return np.array([[np.nan] * n if row is None else row for row in rows], dtype=np.float64)


def _to_sql(value: Any) -> Any:
    return None if isinstance(value, float) and np.isnan(value) else value


def _from_sql(value: Any) -> Any:
    return np.nan if value is None else value


def _marks(columns: Collection[str]) -> str:
    """Place-holders for the values of so many columns."""
    return ",".join("?" * len(columns))


def _episode_row(row: tuple[Any, ...], dim: int) -> EpisodeRow:
    trial, episode, n_scored, *rest = row
    mu, sigma, recommended = (tuple(rest[first : first + dim]) for first in range(0, 3 * dim, dim))
    *figures, stopped, insight = rest[3 * dim :]
    reward_mean, rate_four_leg, rate_clean = map(_from_sql, figures)
    return EpisodeRow(
        trial, episode, n_scored, mu, sigma, recommended, reward_mean, rate_four_leg, rate_clean, bool(stopped),
        None if insight is None else json.loads(insight),
    )  # fmt: skip


def lock_folder(folder: Path) -> int:
    """Keep other processes out; the kernel releases the lock whatever ends this one."""
    try:
        descriptor = os.open(folder / "lock", os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o644)
    except OSError as error:
        raise StoreError(f"{folder}: cannot be written: {files.reason(error)}") from error
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError as error:
        os.close(descriptor)
        if error.errno in (errno.EWOULDBLOCK, errno.EAGAIN):
            raise StoreError(f"{folder}: another process is working on this run") from error
        raise StoreError(
            f"{folder}: cannot be locked: {error.strerror}: put the run folder on a file system that has locks"
        ) from error
    return descriptor


def _clear_unfinished(folder: Path) -> None:
    """Remove what a creation that was cut off left behind; anything else in the folder is not ours to touch."""
    ours = {
        "run.sqlite",
        "run.sqlite-journal",  # SQLite has one while it switches to WAL
        "run.sqlite-wal",
        "run.sqlite-shm",
        "config.yaml",
        "lock",
        EARLIER_FILE,
        references.FOLDER,  # its files have names that follow from their content
    }
    if (folder / "manifest.json").exists():
        raise StoreError(f"{folder}: holds a run already: continue it with --resume, or choose another --out")
    there = [path.name for path in folder.iterdir()]
    foreign = sorted(name for name in there if name not in ours and not files.is_leftover(name))
    if foreign:
        raise StoreError(f"{folder}: is not empty ({foreign[0]} ...) and holds no run: choose another --out")
    for name in there:
        if name not in ("lock", references.FOLDER):
            (folder / name).unlink(missing_ok=True)
