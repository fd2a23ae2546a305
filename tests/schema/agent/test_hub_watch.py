"""What a process tells about its hub."""

import pytest

from schema.agent.network import Tls
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


def test_it_tells_again_when_the_reason_changes(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A hub that comes back may refuse this process; it is looked for every 10 s."""
    clock, reason = [0.0], [""]
    lines: list[str] = []
    monkeypatch.setattr("schema.agent.service.time.monotonic", lambda: clock[0])
    monkeypatch.setattr(
        "schema.agent.service.why_no_hub",
        lambda address, _tls, gone: reason[0] or f"no hub at {address}{gone}",
    )
    files = Tls("ca", "own", "key")
    watch = HubWatch("tls/h:1", lines.append, lines.append, tls=files)
    for now_s, why in ((0.0, ""), (11.0, ""), (12.0, "expired"), (22.0, "expired")):
        clock[0], reason[0] = now_s, why
        watch.seen(())
    first, second = (line.partition(";")[0] for line in lines)
    assert (first, second) == ("no hub at tls/h:1", "expired")


def test_it_gives_up_after_the_time() -> None:
    watch = HubWatch("hub", print, print, give_up_after_s=0.0)
    watch.seen(())
    with pytest.raises(HubLost, match="no hub at hub for 0 s: giving up"):
        watch.seen(())
