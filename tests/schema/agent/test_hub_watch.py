"""What a process tells about its hub."""

import pytest

from schema.agent.service import HubLost, HubWatch


@pytest.mark.parametrize(
    ("tells_first", "seen", "told"),
    [
        (True, [True, True], ["connected to hub"]),
        (False, [True, True], []),
        (True, [False, True], ["gone", "connected to hub"]),
        (False, [False, True], ["gone", "connected to hub"]),
        (True, [True, False, False, True], ["connected to hub", "lost", "back"]),
        (False, [True, False, True], ["lost", "back"]),
    ],
)
def test_it_tells_when_the_hub_comes_and_goes(
    *, tells_first: bool, seen: list[bool], told: list[str]
) -> None:
    lines: list[str] = []
    watch = HubWatch("hub", lines.append, lines.append, tells_first=tells_first)
    for is_there in seen:
        watch.seen(is_there=is_there)
    names = {
        "no hub at hub; retrying; press Ctrl-C to stop": "gone",
        "no hub at hub (it ended, or the network is down); retrying; "
        "press Ctrl-C to stop": "lost",
        "reconnected to hub": "back",
    }
    assert [names.get(line, line) for line in lines] == told


def test_it_gives_up_after_the_time() -> None:
    watch = HubWatch("hub", print, print, give_up_after_s=0.0)
    watch.seen(is_there=False)
    with pytest.raises(HubLost, match="no hub at hub for 0 s: giving up"):
        watch.seen(is_there=False)
