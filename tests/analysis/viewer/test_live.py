"""What a viewer makes of updates, hubs and coordinators."""

import time
from collections.abc import Iterator

import pytest
import zenoh

from analysis.viewer.live import LiveMessage, LiveSource, Sequel
from analysis.viewer.presence import PATIENCE_S, SETTLED_S, Presence
from schema.agent.address import new_socket
from schema.agent.network import client_config, hub_config
from schema.agent.service import session_config
from schema.agent.topics import FleetMember
from schema.robot.ids import BirthId
from schema.wire.codec import encode
from schema.wire.updates import Birth, Page, Update, decode_page, pages_of

LONGEST_S = 30.0
CHIEF = FleetMember("default", "coordinator", "chief.1")
OTHER = FleetMember("default", "coordinator", "another.1")


def news(
    sequence: int, *, epoch: int = 1, is_whole: bool = False, births: int = 0
) -> Update:
    born = tuple(
        Birth(BirthId(0, number), (), 1, number + 1, None, None)
        for number in range(births)
    )
    return Update("host:/run", epoch, sequence, is_whole, "e", births=born)


@pytest.mark.parametrize(
    ("places", "was_lost", "state", "is_behind"),
    [
        ([], False, 5, False),
        ([(1, 2), (1, 3)], False, 5, False),
        ([(1, 1), (1, 2), (1, 1), (1, 2)], False, 5, False),  # duplicates
        ([(1, 6), (1, 7)], True, 5, False),  # they came while the pages travelled
        ([(1, 3), (1, 4), (1, 5), (1, 6)], True, 5, False),
        ([(1, 7), (1, 8)], True, 5, True),  # 6 was lost
        ([(1, 6), (1, 8)], True, 5, True),  # 7 was lost
        ([(1, 6), (1, 8)], True, 7, False),
        ([(1, 6), (1, 7)], True, 9, False),
        ([(2, 1)], True, 9, True),  # of an epoch after the state's
    ],
)
def test_updates_go_on_from_a_state_or_one_was_lost(
    places: list[tuple[int, int]],
    was_lost: bool,  # noqa: FBT001 - a parameter of the test
    state: int,
    is_behind: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    assert Sequel().is_behind
    sequel = Sequel()
    assert sequel.take(news(1, is_whole=True))
    for epoch, sequence in places:
        assert sequel.take(news(sequence, epoch=epoch))
    assert sequel.is_behind is was_lost
    assert sequel.take(news(state, is_whole=True))
    assert sequel.is_behind is is_behind
    epoch, last = max([(1, state), *places])
    assert sequel.take(news(last + 1, epoch=epoch))
    assert sequel.is_behind is is_behind
    for whole in (False, True):
        assert not sequel.take(Update("host:/other", 1, last + 1, whole, "e"))
    assert sequel.take(news(last + 1, epoch=epoch, is_whole=True))
    assert not sequel.is_behind


class Chief:
    """A coordinator with a state of three pages.

    Attributes:
        asked: the requests.
        sent: numbers of the pages that it sent.
    """

    def __init__(
        self, member: FleetMember, session: zenoh.Session, state: Update
    ) -> None:
        self.asked: list[Page] = []
        self.sent: list[int] = []
        self._member, self._session = member, session
        self._pages = pages_of(state)
        assert len(self._pages) == 3
        self._lost = [1]
        self._held = [
            session.declare_queryable(member.state, self._answer, complete=True),
            session.liveliness().declare_token(member.alive),
        ]

    def _answer(self, query: zenoh.Query) -> None:
        """Send two pages; one is lost at first, and an update comes after."""
        with query:
            assert query.payload is not None
            request = decode_page(query.payload.to_bytes())
            self.asked.append(request)
            for number in range(request.page, min(request.page + 2, 3)):
                if number in self._lost:
                    self._lost.remove(number)
                    continue
                self.sent.append(number)
                query.reply(self._member.state, self._pages[number])
        if len(self.asked) == 1:
            # As a coordinator publishes: behind the pages.
            self._session.put(
                self._member.events, encode(news(8)), priority=zenoh.Priority.DATA_LOW
            )


@pytest.fixture
def address() -> Iterator[str]:
    address = new_socket()
    with zenoh.open(zenoh.Config.from_json5(hub_config((address,)))):
        yield address


@pytest.mark.system
@pytest.mark.timeout(60)
def test_a_viewer_gets_pages_that_were_lost_and_the_updates_meanwhile(
    address: str,
) -> None:
    """A coordinator that sends nothing does not keep the viewer from the other one."""
    text = client_config(address)
    with (
        zenoh.open(session_config(text, CHIEF)) as session,
        zenoh.open(session_config(text, OTHER)) as silent,
    ):
        ignored = silent.declare_queryable(OTHER.state, lambda query: query.drop())  # type: ignore[no-untyped-call]
        token = silent.liveliness().declare_token(OTHER.alive)
        state = news(7, is_whole=True, births=1300)
        chief = Chief(CHIEF, session, state)
        got: list[LiveMessage] = []
        end_s = time.monotonic() + LONGEST_S
        with LiveSource(address, "default", None) as source:
            while len(got) < 2:
                assert time.monotonic() < end_s
                got += source.receive(0.1, time.monotonic())
            assert source.dropped == 0
        assert got == [news(8), state]
        assert chief.asked == [Page(b""), Page(b"", sequence=7, page=1)]
        assert chief.sent == [0, 1, 2]
        del token, ignored


HUB, NEW_HUB, CHIEFS_HUB = (frozenset({name}) for name in ("a0", "b1", CHIEF.session))
NONE: frozenset[str] = frozenset()
BOTH = (CHIEF, OTHER)

Step = tuple[tuple[FleetMember, ...], frozenset[str], float]


@pytest.mark.parametrize(
    ("steps", "has_ended"),
    [
        # Its own coordinator stays away.
        ([((OTHER,), HUB, 1.0), ((OTHER,), HUB, 1.0 + 0.9 * SETTLED_S)], False),
        ([((OTHER,), HUB, 1.0), ((OTHER,), HUB, 1.0 + SETTLED_S)], True),
        # Another one may leave.
        ([((CHIEF,), HUB, 1.0), ((CHIEF,), HUB, 100.0)], False),
        # The run goes on without the hub and after its return.
        (
            [((), NONE, 1.0), ((), NONE, 1000.0), ((), HUB, 1001.0),
             ((), HUB, 1001.0 + 0.9 * PATIENCE_S),
             ((CHIEF,), HUB, 1001.0 + 2 * PATIENCE_S)],
            False,
        ),
        # A hub was started again, and its absence was not noticed.
        ([((), NEW_HUB, 1.0), ((), NEW_HUB, 1.0 + 0.9 * PATIENCE_S)], False),
        ([((), NEW_HUB, 1.0), ((), NEW_HUB, 1.0 + 1.01 * PATIENCE_S)], True),
        # Only the hub comes back.
        ([((), NONE, 1.0), ((), HUB, 2.0), ((), HUB, 2.0 + 1.01 * PATIENCE_S)], True),
        # The hub is the coordinator itself.
        ([(BOTH, CHIEFS_HUB, 1.0), (BOTH, NONE, 2.0)], True),
    ],
)  # fmt: skip
def test_a_run_has_ended_when_its_coordinator_stays_away(
    steps: list[Step],
    has_ended: bool,  # noqa: FBT001 - a parameter of the test
) -> None:
    presence = Presence()
    presence.coordinators = {each.alive: each for each in BOTH}
    presence.watch(CHIEF.alive)
    presence.look(HUB, 0.0)
    for there, hubs, now_s in steps:
        assert not presence.has_ended
        presence.coordinators = {each.alive: each for each in there}
        presence.look(hubs, now_s)
    assert presence.has_ended == has_ended


def test_nothing_has_ended_before_a_run_is_watched() -> None:
    presence = Presence()
    for hubs, now_s in ((HUB, 0.0), (NONE, 1.0), (HUB, 100.0), (HUB, 200.0)):
        presence.look(hubs, now_s)
    assert not presence.has_ended
