"""Calls to a NAOqi robot, none of which waits longer than it is told to: our end of ``naoqi_child``."""

from __future__ import annotations

import contextlib
import importlib.util
import json
import os
import select
import subprocess
import sys
import threading
from concurrent.futures import Future, InvalidStateError
from concurrent.futures import TimeoutError as Late
from itertools import count
from pathlib import Path
from typing import Any

from naoimitate.core.errors import DriverError

INSTALL = "the driver naoqi needs the package qi (Linux x86_64, Python 3.10 to 3.12): pip install 'naoimitate[naoqi]'"

CHILD = Path(__file__).with_name("naoqi_child.py")


class NaoqiLink:
    """A session with a robot and its services, in a process of its own. Errors are DriverError, one line each."""

    def __init__(self, url: str, user: str = "", password: str = "", patience: float = 5.0) -> None:
        """Connect to ``url`` within ``patience`` s; user and password only where the robot asks for them."""
        if not url.startswith(("tcp://", "tcps://")):
            raise DriverError(f"{url} is no address of a robot: write tcp://HOST:9559")
        _require_qi()
        self._url, self._patience = url, patience
        self._numbers = count()
        self._waiting: dict[int, Future[Any]] = {}
        self._lost = False
        self._child = subprocess.Popen(
            [sys.executable, str(CHILD)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            start_new_session=True,  # Ctrl-C is for us: we still need the child to stop the robot
        )
        threading.Thread(target=self._listen, name="naoqi answers", daemon=True).start()
        assert self._child.stdin is not None
        self._pipe = self._child.stdin.fileno()
        os.set_blocking(self._pipe, False)
        try:
            trouble = f"no robot at {url}: is it on, and in this network?"
            self._result(self._request({"open": [url, user, password]}), trouble, patience)
        except DriverError:
            self.close()
            raise

    @property
    def open(self) -> bool:
        """Whether the robot is still there."""
        return not self._lost

    def call(self, service: str, method: str, *arguments: Any, patience: float | None = None) -> Any:
        """The answer of a robot's method, at most ``patience`` s later."""
        asked = self.ask(service, method, *arguments)
        return self._result(asked, f"{service}.{method} failed", self._patience if patience is None else patience)

    def ask(self, service: str, method: str, *arguments: Any) -> Future[Any]:
        """Call a method without waiting. Arguments: whatever JSON knows."""
        return self._request({"call": [service, method, arguments]})

    def has(self, service: str) -> bool:
        """Whether the robot offers a service."""
        try:
            self._result(self._request({"find": service}), f"{service} not found", self._patience)
        except DriverError:
            return False
        return True

    def close(self) -> None:
        """End the session as it is; what is under way is forgotten. May be called twice."""
        self._lost = True
        with contextlib.suppress(OSError):  # the child may be gone already
            self._send({"farewell": True})
        try:
            self._child.wait(1.0)
        except subprocess.TimeoutExpired:
            self._child.kill()
            self._child.wait()
        self._pipe = -1  # its number may soon be that of another file
        assert self._child.stdin is not None
        self._child.stdin.close()

    def _request(self, what: dict[str, Any]) -> Future[Any]:
        number, future = next(self._numbers), Future[Any]()
        self._waiting[number] = future
        try:
            self._send({"id": number, **what})
        except OSError:
            self._waiting.pop(number, None)
            raise DriverError(f"the connection to the robot at {self._url} broke") from None
        return future

    def _send(self, request: dict[str, Any]) -> None:
        """One line to the child: never blocks, and needs no lock that a signal handler might find taken.

        A pipe takes up to ``select.PIPE_BUF`` bytes as a whole or not at all.
        """
        line = json.dumps(request).encode() + b"\n"
        assert len(line) <= select.PIPE_BUF
        os.write(self._pipe, line)

    def _listen(self) -> None:
        """Give the child's answers to who waits for them; when it ends, nobody waits any longer."""
        assert self._child.stdout is not None
        for line in self._child.stdout:
            answer = json.loads(line)
            if "lost" in answer:
                self._lost = True
            elif (future := self._waiting.pop(answer["id"], None)) is not None:
                with contextlib.suppress(InvalidStateError):
                    if "error" in answer:
                        future.set_exception(DriverError(_line(answer["error"])))
                    else:
                        future.set_result(answer["value"])
        self._lost = True
        for future in list(self._waiting.values()):
            with contextlib.suppress(InvalidStateError):
                future.set_exception(DriverError("the connection broke"))

    def _result(self, future: Future[Any], trouble: str, patience: float) -> Any:
        """The value of a future, or DriverError."""
        try:
            return future.result(patience)
        except Late:
            raise DriverError(f"{trouble} (no answer in {patience:g} s)") from None
        except DriverError as error:
            raise DriverError(f"{trouble} ({error})") from None


def _require_qi() -> None:
    try:
        found = importlib.util.find_spec("qi") is not None
    except ValueError:  # hidden on purpose
        found = False
    if not found:
        raise DriverError(INSTALL)


def _line(error: str) -> str:
    """The first line of an error: qi appends the robot's own traceback."""
    return error.strip().splitlines()[0] if error.strip() else "unknown error"
