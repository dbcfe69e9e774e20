"""Do the manual steps in a browser: marks, boxes, clocks, the long-range camera.

INPUTS   a project's config/ and its recordings; results/ where there are any
OUTPUTS  the hand-made files of config/, as the person at the pages makes them
The server listens on this computer alone. Over SSH: `ssh -L 8125:127.0.0.1:8125 <computer>`, and then the address that
is printed, in the browser at home.
"""

import os
import secrets
import socket
from pathlib import Path

from dior.errors import DiorError
from dior.project.run import CONFIG

HOST = "127.0.0.1"
PORT = 8125  # chosen: registered by nobody


def run(project: Path = Path("."), *, port: int = 0) -> None:
    """Serve the pages of a project until Ctrl-C.

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
    with Workspace() as workspace:
        print(f"Open http://{HOST}:{number}/?token={token}\nCtrl-C ends it.", flush=True)
        pages = app.made(workspace, token)
        config = uvicorn.Config(pages, log_level="warning", lifespan="off", ws="none")
        try:
            uvicorn.Server(config).run(sockets=[listening])
        finally:
            # Ctrl-C is raised once more when the server has ended
            pages.state.effort.note()


def _listening(port: int) -> socket.socket:
    """A socket at `port`, or where that is 0, at PORT or the first one free after it."""
    for number in [port] if port else range(PORT, PORT + 20):
        listening = socket.socket()
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
