"""msgpack-rpc over TCP: requests `[0, id, method, args]`, answers `[1, id, error, result]` in any order."""
from __future__ import annotations

import itertools
import socket
import threading
from typing import Any, Optional

import msgpack


class RPCError(Exception):
    """The server's word on why a call failed."""


class TransportError(RPCError):
    """There is no server, or the connection to it has ended."""


class TimeoutError(RPCError):  # noqa: A001 - the name that scripts know
    """The server has not answered in time."""


class Future:
    """The answer to a call that has been sent."""

    def __init__(self, timeout_s: float):
        self._timeout_s = timeout_s
        self._done = threading.Event()
        self._result: Any = None
        self._error: Optional[Exception] = None

    def join(self) -> "Future":
        """Waits until the call has ended, whatever came of it."""
        self._wait()
        return self

    def get(self) -> Any:
        """Waits for the result; raises RPCError for a call that failed."""
        self._wait()
        if self._error is not None:
            raise self._error
        return self._result

    @property
    def result(self) -> Any:
        return self.get()

    @property
    def error(self) -> Optional[Exception]:
        self._wait()
        return self._error

    def done(self) -> bool:
        return self._done.is_set()

    def _wait(self) -> None:
        if not self._done.wait(self._timeout_s):
            raise TimeoutError(f"no answer in {self._timeout_s:g} s")

    def _end(self, result: Any, error: Optional[Exception]) -> None:
        self._result, self._error = result, error
        self._done.set()


class Connection:
    """One connection to a server. May be used by several threads at once; a thread of its own reads the answers."""

    def __init__(self, host: str = "127.0.0.1", port: int = 41451, timeout_s: float = 3600.0):
        """timeout_s: how long a call is waited for."""
        self._timeout_s = timeout_s
        try:
            self._socket = socket.create_connection((host, port), timeout=10.0)
        except OSError as fault:
            raise TransportError(f"no server at {host}:{port}: {fault}") from fault
        self._socket.settimeout(None)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._ids = itertools.count(1)
        self._lock = threading.Lock()
        self._waiting: dict[int, Future] = {}
        self._ended: Optional[Exception] = None
        self._reader = threading.Thread(target=self._read, daemon=True, name="tileflight answers")
        self._reader.start()

    def call(self, method: str, *args: Any) -> Any:
        return self.call_async(method, *args).get()

    def call_async(self, method: str, *args: Any) -> Future:
        future = Future(self._timeout_s)
        with self._lock:
            if self._ended is not None:
                raise self._ended
            number = next(self._ids) & 0xFFFFFFFF
            message = msgpack.packb([0, number, method, args], default=_plain)
            self._waiting[number] = future
            try:
                self._socket.sendall(message)
            except OSError as fault:
                del self._waiting[number]
                raise TransportError(f"the connection has ended: {fault}") from fault
        return future

    def close(self) -> None:
        try:
            self._socket.shutdown(socket.SHUT_RDWR)
        except OSError:
            pass
        self._socket.close()

    def _read(self) -> None:
        unpacker = msgpack.Unpacker(raw=False, strict_map_key=False, max_buffer_size=2**31 - 1)
        fault: Exception = TransportError("the server has closed the connection")
        try:
            while True:
                data = self._socket.recv(1 << 18)
                if not data:
                    break
                unpacker.feed(data)
                for message in unpacker:
                    self._take(message)
        except Exception as error:  # whatever ended the reading, nobody may wait for ever
            fault = TransportError(f"the connection has ended: {error}")
        with self._lock:
            self._ended = fault
            waiting, self._waiting = list(self._waiting.values()), {}
        for future in waiting:
            future._end(None, fault)

    def _take(self, message: Any) -> None:
        kind, number, error, result = message
        if kind != 1:
            raise ValueError(f"a message of kind {kind}")
        with self._lock:
            future = self._waiting.pop(number, None)
        if future is not None:
            future._end(result, None if error is None else RPCError(error))


def _plain(value: Any) -> Any:
    """Converts what msgpack does not know itself: the protocol's structures, and numbers and arrays of numpy."""
    for name in ("to_msgpack", "tolist"):
        if hasattr(value, name):
            return getattr(value, name)()
    raise TypeError(f"a {type(value).__name__} cannot be sent")
