"""`yawbench serve`: results pages in the browser, and runs under sliders."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from yawbench.commands.options import RunOptions, takes
from yawbench.commands.terminal_progress import say
from yawbench.foundation.errors import ResultsError

Served = Annotated[Path, typer.Argument(help="Folder of results.", metavar="FOLDER")]
Port = Annotated[int, typer.Option("--port", min=0, max=65535, help="Port; default: any free one.")]
Browser = Annotated[bool, typer.Option("--browser/--no-browser", help="Open the page in the browser.")]


@takes("no_build")
def serve(
    options: RunOptions, folder: Served = Path("results"), port: Port = 0, browser: Browser = True
) -> None:
    """Show results in the browser; run scenarios by sliders.

    The printed address works on this machine only, until Ctrl-C. It has a random token; anyone who has it can
    read the files below the folder and make runs.
    """
    import webbrowser
    from contextlib import closing

    from .server import ResultsServer
    from .sliders import Bench

    with closing(Bench(build=options.build)) as bench:
        try:
            server = ResultsServer(folder, bench, port)
        except OSError as error:
            raise ResultsError(f"--port {port}: {error.strerror}", code="option-invalid") from None
        with server:
            say(f"{folder}: {server.address} (Ctrl-C ends)")
            if browser:
                webbrowser.open(server.address)
            server.serve_forever()
