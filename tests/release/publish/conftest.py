"""A whole release, its tarballs, and a server in a thread that stands for a site and notes what it was sent."""

import threading
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import pytest

from dior.release import checksums, tarballs
from tests.release import made_up


@pytest.fixture(scope="package")
def release(tmp_path_factory):
    """To be looked at only."""
    folder = made_up.release(tmp_path_factory.mktemp("published") / "dior-0.1.0")
    for part in {*made_up.EVERYONE, checksums.METADATA}:
        tarballs.run(release=folder, subject=part, out=folder.with_name(f"{folder.name}-{part}.tar"))
    return folder


@contextmanager
def served(answer):
    """Yield the address of a server; `answer(method, path, body, headers)` gives (status, headers, bytes)."""

    class Handler(BaseHTTPRequestHandler):
        def _all(self):
            body = self.rfile.read(int(self.headers.get("Content-Length") or 0))
            status, headers, content = answer(self.command, self.path, body, self.headers)
            if not status:
                # as a server that dies
                self.close_connection = True
                self.connection.close()
                return
            self.send_response(status)
            for key, value in {"Content-Length": str(len(content)), **headers}.items():
                self.send_header(key, value)
            self.end_headers()
            self.wfile.write(content)

        do_GET = do_POST = do_PUT = do_DELETE = do_HEAD = _all

        def log_message(self, *args):
            pass

    server = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    try:
        yield f"http://127.0.0.1:{server.server_port}"
    finally:
        server.shutdown()
        server.server_close()
        thread.join()
