"""Calibrated parts, and pushes."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from msgspec.structs import replace

from schema.errors import ExperimentError
from schema.experiment.document import Fitness, Simulation, Space, body_space
from schema.experiment.environment import FLAT, Environment
from schema.experiment.identity import NO_IDENTITY, Identity, Origin
from schema.experiment.robust import Calibration, Response
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.mjcf.model import solo_spec
from schema.robot.brain import INPUT, Brain, Neuron, Widths
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats
from tests.documents import parse_experiment
from tests.worker.evaluations import IDENTITY, ORIGIN, OTHERS, with_simulation
from worker.bench.spider import spider
from worker.filters.channels import Calibrated
from worker.robot.evaluation import evaluate, simulate

TICK_S = 0.125
SETTINGS = with_simulation(Simulation(window_steps=400))


def calibrated(*entries: Calibration, robot: Robot | None = None) -> Calibrated:
    return Calibrated(
        robot or spider(),
        body_space(Space()),
        entries,
        tick_s=TICK_S,
        width=Widths(10, 10, 10),
    )


def course(found: Calibrated, *values: float) -> list[float]:
    """Return the first output that arrives at each tick."""
    outputs = np.zeros((1, 10))
    arrived = []
    for tick, value in enumerate(values):
        outputs[0, 0] = value
        arrived.append(float(found.outputs(tick, outputs)[0, 0]))
    return arrived


def test_motor_by_hand() -> None:
    motor = Response(gain=0.8, offset=0.05, delay_s=2 * TICK_S)
    found = calibrated(Calibration(part="ActiveHinge", motor=motor))
    # Neutral until the first output arrives; 7.0 is clipped to 1.
    wanted = [0.55, 0.55, 0.5 + 0.8 * 0.5 + 0.05, 0.5 - 0.8 * 0.5 + 0.05]
    assert course(found, 7.0, 0.0, 0.3, 0.5) == pytest.approx(wanted)


def test_sensor_by_hand() -> None:
    """A core with six inputs, and four pads that are ideal."""
    sensor = Response(gain=2.0, offset=-1.0, delay_s=TICK_S)
    found = calibrated(Calibration(part="Core", sensor=sensor))
    first, second = np.arange(10.0)[None], np.full((1, 10), 10.0)
    # Before the first tick the readings were those of the first tick.
    wanted = [-1.0, 1.0, 3.0, 5.0, 7.0, 9.0]
    assert found.readings(0, first).tolist() == [[*wanted, 6.0, 7.0, 8.0, 9.0]]
    assert found.readings(1, second).tolist() == [[*wanted, *[10.0] * 4]]
    assert found.readings(0, first).tolist() == [[*[19.0] * 6, 6.0, 7.0, 8.0, 9.0]]


def test_other_part_types_are_ideal() -> None:
    found = calibrated(Calibration(part="ParametricBarJoint"))
    readings = np.arange(10.0)[None]
    assert found.readings(0, readings).tolist() == readings.tolist()
    assert course(found, 0.3, 0.9) == [0.3, 0.9]
    assert found.noise is None


def test_noise_is_of_the_parts_and_of_the_identity() -> None:
    motor = Response(noise=0.2)
    found = calibrated(Calibration(part="ActiveHinge", motor=motor)).noise
    assert found is not None
    motors = sum(part.kind == "ActiveHinge" for part in spider().parts)
    assert found[0].tolist() == [0.0] * 10
    assert found[1].tolist() == [0.2] * motors + [0.0] * (10 - motors)
    noisy = replace(
        SETTINGS, calibration=(Calibration(part="ActiveHinge", motor=motor),)
    )
    names = (NO_IDENTITY, Identity(Origin(seed=1), BirthId(0, 0), 0))
    first, second = (evaluate(spider(), noisy, each) for each in names)
    assert first == evaluate(spider(), noisy, NO_IDENTITY)
    assert len({first.fitness, second.fitness}) == 2


def test_noise_of_the_simulation_is_added_to_that_of_a_part() -> None:
    """0.3 and 0.4 together are 0.5, of the same draws."""
    world = replace(SETTINGS.simulation, actuator_noise=0.3)
    motor = Response(noise=0.4)
    both = replace(
        SETTINGS,
        simulation=world,
        calibration=(Calibration(part="ActiveHinge", motor=motor),),
    )
    one = replace(
        SETTINGS,
        calibration=(Calibration(part="ActiveHinge", motor=Response(noise=0.5)),),
    )
    assert evaluate(spider(), both).fitness == pytest.approx(
        evaluate(spider(), one).fitness, rel=1e-3
    )


FILE = """
[[calibration]]
part = "ActiveHinge"
motor = {gain = 0.9, delay_s = 0.125}
[[calibration]]
part = "TouchSensor"
[calibration.sensor]
noise = 0.1
"""


def test_a_file_is_read_beside_the_document(tmp_path: Path) -> None:
    (tmp_path / "mine.toml").write_text(FILE)
    text = 'name = "a"\ncalibration = "mine.toml"\n'
    found = parse_experiment(text, str(tmp_path / "a.toml"))
    assert found.calibration == (
        Calibration(part="ActiveHinge", motor=Response(gain=0.9, delay_s=0.125)),
        Calibration(part="TouchSensor", sensor=Response(noise=0.1)),
    )
    inline = parse_experiment(f'name = "a"\n{FILE}', "a.toml")
    assert inline == found
    assert evaluation_settings_of(found).calibration == found.calibration
    (tmp_path / "mine.toml").write_text("births = 3")
    with pytest.raises(ExperimentError, match=r"mine.toml: must hold .*, got births"):
        parse_experiment(text, str(tmp_path / "a.toml"))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("calibration = 'x.toml'", "calibration: x.toml: cannot be read: No such file"),
        ("[calibration]", r"calibration: must be \[\[calibration\]\]"),
        (
            "[[calibration]]\npart = 'ActivHinge'",
            r"calibration\[0\].part: no part type .* did you mean 'ActiveHinge'",
        ),
        (
            "[[calibration]]\npart = 'Core'\nmotor = {gain = 2.0}",
            r"calibration\[0\].motor: 'Core' has no motor",
        ),
        (
            "[[calibration]]\npart = 'Hinge'\nsensor = {gain = 2.0}",
            r"calibration\[0\].sensor: 'Hinge' has no sensor",
        ),
        (
            "[[calibration]]\npart = 'Core'\n[[calibration]]\npart = 'Core'",
            r"calibration\[0\].part: two entries are of 'Core'",
        ),
        (
            "[[calibration]]\npart = 'Core'\nsensor = {delay_s = 0.02}",
            r"calibration\[0\].sensor.delay_s: must be a whole multiple of 0.125, ",
        ),
        ("[[calibration]]\npart = 'Core'\n[arena]", "calibration: is for off-line"),
        (
            "[[calibration]]\npart = 'Core'\nsensor = {gian = 1.0}",
            r"calibration\[0\].sensor.gian: no such key; did you mean 'gain'",
        ),
    ],
)
def test_refused_values_name_the_key(text: str, message: str) -> None:
    with pytest.raises(ExperimentError, match=message):
        parse_experiment(f'name = "a"\n{text}', "a.toml")


CORE = Robot(
    (Part("Core", -1, -1, -1, 0, (0.5, 0.5, 0.5)),),
    Brain(tuple(Neuron("input", INPUT, 0) for _ in range(6))),
)
WEIGHTLESS = Simulation(gravity=0.0, drop_m=1.0, window_steps=400)
PUSHED = Environment(push_impulse=0.03, push_interval_s=0.5)


def velocities(
    identity: Identity,
    environment: Environment = PUSHED,
    simulation: Simulation = WEIGHTLESS,
) -> Floats:
    """Return a core's linear velocity at each tick of 0.125 s, (T, 3) [m/s]."""
    settings = EvaluationSettings(
        space=Space(), simulation=simulation, fitness=Fitness(), environment=environment
    )
    found: list[Floats] = []
    simulate(
        CORE,
        settings,
        watch=lambda data: found.append(data.qvel[:3].copy()),
        identity=identity,
    )
    return np.array(found)


