"""The studio of a run for the program that runs it, such as a notebook: an address, shown as a frame.

Depends on `serving` and `studio`.
"""

from __future__ import annotations

import asyncio
import html
from pathlib import Path
from typing import Final

from hfg.engine import Run
from hfg.studio.project import Project
from hfg.studio.serving import Server, StudioDoor
from hfg.studio.studio import Studio

__all__ = ["StudioPage", "serve_run"]

_HEIGHT: Final = 720


class StudioPage:
    """A page of the studio that follows one run; a notebook shows it as a frame.

    Attributes:
      address: what a browser opens; it holds a token, so give it only to people who may run code as you.
    """

    def __init__(self, studio: Studio, server: Server) -> None:
        self._studio = studio
        self._server = server
        self.address = server.address

    async def close(self) -> None:
        """End the server; the run continues."""
        await self._studio.close()
        await self._server.stop()

    def _repr_html_(self) -> str:
        address = html.escape(self.address)
        frame = f'<iframe src="{address}" width="100%" height="{_HEIGHT}" style="border:0"></iframe>'
        return f'{frame}<p><a href="{address}" target="_blank">{address}</a></p>'

    def __repr__(self) -> str:
        return f"<studio of a run at {self.address}>"


def serve_run(run: Run, *, port: int | None = None, read_only: bool = False) -> StudioPage:
    """Implement `Run.studio`."""
    why = "You may look, not change: the studio was opened with read_only=True." if read_only else ""
    studio = Studio(Project(run.graph, Path.cwd(), keep=False), read_only=why, run=run)
    server = Server(StudioDoor(asyncio.get_running_loop(), studio), host="localhost", port=port, embedded=True)
    server.start()
    return StudioPage(studio, server)
