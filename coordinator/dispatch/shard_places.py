"""Places of a run's arena shards in the fleet: a number for each of their parts."""

from collections.abc import Callable, Collection

from coordinator.dispatch.events import Assign, Client, Read
from coordinator.dispatch.fleet import JobRouter

Place = tuple[int, int]
"""Island of a shard, and a part of it; a shard that is not divided is part 0."""


class ShardPlaces:
    """The shards of one run, as the fleet numbers their parts."""

    def __init__(
        self,
        fleet: JobRouter,
        client: Client,
        encode: Callable[[Assign], tuple[bytes, Read]],
    ) -> None:
        """Initialise without shards; ``encode`` returns the request of an advance."""
        self._fleet, self._client, self._encode = fleet, client, encode
        self._numbers: dict[Place, int] = {}
        self._places: dict[int, Place] = {}

    @property
    def waiting(self) -> dict[int, str]:
        """Platforms of the shards that wait for a worker; "" is any platform."""
        return {
            self._places[number][0]: platform
            for number, platform in self._fleet.dispatch.homes.waiting.items()
            if number in self._places
        }

    def place(self, number: int) -> Place:
        """Return what a number of the fleet means."""
        return self._places[number]

    def number(self, place: Place, platform: str, *, may_drift: bool = True) -> int:
        """Return the number of a place, which may be new, on a platform."""
        if place not in self._numbers:
            number = self._fleet.new_shard(
                self._client, self._encode, platform, may_drift=may_drift
            )
            self._numbers[place], self._places[number] = number, place
        return self._numbers[place]

    def able(self, shard: int) -> int:
        """Return how many workers may hold a shard that has been advanced, or 0."""
        number, homes = self._numbers.get((shard, 0)), self._fleet.dispatch.homes
        return 0 if number is None else len(homes.fit(homes.of(number)))

    def holder(self, place: Place) -> str:
        """Return the name of the worker that holds a place; empty if none does."""
        number = self._numbers.get(place)
        return "" if number is None else self._fleet.dispatch.homes.holder(number)

    def holders(self, shard: int) -> list[str]:
        """Return the names of the workers that hold the parts of a shard."""
        held = {self.holder(place) for place in self._numbers if place[0] == shard}
        return sorted(held - {""})

    def keep(self, shard: int, parts: Collection[int]) -> None:
        """Take all other parts of a shard from their workers."""
        for place in list(self._numbers):
            if place[0] == shard and place[1] not in parts:
                self._fleet.release(self._numbers.pop(place))

    def make_whole(self, place: Place) -> None:
        """Let the worker of a part be that of the whole shard."""
        whole = (place[0], 0)
        first, last = self._numbers[whole], self._numbers[place]
        self._numbers[whole], self._numbers[place] = last, first
        self._places[first], self._places[last] = place, whole
