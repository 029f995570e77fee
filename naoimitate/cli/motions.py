"""``naoimitate motions``: the built-in motions and when their person stands on one foot."""

from __future__ import annotations

import json
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import click

if TYPE_CHECKING:
    from naoimitate.core.frames import Motion


@click.command()
@click.option("--json", "as_json", is_flag=True, help="A JSON list: name, duration, single_support [[side, from, to]].")
def motions(as_json: bool) -> None:
    """List the built-in motions.

    Use them as builtin:NAME wherever a command takes a MOTION.
    """
    from naoimitate.motion.builtin import builtin_motion, builtin_names

    loaded = {name: builtin_motion(name) for name in builtin_names()}
    entries = [describe(name, motion) for name, motion in loaded.items()]
    if as_json:
        click.echo(json.dumps(entries))
        return
    for entry in entries:
        stands = ", ".join(f"{side} {start:g}-{end:g}" for side, start, end in entry["single_support"])
        click.echo(f"builtin:{entry['name']}  {entry['duration']:g} s  on one foot: {stands or 'never'}")
        click.echo(f"    {loaded[entry['name']].notes[0]}")


def describe(name: str, motion: Motion) -> dict[str, Any]:
    """What JSON says about a motion: times in s from its first frame."""
    return {"name": name, "duration": round(motion.duration, 3), "single_support": single_supports(motion)}


def single_supports(motion: Motion) -> list[list[Any]]:
    """[side, from, to] of every stand on one foot; side L or R, times in s."""
    modes = [] if motion.support is None else motion.support.tolist()
    changes = [i for i in range(1, len(modes)) if modes[i] != modes[i - 1]]
    return [
        [modes[first], round(float(motion.time[first]), 3), round(float(motion.time[min(end, len(modes) - 1)]), 3)]
        for first, end in pairwise([0, *changes, len(modes)])
        if modes[first] in ("L", "R")
    ]
