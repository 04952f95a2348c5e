"""A data portal on this machine: real HTTP, the portal's interface, and misbehaviour on demand.

It obeys ``$select=count(*)``, ``$where=location='...'``, ``$order=:id``, ``$limit`` and ``$offset``
as the agency's does: without ``$order`` the rows come in no particular order, without
``$limit`` 1,000 rows come at most, and every cell is quoted.
"""

from __future__ import annotations

import csv
import gzip
import io
import random
import re
import threading
from collections import defaultdict
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any
from urllib.parse import parse_qs, urlsplit

COUNT = "count"  # key of the count query in `requests` and `faults`
PATH = "/resource/8ect-6jqj.csv"
COLUMNS = (
    "vehicle_id", "frame_id", "total_frames", "global_time", "local_x", "local_y", "global_x", "global_y", "v_length",
    "v_width", "v_class", "v_vel", "v_acc", "lane_id", "o_zone", "d_zone", "int_id", "section_id", "direction",
    "movement", "preceding", "following", "space_headway", "time_headway", "location",
)  # fmt: skip
HTML = b"<!DOCTYPE html>\n<html><head><title>Scheduled maintenance</title></head><body>Back soon</body></html>\n"
Row = dict[str, str]


def motorway_rows(location: str = "us-101", *, vehicles: int = 4, frames: int = 40) -> Iterator[Row]:
    """Yield cars in a row on lane 2, 30 ft/s, in two periods that use the same vehicle numbers."""
    for start in (1118846979700, 1118847879700):
        for vehicle in range(1, vehicles + 1):
            for frame in range(frames):
                first = vehicle == 1
                yield dict.fromkeys(COLUMNS, "") | {
                    "vehicle_id": str(vehicle), "frame_id": str(100 + frame), "total_frames": str(frames),
                    "global_time": str(start + 100 * frame), "local_x": "18.500",
                    "local_y": f"{500 - 60 * vehicle + 3 * frame:.3f}", "global_x": f"{6451137.641 + frame:.3f}",
                    "global_y": "1873344.962", "v_length": "14.5", "v_width": "4.9", "v_class": "2", "v_vel": "30.00",
                    "v_acc": "0.00", "lane_id": "2", "preceding": "0" if first else str(vehicle - 1),
                    "following": "0" if vehicle == vehicles else str(vehicle + 1),
                    "space_headway": "0.00" if first else "60.00", "time_headway": "0.00" if first else "2.00",
                    "location": location,
                }  # fmt: skip


def mixed_rows() -> list[Row]:
    """Return 320 rows of US-101 between those of other places, as the portal mixes them."""
    wanted = list(motorway_rows())
    other = list(motorway_rows("i-80", vehicles=2, frames=30))
    street = [
        row | {"o_zone": "101", "d_zone": "214", "movement": "1"} for row in motorway_rows("lankershim", vehicles=1)
    ]
    return other[:50] + wanted[:100] + street + wanted[100:] + other[50:]


class Portal:
    """The server, used as a context.

    Attributes
    ----------
    rows : list of dict
        The data; their place in the list is ``:id``.
    faults : dict of offset (or COUNT) to list of str
        Misbehaviour waiting for the next requests of a page, first in first out.
    requests : list of (int or COUNT)
        What was asked for, in order.
    """

    def __init__(self, rows: list[Row] | None = None) -> None:
        self.rows = mixed_rows() if rows is None else rows
        self.faults: defaultdict[int | str, list[str]] = defaultdict(list)
        self.requests: list[int | str] = []
        self.modified: str | None = "Mon, 16 Sep 2019 23:13:03 GMT"
        self.compress = False
        self.released = threading.Event()  # ends a stalled answer
        self._port = 0

    def __enter__(self) -> Portal:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.released.set()
        self.stop()

    def start(self) -> None:
        """Listen, on the same port as before if there was one."""
        self._server = ThreadingHTTPServer(("127.0.0.1", self._port), type("Handler", (_Handler,), {"portal": self}))
        self._server.daemon_threads = True
        self._port = self._server.server_address[1]
        self._thread = threading.Thread(target=self._server.serve_forever, kwargs={"poll_interval": 0.005})
        self._thread.start()

    def stop(self) -> None:
        """Refuse connections from now on."""
        self._server.shutdown()
        self._server.server_close()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self._port}{PATH}"

    @property
    def page_requests(self) -> list[int | str]:
        return [asked for asked in self.requests if asked != COUNT]

    def of(self, location: str) -> list[Row]:
        return [row for row in self.rows if row["location"] == location]


