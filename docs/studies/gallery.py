"""Makes the films and recordings of docs/gallery/.

    python -m docs.studies.gallery FOLDER

The robots of the tasks are those that docs/studies/tasks.py kept. The arenas are runs
of scenario 3 and of docs/gallery/hundreds.toml, whose founders are those of
runs/elites; runs are made if they are not there yet (a quarter of an hour). Each film
is a GIF of the first seconds; pages (.html) open in a browser, and recordings (.rrd) in
Rerun's viewer.
"""

import shutil
import subprocess
import sys
from pathlib import Path

from PIL import Image

from analysis.render import files
from analysis.render.motion import Shown
from analysis.render.picture import RobotRenderer
from analysis.render.stage import Picture, choose_engine
from schema.experiment.document import Experiment, body_space
from schema.experiment.file import read_experiment
from schema.experiment.settings import evaluation_settings_of
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.robot.trace import Floats

ROOT = Path(__file__).resolve().parents[2]
GALLERY = ROOT / "docs" / "gallery"
SIZE = (220, 165)
"""Width and height of a film [pixels]."""
ARENA_SIZE = (300, 225)
COLOURS = 28
MOST_BYTES = 300_000
"""Greatest size of a film; frames at its end are left out."""
PAGE_S = 20.0
"""Motion that the page of all robots plays [s]."""
FRAMES = 60
"""Frames of a robot's film, one per tick of its brain: 7.5 s."""
ARENA = ("scenario3", "--seed", "7", "--births", "90")
SHOWN = (500.0, 520.0)
"""Simulated time of the arena that is shown [s]."""
ELITES = ("map-elites", "--seed", "1", "--births", "1500", "--out", "runs/elites")
HUNDREDS = (str(GALLERY / "hundreds.toml"), "--seed", "3")
CROWDED, RECORDED = (385.0, 400.0), (398.0, 400.0)
"""Simulated times of the arena of 400 robots of its film and recording [s]."""
CROWDED_SIZE = (800, 450)
WALK = (
    "docs/tasks_data/locomotion.yaml",
    "--size",
    "360x270",
    "--seconds",
    "8",
    "--fps",
    "12",
)


def main(folder: Path) -> int:
    """Make all files; return 0."""
    choose_engine()
    # It imports MuJoCo, which needs to know the engine.
    from analysis.viewer.arena_film import SPEED, draw_film  # noqa: PLC0415 - the same
    from docs.studies.tasks import ROBOTS, TASKS  # noqa: PLC0415
    from schema.formats.files import read_robot  # noqa: PLC0415

    shown: Shown = {}
    for task, (shipped, _) in TASKS.items():
        experiment = read_experiment(shipped)
        robot = read_robot(ROBOTS / f"{task}.yaml", body_space(experiment.space))
        shown[task] = robot, evaluation_settings_of(experiment)
        film_robot(robot, experiment, GALLERY / f"{task}.gif")
        record_robot(task, robot, experiment, GALLERY / f"{task}.rrd")
    write_page(shown, GALLERY / "robots.html")
    revolve("robot", "render", *WALK, str(GALLERY / "walk.gif"))
    if not (ROOT / "runs" / "elites").exists():
        revolve("run", *ELITES)
    runs = {"arena": ARENA, "hundreds": HUNDREDS}
    for name, words in runs.items():
        if not (folder / name).exists():
            revolve("run", *words, "--out", str(folder / name))
    pictures, times_s = draw_film(folder / "arena", SHOWN, ARENA_SIZE)
    save_film(pictures, GALLERY / "arena.gif", (times_s[1] - times_s[0]) / SPEED)
    pictures, times_s = draw_film(folder / "hundreds", CROWDED, CROWDED_SIZE)
    interval_s = (times_s[1] - times_s[0]) / SPEED
    files.save_film(pictures, GALLERY / "hundreds.gif", interval_s)
    for name, ending, start_s, end_s in (
        ("arena", "rrd", *SHOWN),
        ("arena", "html", *SHOWN),
        ("hundreds", "rrd", *RECORDED),
    ):
        span = ("--from", str(start_s), "--until", str(end_s))
        out = GALLERY / f"{name}.{ending}"
        revolve("view", str(folder / name), *span, "--save", str(out))
    shutil.copy(folder / "arena" / "best.yaml", GALLERY / "arena.yaml")
    for path in sorted(GALLERY.iterdir()):
        print(f"{path.name}: {path.stat().st_size / 1000:.0f} kB")
    return 0


