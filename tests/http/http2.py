"""HTTP/2 of the server: `http2.py HOST:PORT`.

The first part speaks through the package h2, which refuses whatever breaks RFC 9113. The second sends frames made by
hand that are wrong, after h2spec's list, and expects the connection error, the stream error or the closing that the
RFC demands (a server may always take the larger of the two, and may close without a word).
"""

import socket
import struct
import sys

import h2.config
import h2.connection
import h2.events
from hpack import Encoder

HOST, PORT = sys.argv[1].rsplit(":", 1)
PREFACE = b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n"
DATA, HEADERS, PRIORITY, RST, SETTINGS, PUSH, PING, GOAWAY, WINDOW, CONTINUATION = range(10)
END_STREAM, ACK, END_HEADERS, PADDED, PRIORITISED = 1, 1, 4, 8, 32
(NO_ERROR, PROTOCOL, INTERNAL, FLOW, SETTINGS_TIMEOUT, STREAM_CLOSED, FRAME_SIZE, REFUSED, CANCEL, COMPRESSION) = range(10)
CALM = 11

results = []


def check(name, good, detail=""):
    results.append(good)
    print(f"{'ok' if good else 'FAILED':6} {name}{'' if good else f': {detail}'}")


def frame(kind, flags, stream, payload=b"", length=None):
    length = len(payload) if length is None else length
    return struct.pack(">I", length)[1:] + bytes([kind, flags]) + struct.pack(">I", stream) + payload


def fields(path="/health", extra=(), method="GET", base=None):
    base = base or [(":method", method), (":scheme", "http"), (":path", path), (":authority", "localhost")]
    return Encoder().encode(base + list(extra), huffman=False)


def connect():
    connection = socket.create_connection((HOST, int(PORT)), timeout=5)
    connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return connection


class Raw:
    """A connection whose frames are made by hand."""

    def __init__(self, greet=True):
        self.socket = connect()
        self.buffer = b""
        if greet:
            self.send(PREFACE + frame(SETTINGS, 0, 0))
            self.send(frame(SETTINGS, ACK, 0))

    def send(self, data):
        try:
            self.socket.sendall(data)
        except OSError:
            pass

    def frames(self):
        """Frames until the connection ends, or nothing comes for a while."""
        while True:
            while len(self.buffer) >= 9:
                length = struct.unpack(">I", b"\0" + self.buffer[:3])[0]
                if len(self.buffer) < 9 + length:
                    break
                kind, flags = self.buffer[3], self.buffer[4]
                stream = struct.unpack(">I", self.buffer[5:9])[0] & 0x7FFFFFFF
                payload, self.buffer = self.buffer[9 : 9 + length], self.buffer[9 + length :]
                yield kind, flags, stream, payload
            try:
                self.socket.settimeout(2)
                more = self.socket.recv(65536)
            except TimeoutError:
                yield "silence", 0, 0, b""
                return
            except OSError:
                more = b""
            if not more:
                yield "closed", 0, 0, b""
                return
            self.buffer += more


def expect_error(name, send, codes, stream_error=False, greet=True):
    """Sends what is wrong; expects GOAWAY (or RST_STREAM) with one of `codes`, or the end."""
    raw = Raw(greet)
    send(raw)
    seen = []
    for kind, _, stream, payload in raw.frames():
        if kind == GOAWAY:
            code = struct.unpack(">I", payload[4:8])[0]
            seen.append(f"GOAWAY {code}")
            if code in codes:
                return check(name, True)
        elif kind == RST:
            code = struct.unpack(">I", payload)[0]
            seen.append(f"RST {code}")
            if stream_error and code in codes:
                return check(name, True)
        elif kind == "closed":
            return check(name, True)
        elif kind == "silence":
            break
        elif kind == HEADERS and stream_error:
            # A malformed request may be answered with 400.
            if b"400" in payload or payload[:1] == b"\x8c":
                return check(name, True)
            seen.append("HEADERS")
    check(name, False, seen)


def expect_fine(name, send):
    """Sends what is unusual but allowed, then a request; expects its response."""
    raw = Raw()
    send(raw)
    raw.send(frame(HEADERS, END_HEADERS | END_STREAM, 101, fields()))
    for kind, _, stream, _ in raw.frames():
        if kind == HEADERS and stream == 101:
            return check(name, True)
        if kind in (GOAWAY, "closed", "silence"):
            return check(name, False, kind)
    return check(name, False)