class _Handler(BaseHTTPRequestHandler):
    portal: Portal
    protocol_version = "HTTP/1.1"
    disable_nagle_algorithm = True  # or every answer waits 40 ms

    def log_message(self, *_: Any) -> None:
        pass

    def do_GET(self) -> None:
        parts = urlsplit(self.path)
        query = {name: values[0] for name, values in parse_qs(parts.query).items()}
        asked = COUNT if "$select" in query else int(query.get("$offset", "0"))
        self.portal.requests.append(asked)
        waiting = self.portal.faults[asked]
        fault = waiting.pop(0) if waiting else ""
        if parts.path != PATH:
            self._send(404, b'{"message": "Cannot find view"}', "application/json")
            return
        try:
            chosen = self._chosen(query, fault)
        except ValueError as error:
            self._send(400, f'{{"message": "Query coordinator error: {error}"}}'.encode(), "application/json")
            return
        body = _text(("count",), [{"count": str(len(chosen))}]) if asked == COUNT else _text(COLUMNS, chosen)
        self._misbehave(fault, body)

    def _chosen(self, query: dict[str, str], fault: str) -> list[Row]:
        if unknown := set(query) - {"$select", "$where", "$order", "$limit", "$offset"}:
            raise ValueError(f"unknown {unknown}")
        rows = list(self.portal.rows)
        if (where := query.get("$where")) and fault != "unfiltered":
            match = re.fullmatch(r"location='([^']*)'", where)
            if not match:
                raise ValueError("query.compiler.malformed")
            rows = [row for row in rows if row["location"] == match[1]]
        if "$select" in query:
            if query["$select"] != "count(*)":
                raise ValueError("no-such-column")
            return rows
        if query.get("$order") != ":id":
            random.Random(len(self.portal.requests)).shuffle(rows)
        first = int(query.get("$offset", "0"))
        rows = rows[first : first + int(query.get("$limit", "1000"))]
        return rows[:-1] if fault == "row less" else rows

    def _misbehave(self, fault: str, body: bytes) -> None:
        if fault.isdigit():
            retry = {"Retry-After": "0.05"} if fault == "429" else {}
            self._send(int(fault), b'{"message": "Internal error"}', "application/json", **retry)
        elif fault == "html":
            self._send(200, HTML, "text/html")
        elif fault == "empty":
            self._send(200, b"")
        elif fault == "cut off":
            self._send(200, body[: len(body) // 2], length=len(body))
        elif fault == "cut off in chunk":
            self._send_chunk(body[: len(body) // 2], len(body))
        elif fault == "length too small":
            self._send(200, body, length=len(body) - 700)
        elif fault == "cut in last row":
            self._send(200, body[:-4])
        elif fault == "length too great":
            self._send(200, body, length=len(body) + 700)
        elif fault == "stall":
            self._send(200, body[:100], length=len(body), stall=True)
        elif fault == "garbled":
            self._send(200, body.replace(b'"18.500"', b'"18.x00"', 1))
        elif fault == "no column":
            self._send(200, body.replace(b"local_y", b"localy", 1))
        elif fault == "die":
            self.portal.stop()
            self.close_connection = True
        else:
            self._send(200, body)

    def _send(
        self, status: int, body: bytes, kind: str = "text/csv", length: int = 0, stall: bool = False, **headers: str
    ) -> None:
        if self.portal.compress and not length:
            body = gzip.compress(body)
            headers["Content-Encoding"] = "gzip"
        self.send_response(status)
        self.send_header("Content-Type", f"{kind};charset=utf-8")
        self.send_header("Content-Length", str(length or len(body)))
        if self.portal.modified:
            self.send_header("X-SODA2-Truth-Last-Modified", self.portal.modified)
        for name, value in headers.items():
            self.send_header(name, value)
        self.end_headers()
        self.close_connection = bool(length)
        self.wfile.write(body)
        if stall:
            self.wfile.flush()
            self.portal.released.wait(120)

    def _send_chunk(self, body: bytes, announced: int) -> None:
        """Begin a chunk and end within it."""
        self.send_response(200)
        self.send_header("Transfer-Encoding", "chunked")
        self.end_headers()
        self.wfile.write(f"{announced:x}\r\n".encode() + body)
        self.close_connection = True


def _text(columns: tuple[str, ...], rows: list[Row]) -> bytes:
    out = io.StringIO()
    writer = csv.writer(out, quoting=csv.QUOTE_ALL, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([row[name] for name in columns] for row in rows)
    return out.getvalue().encode()