def revolve(*words: str) -> None:
    """Run a command of ours."""
    subprocess.run([sys.executable, "-m", "revolve", *words], cwd=ROOT, check=True)


def save_film(pictures: list[Picture], path: Path, interval_s: float) -> None:
    """Write a small GIF: few colours, all taken from the middle picture."""
    middle = Image.fromarray(pictures[len(pictures) // 2])
    # Colours that cover small robots on a large floor, too.
    palette = middle.quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
    first, *others = [
        Image.fromarray(each).quantize(palette=palette, dither=Image.Dither.NONE)
        for each in pictures
    ]
    pause_ms = round(1000 * interval_s)
    while True:
        first.save(path, save_all=True, append_images=others, duration=pause_ms, loop=0)
        if path.stat().st_size <= MOST_BYTES:
            break
        del others[-4:]


def film_robot(robot: Robot, experiment: Experiment, path: Path) -> None:
    """Write a film of an evaluation, with a camera that follows the robot."""
    from analysis.render.motion import frames, recorded  # noqa: PLC0415 - after the engine
    from worker.robot.evaluation import simulate  # noqa: PLC0415 - the same

    settings = evaluation_settings_of(experiment)
    tick_s = settings.simulation.tick_s
    poses = recorded(simulate, robot, settings, tick_s)[:FRAMES]
    with RobotRenderer(robot, settings, size=SIZE) as renderer:
        views = frames(renderer, poses, "follow", tick_s)
        pictures = list(map(renderer.picture, poses, views))
    save_film(pictures, path, tick_s)


def write_page(shown: Shown, path: Path) -> None:
    """Write a page of the first seconds of all robots, side by side."""
    from analysis.page.robots import INTERVAL_S, page_of  # noqa: PLC0415 - after the engine
    from analysis.render.command import lasting_for  # noqa: PLC0415 - the same
    from analysis.render.motion import recorded  # noqa: PLC0415 - the same
    from worker.robot.evaluation import evaluate, simulate  # noqa: PLC0415 - the same

    commands: list[list[Floats]] = [[] for _ in shown]
    motions = [
        recorded(simulate, robot, lasting_for(own, PAGE_S), INTERVAL_S, ticks)
        for (robot, own), ticks in zip(shown.values(), commands, strict=True)
    ]
    facts = [{"fitness": evaluate(*one).fitness} for one in shown.values()]
    path.write_text(page_of(shown, motions, commands, facts, INTERVAL_S), "utf-8")


def record_robot(name: str, robot: Robot, experiment: Experiment, path: Path) -> None:
    """Write a recording of an evaluation, with ground and scenery."""
    from analysis.viewer.blueprint import layout  # noqa: PLC0415 - after the engine
    from analysis.viewer.body import box_model  # noqa: PLC0415 - the same
    from analysis.viewer.motion import Motion, show_motion  # noqa: PLC0415 - the same
    from analysis.viewer.recording import Recording  # noqa: PLC0415 - the same
    from analysis.viewer.scene import scene_of  # noqa: PLC0415 - the same
    from schema.experiment.identity import NO_IDENTITY  # noqa: PLC0415 - the same
    from worker.arena.replay import alone  # noqa: PLC0415 - the same

    settings = evaluation_settings_of(experiment)
    evaluation, poses = alone(robot, settings, NO_IDENTITY)
    birth = BirthId(0, 0)
    verdict = f"{name}: fitness {evaluation.fitness:.4f}"
    scene = scene_of(experiment)
    model = box_model(robot, scene.space, is_plain=True)
    blueprint = layout(scene, motions=[birth])
    with Recording(f"gallery-{name}", blueprint, file=path) as recording:
        recording.upright("motion")
        recording.ground("motion", scene.below([birth]))
        show_motion(recording, Motion(birth, poses, verdict), model, None)


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1])))
