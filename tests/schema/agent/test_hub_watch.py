"""What a process tells about its hub."""

import pytest

from schema.agent.service import HubLost, HubWatch


@pytest.mark.parametrize(
    ("tells_first", "seen", "told"),
    [
        (True, ["a", "a"], ["connected to hub"]),
        (False, ["a", "a"], []),
        (True, ["", "a"], ["gone", "connected to hub"]),
        (False, ["", "a"], ["gone", "connected to hub"]),
        (True, ["a", "", "", "a"], ["connected to hub", "lost", "back"]),
        (False, ["a", "", "b", "b"], ["lost", "back"]),
        (False, ["a", "b", "b"], ["lost", "back"]),
    ],
)
def test_it_tells_when_the_hub_comes_and_goes(
    *, tells_first: bool, seen: list[str], told: list[str]
) -> None:
    lines: list[str] = []
    watch = HubWatch("hub", lines.append, lines.append, tells_first=tells_first)
    for hubs in seen:
        watch.seen(hubs)
    names = {
        "no hub at hub; retrying; press Ctrl-C to stop": "gone",
        "no hub at hub (it ended, or the network is down); retrying; "
        "press Ctrl-C to stop": "lost",
        "reconnected to hub": "back",
    }
    assert [names.get(line, line) for line in lines] == told


def test_it_gives_up_after_the_time() -> None:
    watch = HubWatch("hub", print, print, give_up_after_s=0.0)
    watch.seen(())
    with pytest.raises(HubLost, match="no hub at hub for 0 s: giving up"):
        watch.seen(())
