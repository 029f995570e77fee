"""The process that talks to a NAO through ``qi``: requests in on standard input, answers out, one JSON text a line.

A process of its own, and a file that imports nothing of ours: qi's wheel and pinocchio's bring two different Boost
libraries, and where both are loaded a lost connection crashes or hangs the program. It also outlives us: when its input
ends without a farewell, the program has died, and the robot is put to rest.

In: {"id": n} with "open": [url, user, password], "call": [service, method, arguments] or "find": service; and
{"farewell": true}.
Out: {"id": n, "value": ...} or {"id": n, "error": "..."}, and {"lost": true} once, when the robot is gone.
"""

from __future__ import annotations

import json
import os
import sys
import threading
from typing import Any, TextIO

WATCH = 0.1
"""[s] between two looks at the connection."""

REST = 20_000
"""[ms] in which a robot is at rest."""


class Login:
    """User and password in the form that qi asks for them."""

    def __init__(self, user: str, password: str) -> None:
        self._data = {"user": user, "token": password}

    def newAuthenticator(self) -> Login:  # noqa: N802 - qi's name
        """Called by qi for each connection."""
        return self

    def initialAuthData(self) -> dict[str, str]:  # noqa: N802 - qi's name
        """Called by qi."""
        return self._data


class Bridge:
    """Requests to calls, and their futures to answers."""

    def __init__(self, qi: Any, out: TextIO) -> None:
        self._session, self._out, self._lock = qi.Session(), out, threading.Lock()
        self._services: dict[str, Any] = {}

    def do(self, request: dict[str, Any]) -> None:
        """Start what a request asks for; it is answered when it is done."""
        number = request["id"]
        try:
            if "open" in request:
                future = self._open(*request["open"])
            elif "find" in request:
                future = self._session.service(request["find"], _async=True)
            else:
                future = self._call(*request["call"])
        except Exception as error:  # whatever it is, the other side must hear of it
            self._say({"id": number, "error": str(error)})
            return
        future.addCallback(lambda done: self._answer(number, done))

    def rest(self) -> None:
        """End all motion and let the robot crouch; nobody is left to hear of errors."""
        if self._session.isConnected():
            self._call("ALMotion", "killAll", []).wait(2000)
            self._call("ALMotion", "rest", []).wait(REST)

    def _open(self, url: str, user: str, password: str) -> Any:
        if user:
            self._session.setClientAuthenticatorFactory(Login(user, password))
        future = self._session.connect(url, _async=True)
        threading.Thread(target=self._watch, args=(future,), daemon=True).start()
        return future

    def _call(self, service: str, method: str, arguments: list[Any]) -> Any:
        if service not in self._services:
            self._services[service] = self._session.service(service)
        return getattr(self._services[service], method)(*arguments, _async=True)

    def _watch(self, opening: Any) -> None:
        opening.wait()
        while self._session.isConnected():
            threading.Event().wait(WATCH)
        self._say({"lost": True})

    def _answer(self, number: int, future: Any) -> None:
        if future.hasError():
            self._say({"id": number, "error": str(future.error())})
        else:
            self._say({"id": number, "value": future.value()})

    def _say(self, answer: dict[str, Any]) -> None:
        with self._lock:
            self._out.write(json.dumps(answer, default=str) + "\n")
            self._out.flush()


def main() -> None:
    """Serve requests until the input ends."""
    out = os.fdopen(os.dup(sys.stdout.fileno()), "w")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # a library that prints must not disturb the answers
    import qi

    qi.logging.setLevel(qi.logging.FATAL)
    bridge = Bridge(qi, out)
    for line in sys.stdin:
        request = json.loads(line)
        if "farewell" in request:
            os._exit(0)  # qi has nothing left to do, and may wait for a robot that is gone
        bridge.do(request)
    try:
        bridge.rest()
    finally:
        os._exit(0)


if __name__ == "__main__":
    main()
