"""Checks of live messages before they are shown: any process can publish them."""

from typing import Any

import numpy as np
import pyarrow as pa

from analysis.viewer.scene import Scene
from schema.errors import InvalidRobot, MalformedMessage
from schema.limits import GREATEST_COORDINATE, LONGEST_REASON, LONGEST_WALL_S
from schema.robot.robot import check_body, check_tree
from schema.wire.arena import Live
from schema.wire.poses import PoseArrays
from schema.wire.updates import Update

_LATEST_S = LONGEST_WALL_S
"""Simulated time; the recording has 64 bits of nanoseconds [s]."""


def check_update(news: Update, scene: Scene) -> None:
    """Raise unless all that a message holds can be shown.

    Raises:
        MalformedMessage: an unknown island, a body that breaks the rules of the run, a
            time beyond the limit, a text that is too long.
    """
    islands = {one.birth.island for one in news.births}
    placed: list[Any] = [*news.deaths, *news.levels, *news.migrants, *news.samples]
    islands |= {one.island for one in placed} | {one.to for one in news.migrants}
    if unknown := islands - set(scene.islands):
        raise MalformedMessage(f"update: the run has no island {min(unknown)}")
    dated: list[Any] = [*news.births, *news.deaths, *news.migrants, *news.samples]
    for one in dated:
        if one.sim_time_s is not None and not 0.0 <= one.sim_time_s <= _LATEST_S:
            raise MalformedMessage(
                f"update: times must be in [0, {_LATEST_S:g}] s, got {one.sim_time_s}"
            )
    texts = [gone.reason for gone in news.deaths]
    texts += [text for man in news.workers for text in (man.name, man.platform)]
    if any(len(text) > LONGEST_REASON for text in texts):
        raise MalformedMessage(
            f"update: texts must have <= {LONGEST_REASON} characters"
        )
    for body in (one.body for one in news.births if one.body is not None):
        try:
            check_tree(body)
            check_body(body, scene.space)
        except InvalidRobot as error:
            raise MalformedMessage(f"update: {error}") from None


def received_poses(live: Live, scene: Scene) -> pa.Table:
    """Return the poses of a message.

    Raises:
        MalformedMessage: no columns of poses; of no arena; times or numbers that are
            not finite, beyond their limits, or times that descend.
    """
    if live.shard not in scene.arenas:
        raise MalformedMessage(f"poses: the run has no arena {live.shard}")
    poses = PoseArrays.received(live.advance.poses)
    times = poses.times_s
    if not ((times >= 0.0) & (times <= _LATEST_S)).all() or (np.diff(times) < 0).any():
        raise MalformedMessage(
            f"poses: times must ascend from 0 to {_LATEST_S:g} s at most"
        )
    if not (np.abs(poses.cores[:, :3]) <= GREATEST_COORDINATE).all():
        raise MalformedMessage("poses: x, y and z must be a finite position")
    if not poses.are_finite:
        raise MalformedMessage("poses: attitudes and angles must be finite")
    return poses.rows()