def core_mass() -> float:
    model = solo_spec(CORE, body_space(Space()), WEIGHTLESS, FLAT).compile()
    return float(mujoco.mj_getTotalmass(model))


def test_each_push_changes_the_momentum_by_its_impulse() -> None:
    """Pushes begin at ticks 4, 8 and 12 and last one tick each."""
    found = velocities(IDENTITY)
    changes = np.diff(found, axis=0)
    sizes = np.linalg.norm(changes, axis=1) * core_mass()
    expected = np.zeros(len(sizes))
    expected[[4, 8, 12]] = 0.03
    assert sizes == pytest.approx(expected, abs=1e-9)
    assert np.abs(found[:, 2]).max() < 1e-12
    first, second, third = changes[[4, 8, 12], :2].tolist()
    assert first != pytest.approx(second)
    assert second != pytest.approx(third)


def test_directions_are_uniform() -> None:
    turns = []
    for number in range(40):
        identity = Identity(ORIGIN, BirthId(0, number), 0)
        x, y = velocities(identity)[5, :2].tolist()
        turns.append(np.arctan2(y, x) / (2.0 * np.pi) % 1.0)
    counts, _ = np.histogram(turns, bins=4, range=(0.0, 1.0))
    # Four quarters of 40: mean 10, standard deviation 2.7.
    assert counts.min() >= 3


def test_pushes_depend_on_the_identity_only() -> None:
    first = velocities(IDENTITY)
    assert velocities(IDENTITY).tobytes() == first.tobytes()
    for other in OTHERS:
        assert velocities(other).tobytes() != first.tobytes()


def test_without_impulse_there_are_no_pushes() -> None:
    still = Environment(push_interval_s=0.5)
    assert not velocities(IDENTITY, still).any()
    assert not velocities(NO_IDENTITY, still).any()