def through_h2():
    """Many requests at once, with small windows, through a client that checks what it gets."""
    config = h2.config.H2Configuration(client_side=True, header_encoding="utf-8")
    client = h2.connection.H2Connection(config)
    client.initiate_connection()
    client.update_settings({h2.settings.SettingCodes.INITIAL_WINDOW_SIZE: 1000})
    sock = connect()
    base = [(":method", "GET"), (":scheme", "http"), (":authority", "localhost")]
    wanted = {}
    for number in range(60):
        stream = client.get_next_available_stream_id()
        first = number * 1000
        client.send_headers(
            stream,
            base + [(":path", "/files/scan.marq"), ("range", f"bytes={first}-{first + 4999}")],
            end_stream=True,
        )
        wanted[stream] = 5000
    sock.sendall(client.data_to_send())
    received, ended, statuses = {}, set(), {}
    while len(ended) < len(wanted):
        data = sock.recv(65536)
        assert data, "the server hung up"
        for event in client.receive_data(data):
            if isinstance(event, h2.events.ResponseReceived):
                statuses[event.stream_id] = dict(event.headers)[":status"]
            elif isinstance(event, h2.events.DataReceived):
                received[event.stream_id] = received.get(event.stream_id, 0) + len(event.data)
                client.acknowledge_received_data(event.flow_controlled_length, event.stream_id)
            elif isinstance(event, h2.events.StreamEnded):
                ended.add(event.stream_id)
            elif isinstance(event, (h2.events.StreamReset, h2.events.ConnectionTerminated)):
                raise AssertionError(event)
        sock.sendall(client.data_to_send())
    check("60 ranges at once through windows of 1000 bytes", received == wanted and set(statuses.values()) == {"206"})
    stream = client.get_next_available_stream_id()
    client.send_headers(stream, base[1:] + [(":method", "HEAD"), (":path", "/files/scan.marq")], end_stream=True)
    client.ping(b"12345678")
    sock.sendall(client.data_to_send())
    pong, length = False, None
    while not (pong and length):
        for event in client.receive_data(sock.recv(65536)):
            pong = pong or isinstance(event, h2.events.PingAckReceived)
            if isinstance(event, h2.events.ResponseReceived):
                length = dict(event.headers).get("content-length")
    check("HEAD tells the length; PING is answered", int(length) > 5000)


