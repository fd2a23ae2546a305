"""Picture of what the viewer shows, drawn on a machine without a screen.

revolve view runs/a --save run.rrd
python viewer_picture.py run.rrd run.png [PORT]
"""

import socket
import sys
import time
from pathlib import Path

from rerun.experimental import ViewerClient

with socket.socket() as free:  # another viewer may use Rerun's own port
    free.bind(("", 0))
    port = free.getsockname()[1]
recording, picture, port = (*sys.argv[1:], port)[:3]
program = str(Path(sys.executable).with_name("rerun"))
with ViewerClient.spawn(
    headless=True, port=int(port), executable_path=program
) as viewer:
    viewer.open(recording)
    while viewer.get_state().loading or not viewer.get_state().views:
        time.sleep(0.1)
    # Another moment: viewer.set_time("sim_time", duration=60.0, play_state="paused")
    time.sleep(3.0)  # the viewer does not say when it has drawn what it has loaded
    Path(picture).write_bytes(viewer.take_screenshot())
