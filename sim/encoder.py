"""Pictures become an mp4 file."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import imageio.v2 as imageio

from naoimitate.core.errors import RenderingUnavailable


@contextmanager
def encoder(path: Path, fps: float, options: Sequence[str] = ()) -> Iterator[Any]:
    """A writer of mp4 files; what it and its program raise becomes one line. options: of the program ffmpeg."""
    try:
        with imageio.get_writer(path, fps=fps, codec="libx264", quality=8, output_params=list(options)) as video:
            yield video
    except (OSError, RuntimeError) as error:
        reason = str(error).strip().splitlines() or [type(error).__name__]
        raise RenderingUnavailable(f"No video: {path.suffix[1:]} cannot be encoded ({reason[0]})") from error