def main():
    through_h2()
    open_stream = frame(HEADERS, END_HEADERS | END_STREAM, 1, fields())
    request = lambda extra=(), **more: frame(HEADERS, END_HEADERS | END_STREAM, 1, fields(extra=extra, **more))

    expect_error("3.4 a preface that is none", lambda r: r.send(b"PRI * HTTP/2.0\r\n\r\nXX\r\n\r\n" + frame(SETTINGS, 0, 0)), {PROTOCOL}, greet=False)
    expect_error("4.2 a frame longer than allowed", lambda r: r.send(frame(DATA, 0, 1, b"x" * 16385)), {FRAME_SIZE, PROTOCOL})
    expect_error("4.3 a header block that does not decode", lambda r: r.send(frame(HEADERS, END_HEADERS | END_STREAM, 1, b"\xff\xff\xff\xff\xff\xff\xff")), {COMPRESSION})
    expect_error("4.3 another frame within a header block", lambda r: r.send(frame(HEADERS, END_STREAM, 1, fields()) + frame(PRIORITY, 0, 3, b"\0\0\0\0\0")), {PROTOCOL})
    expect_error("4.3 a header block of another stream", lambda r: r.send(frame(HEADERS, END_STREAM, 1, fields()) + frame(CONTINUATION, END_HEADERS, 3, fields())), {PROTOCOL})
    expect_fine("4.1 frames of unknown type are ignored", lambda r: r.send(frame(0x2F, 0xFF, 0, b"unknown")))
    expect_fine("4.1 unknown flags are ignored", lambda r: r.send(frame(PING, 0xF0 & ~ACK, 0, b"12345678")))
    expect_fine("4.1 the reserved bit is ignored", lambda r: r.send(frame(PING, 0, 0x80000000, b"12345678")))
    expect_error("5.1 DATA on an idle stream", lambda r: r.send(frame(DATA, END_STREAM, 1, b"x")), {PROTOCOL, STREAM_CLOSED})
    expect_error("5.1 RST_STREAM on an idle stream", lambda r: r.send(frame(RST, 0, 1, struct.pack(">I", CANCEL))), {PROTOCOL})
    expect_error("5.1 WINDOW_UPDATE on an idle stream", lambda r: r.send(frame(WINDOW, 0, 1, struct.pack(">I", 100))), {PROTOCOL})
    expect_error("5.1 CONTINUATION without HEADERS", lambda r: r.send(frame(CONTINUATION, END_HEADERS, 1, fields())), {PROTOCOL})
    expect_error("5.1 DATA after the end of the stream", lambda r: r.send(open_stream + frame(DATA, END_STREAM, 1, b"x")), {STREAM_CLOSED, PROTOCOL}, True)
    expect_error("5.1 HEADERS after the end of the stream", lambda r: r.send(open_stream + open_stream), {STREAM_CLOSED, PROTOCOL}, True)
    expect_error("5.1.1 a stream of an even number", lambda r: r.send(frame(HEADERS, END_HEADERS | END_STREAM, 2, fields())), {PROTOCOL})
    expect_error("5.1.1 a stream number below the last", lambda r: r.send(frame(HEADERS, END_HEADERS | END_STREAM, 5, fields()) + frame(HEADERS, END_HEADERS | END_STREAM, 3, fields())), {PROTOCOL, STREAM_CLOSED}, True)
    expect_error("5.3.1 a stream that depends on itself", lambda r: r.send(frame(HEADERS, END_HEADERS | END_STREAM | PRIORITISED, 1, struct.pack(">IB", 1, 16) + fields())), {PROTOCOL}, True)
    expect_error("6.1 DATA on stream 0", lambda r: r.send(frame(DATA, 0, 0, b"x")), {PROTOCOL})
    expect_error("6.1 DATA with more padding than payload", lambda r: r.send(frame(HEADERS, END_HEADERS, 1, fields(method="POST")) + frame(DATA, END_STREAM | PADDED, 1, b"\x09xx")), {PROTOCOL})
    expect_error("6.2 HEADERS on stream 0", lambda r: r.send(frame(HEADERS, END_HEADERS | END_STREAM, 0, fields())), {PROTOCOL})
    expect_error("6.2 HEADERS with more padding than payload", lambda r: r.send(frame(HEADERS, END_HEADERS | END_STREAM | PADDED, 1, b"\xff" + fields())), {PROTOCOL})
    expect_error("6.3 PRIORITY on stream 0", lambda r: r.send(frame(PRIORITY, 0, 0, b"\0\0\0\0\0")), {PROTOCOL})
    expect_error("6.3 PRIORITY of a wrong length", lambda r: r.send(frame(PRIORITY, 0, 1, b"\0\0\0\0")), {FRAME_SIZE}, True)
    expect_error("6.4 RST_STREAM on stream 0", lambda r: r.send(frame(RST, 0, 0, b"\0\0\0\0")), {PROTOCOL})
    expect_error("6.4 RST_STREAM of a wrong length", lambda r: r.send(open_stream + frame(RST, 0, 1, b"\0\0\0")), {FRAME_SIZE})
    expect_error("6.5 SETTINGS ACK with a payload", lambda r: r.send(frame(SETTINGS, ACK, 0, b"\0" * 6)), {FRAME_SIZE})
    expect_error("6.5 SETTINGS on a stream", lambda r: r.send(frame(SETTINGS, 0, 1)), {PROTOCOL})
    expect_error("6.5 SETTINGS of a wrong length", lambda r: r.send(frame(SETTINGS, 0, 0, b"\0" * 5)), {FRAME_SIZE})
    setting = lambda name, value: frame(SETTINGS, 0, 0, struct.pack(">HI", name, value))
    expect_error("6.5.2 ENABLE_PUSH that is neither 0 nor 1", lambda r: r.send(setting(2, 2)), {PROTOCOL})
    expect_error("6.5.2 INITIAL_WINDOW_SIZE above 2^31 - 1", lambda r: r.send(setting(4, 1 << 31)), {FLOW})
    expect_error("6.5.2 MAX_FRAME_SIZE below 2^14", lambda r: r.send(setting(5, 16383)), {PROTOCOL})
    expect_error("6.5.2 MAX_FRAME_SIZE above 2^24 - 1", lambda r: r.send(setting(5, 1 << 24)), {PROTOCOL})
    expect_fine("6.5.2 unknown settings are ignored", lambda r: r.send(setting(0xFF, 1)))
    expect_error("6.6 PUSH_PROMISE of a client", lambda r: r.send(frame(PUSH, END_HEADERS, 1, struct.pack(">I", 2) + fields())), {PROTOCOL})
    expect_error("6.7 PING on a stream", lambda r: r.send(frame(PING, 0, 1, b"12345678")), {PROTOCOL})
    expect_error("6.7 PING of a wrong length", lambda r: r.send(frame(PING, 0, 0, b"1234567")), {FRAME_SIZE})
    expect_error("6.8 GOAWAY on a stream", lambda r: r.send(frame(GOAWAY, 0, 1, b"\0" * 8)), {PROTOCOL})
    expect_error("6.9 WINDOW_UPDATE of nothing", lambda r: r.send(frame(WINDOW, 0, 0, b"\0\0\0\0")), {PROTOCOL})
    expect_error("6.9 WINDOW_UPDATE of a wrong length", lambda r: r.send(frame(WINDOW, 0, 0, b"\0\0\0")), {FRAME_SIZE})
    most = struct.pack(">I", 0x7FFFFFFF)
    expect_error("6.9.1 a connection window above 2^31 - 1", lambda r: r.send(frame(WINDOW, 0, 0, most) * 2), {FLOW})
    expect_error("6.9.1 a stream window above 2^31 - 1", lambda r: r.send(frame(HEADERS, END_HEADERS, 1, fields(method="POST")) + frame(WINDOW, 0, 1, most) * 2), {FLOW}, True)
    expect_error("6.10 CONTINUATION on stream 0", lambda r: r.send(frame(HEADERS, END_STREAM, 1, fields()) + frame(CONTINUATION, END_HEADERS, 0, fields())), {PROTOCOL})
    expect_error("6.10 CONTINUATION without end", lambda r: r.send(frame(HEADERS, END_STREAM, 1, fields()) + frame(CONTINUATION, 0, 1, fields(base=[("x" * 20, "y" * 4000)])) * 200), {PROTOCOL, CALM, COMPRESSION, REFUSED}, True)
    bad = {PROTOCOL, CANCEL, REFUSED}
    expect_error("8.2.1 a field name in capitals", lambda r: r.send(request([("X-Upper", "y")])), bad, True)
    expect_error("8.2.2 a Connection field", lambda r: r.send(request([("connection", "keep-alive")])), bad, True)
    expect_error("8.2.2 TE other than trailers", lambda r: r.send(request([("te", "gzip")])), bad, True)
    expect_error("8.3 a pseudo-field that is none", lambda r: r.send(request(base=[(":method", "GET"), (":scheme", "http"), (":path", "/"), (":test", "x")])), bad, True)
    expect_error("8.3 a pseudo-field of responses", lambda r: r.send(request(base=[(":method", "GET"), (":scheme", "http"), (":path", "/"), (":status", "200")])), bad, True)
    expect_error("8.3 a pseudo-field after a field", lambda r: r.send(request(base=[(":method", "GET"), (":scheme", "http"), ("x", "y"), (":path", "/")])), bad, True)
    expect_error("8.3.1 no method", lambda r: r.send(request(base=[(":scheme", "http"), (":path", "/")])), bad, True)
    expect_error("8.3.1 no path", lambda r: r.send(request(base=[(":method", "GET"), (":scheme", "http")])), bad, True)
    expect_error("8.3.1 an empty path", lambda r: r.send(request(base=[(":method", "GET"), (":scheme", "http"), (":path", "")])), bad, True)
    expect_error("8.3.1 two methods", lambda r: r.send(request(base=[(":method", "GET"), (":method", "GET"), (":scheme", "http"), (":path", "/")])), bad, True)
    expect_error("8.1.1 a Content-Length that does not fit", lambda r: r.send(frame(HEADERS, END_HEADERS, 1, fields(method="POST", extra=[("content-length", "1")])) + frame(DATA, END_STREAM, 1, b"four")), bad, True)
    reset = b"".join(frame(HEADERS, END_HEADERS | END_STREAM, n, fields()) + frame(RST, 0, n, struct.pack(">I", CANCEL)) for n in range(1, 4001, 2))
    expect_error("10.5 streams begun and reset for ever", lambda r: r.send(reset), {CALM, PROTOCOL})
    check("others are served all the same", served())
    good = sum(results)
    print(f"{good} passed, {len(results) - good} failed")
    sys.exit(0 if all(results) else 1)


def served():
    raw = Raw()
    raw.send(frame(HEADERS, END_HEADERS | END_STREAM, 1, fields()))
    return any(kind == HEADERS for kind, *_ in raw.frames())


main()
