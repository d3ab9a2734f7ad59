"""A server on this machine that serves bytes, and misbehaves on demand."""

import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer


class Server:
    """What is served, how it goes wrong, and what was asked for."""

    def __init__(self, files):
        self.files = files  # path -> bytes
        self.whole = 0  # how many of the next answers to GET are the whole file although a rest was asked for
        self.cuts = []  # after how many bytes the next answers to GET hang up
        self.statuses = []  # of the next answers to GET, instead of the file
        self.asked = []  # (method, path, Range)
        self.url = ""


@contextmanager
def serving(files):
    state = Server(files)

    class Handler(BaseHTTPRequestHandler):
        def do_HEAD(self):
            self.answer(body=False)

        def do_GET(self):
            self.answer(body=True)

        def answer(self, body):
            wanted = self.headers.get("Range")
            state.asked.append((self.command, self.path, wanted))
            data = state.files.get(self.path)
            if body and state.statuses:
                return self.send_error(state.statuses.pop(0))
            if data is None:
                return self.send_error(404)
            start = int(wanted.removeprefix("bytes=").rstrip("-")) if wanted else 0
            if start and state.whole:
                start, state.whole = 0, state.whole - 1
            self.send_response(206 if start else 200)
            if start:
                self.send_header("Content-Range", f"bytes {start}-{len(data) - 1}/{len(data)}")
            self.send_header("Content-Length", str(len(data) - start))
            self.end_headers()
            if body:
                stop = start + state.cuts.pop(0) if state.cuts else len(data)
                self.wfile.write(data[start:stop])
            return None

        def log_message(self, *_):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, args=(0.01,), daemon=True)
    thread.start()
    state.url = f"http://127.0.0.1:{server.server_port}"
    try:
        yield state
    finally:
        server.shutdown()
        server.server_close()
        thread.join()


def free_port():
    """Return the address of a server that is not there."""
    server = ThreadingHTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler)
    port = server.server_port
    server.server_close()
    return f"http://127.0.0.1:{port}"
