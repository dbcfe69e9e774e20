"""Do the manual steps in a browser: marks, boxes, clocks, the long-range camera.

INPUTS   a project's config/ and its recordings; results/ where there are any
OUTPUTS  the hand-made files of config/, as the person at the pages makes them
The server listens on this computer alone. Over SSH: `ssh -L 8125:127.0.0.1:8125 <computer>`, and then the address that
is printed, in the browser at home.
"""

import logging
import os
import secrets
import signal
import socket
from contextlib import nullcontext
from pathlib import Path
from typing import Any

from dior.errors import DiorError
from dior.project.run import CONFIG

HOST = "127.0.0.1"
PORT = 8125  # chosen: registered by nobody
# chosen: what is being saved is saved by then; who has stopped to read an answer is not waited for
GRACE_S = 1


def run(project: Path = Path("."), *, port: int = 0) -> int:
    """Serve the pages of a project until Ctrl-C; returns what a shell says of the signal that ended it.

    `project`: its folder, where it is not the one that you are in; `port`: where to listen, 0 for 8125 or the next that
    is free.
    Raises DiorError where there is no project, and where the port is taken.
    """
    if not (project / CONFIG).is_file():
        raise DiorError(f"{project}: there is no {CONFIG} in it; name the project's folder, or make one: dior init")
    import uvicorn

    from dior.studio import app
    from dior.studio.workspace import Workspace

    # paths of the project are relative to it
    os.chdir(project)
    listening = _listening(port)
    token = secrets.token_urlsafe(24)
    number = listening.getsockname()[1]
    ended: list[int] = []
    with Workspace() as workspace:
        pages = app.made(workspace, token)
        config = uvicorn.Config(
            pages, log_level="warning", lifespan="off", ws="none", timeout_graceful_shutdown=GRACE_S
        )  # fmt: skip
        server = uvicorn.Server(config)
        # uvicorn ends itself by the signal once more, and what is below would not be done; nor does it know SIGHUP,
        # which is a connection by SSH that is cut
        server.capture_signals = nullcontext  # type: ignore[method-assign,assignment]

        def end(number: int, frame: Any) -> None:
            ended.append(number)
            # which answers are cut off is nobody's concern
            logging.getLogger("uvicorn.error").setLevel(logging.CRITICAL)
            server.handle_exit(number, frame)

        # what a shell begins in the background ignores Ctrl-C, and so would all runs of the pages; `nohup` is meant
        hung_up = [] if signal.getsignal(signal.SIGHUP) is signal.SIG_IGN else [signal.SIGHUP]
        for ending in (signal.SIGINT, signal.SIGTERM, *hung_up):
            signal.signal(ending, end)
        print(f"Open http://{HOST}:{number}/?token={token}\nCtrl-C ends it.", flush=True)
        try:
            server.run(sockets=[listening])
        finally:
            app.close(pages)
    return 128 + ended[0] if ended else 0


def _listening(port: int) -> socket.socket:
    """A socket at `port`, or where that is 0, at PORT or the first one free after it."""
    for number in [port] if port else range(PORT, PORT + 20):
        # asyncio sends at once only over sockets that say TCP; others keep the end of an answer back until the browser
        # has acknowledged its beginning, 40 ms later
        listening = socket.socket(proto=socket.IPPROTO_TCP)
        listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            listening.bind((HOST, number))
            # who opens the address at once waits, and is not refused
            listening.listen()
            return listening
        except (OSError, OverflowError) as error:
            listening.close()
            if port:
                why = getattr(error, "strerror", None) or "there are ports 1 to 65535"
                raise DiorError(f"port {port} cannot be used ({why}); give another: --port {PORT}") from None
    raise DiorError(f"the ports {PORT} to {PORT + 19} are all taken; give another with --port")
