"""Bytes of what the coordinator tells those who watch, and back."""

from schema.wire import revolve_pb2 as pb
from schema.wire.arena_messages import birth_from_message, birth_to_message
from schema.wire.messages import finite, parsed, robot_from_message, robot_to_message
from schema.wire.news import Crewman, Departed, Level, Migrant, Newborn, News


def encode_news(news: News) -> bytes:
    """Return the bytes of news."""
    message = pb.News(
        run=news.run,
        epoch=news.epoch,
        sequence=news.sequence,
        is_whole=news.is_whole,
        experiment=news.experiment,
        document=news.document,
    )
    for one in news.births:
        _write_newborn(one, message.births.add())
    for gone in news.deaths:
        message.deaths.add(
            island=gone.island,
            birth=birth_to_message(gone.birth),
            births=gone.births,
            sim_time_s=gone.sim_time_s,
            reason=gone.reason,
        )
    for level in news.levels:
        message.levels.add(
            island=level.island,
            births=level.births,
            size=level.size,
            judged=level.judged,
            mean=level.mean,
            best=level.best,
            members=map(birth_to_message, level.members),
        )
    for each in news.migrants:
        message.migrants.add(
            birth=birth_to_message(each.birth),
            island=each.island,
            to=each.to,
            epoch=each.epoch,
            births=each.births,
            is_timed=each.sim_time_s is not None,
            sim_time_s=each.sim_time_s or 0.0,
        )
    for man in news.workers:
        message.workers.add(name=man.name, platform=man.platform, shards=man.shards)
    return message.SerializeToString(deterministic=True)


def decode_news(data: bytes) -> News:
    """Return the news of some bytes.

    Raises:
        MalformedMessage: other bytes, no tree of parts, a number that is not
            finite.
    """
    return _news(parsed(data, pb.News()))


def _write_newborn(one: Newborn, message: pb.Newborn) -> None:
    message.birth.CopyFrom(birth_to_message(one.birth))
    message.parents.extend(map(birth_to_message, one.parents))
    message.rank, message.births = one.rank, one.births
    if one.sim_time_s is not None:
        message.is_timed, message.sim_time_s = True, one.sim_time_s
    if one.body is not None:
        message.body.CopyFrom(robot_to_message(one.body))


def _news(message: pb.News) -> News:
    return News(
        run=message.run,
        epoch=message.epoch,
        sequence=message.sequence,
        is_whole=message.is_whole,
        experiment=message.experiment,
        document=message.document,
        births=tuple(map(_newborn, message.births)),
        deaths=tuple(map(_departed, message.deaths)),
        levels=tuple(map(_level, message.levels)),
        migrants=tuple(map(_migrant, message.migrants)),
        workers=tuple(
            Crewman(man.name, man.platform, tuple(man.shards))
            for man in message.workers
        ),
    )


def _newborn(message: pb.Newborn) -> Newborn:
    time_s = finite(message.sim_time_s, "newborn.sim_time_s")
    return Newborn(
        birth_from_message(message.birth),
        tuple(map(birth_from_message, message.parents)),
        message.rank,
        message.births,
        time_s if message.is_timed else None,
        robot_from_message(message.body) if message.HasField("body") else None,
    )


def _departed(message: pb.Departed) -> Departed:
    return Departed(
        message.island,
        birth_from_message(message.birth),
        message.births,
        finite(message.sim_time_s, "departed.sim_time_s"),
        message.reason,
    )


def _level(message: pb.Level) -> Level:
    return Level(
        island=message.island,
        births=message.births,
        size=message.size,
        judged=message.judged,
        mean=finite(message.mean, "level.mean"),
        best=finite(message.best, "level.best"),
        members=tuple(map(birth_from_message, message.members)),
    )


def _migrant(message: pb.Migrant) -> Migrant:
    time_s = finite(message.sim_time_s, "migrant.sim_time_s")
    return Migrant(
        birth_from_message(message.birth),
        message.island,
        message.to,
        message.epoch,
        message.births,
        time_s if message.is_timed else None,
    )
