from revolve.arena import Arena as Arena
from revolve.bodies import body_distance as body_distance
from revolve.bodies import vet as vet
from revolve.campaign import Runs as Runs
from revolve.campaign import read as read
from revolve.command import main as main
from revolve.evaluation import Result as Result
from revolve.evaluation import evaluate as evaluate
from revolve.evaluation import simulate as simulate
from revolve.experiment import Experiment as Experiment
from revolve.fleet import Fleet as Fleet
from revolve.genome import Genome as Genome
from revolve.reports import Analysis as Analysis
from revolve.reports import analyze as analyze
from revolve.robot import Robot as Robot
from revolve.runs import Run as Run
from revolve.runs import resume as resume
from revolve.runs import run as run
from schema.errors import ExperimentError as ExperimentError
from schema.errors import FitnessUndefined as FitnessUndefined
from schema.errors import InvalidRobot as InvalidRobot
from schema.errors import JobRefused as JobRefused
from schema.errors import NetworkError as NetworkError
from schema.errors import RevolveError as RevolveError
from schema.errors import RunFolderError as RunFolderError
from schema.errors import SensorFailed as SensorFailed
from schema.errors import SimulationDiverged as SimulationDiverged
from schema.errors import UnknownPlugin as UnknownPlugin
from schema.parts import Box as Box
from schema.parts import Joint as Joint
from schema.parts import Motor as Motor
from schema.parts import Parameter as Parameter
from schema.parts import PartType as PartType
from schema.parts import Sensor as Sensor
from schema.parts import Shape as Shape
from schema.parts import Slot as Slot
from schema.parts import constant_shape as constant_shape
from schema.parts import cylinder as cylinder
from schema.plugins.needs import needs as needs
from schema.plugins.permission import allow as allow
from schema.plugins.protocols import Bank as Bank
from schema.plugins.protocols import BrainControl as BrainControl
from schema.plugins.protocols import BrainGenes as BrainGenes
from schema.plugins.protocols import BrainRules as BrainRules
from schema.plugins.protocols import BrainType as BrainType
from schema.plugins.protocols import Branch as Branch
from schema.plugins.protocols import Draws as Draws
from schema.plugins.protocols import Encoding as Encoding
from schema.plugins.protocols import FitnessFunction as FitnessFunction
from schema.plugins.protocols import Learner as Learner
from schema.plugins.protocols import MeasureFunction as MeasureFunction
from schema.plugins.protocols import NeuronType as NeuronType
from schema.plugins.protocols import ParentSelection as ParentSelection
from schema.plugins.protocols import Selectable as Selectable
from schema.plugins.protocols import SensorType as SensorType
from schema.plugins.protocols import SensorView as SensorView
from schema.plugins.protocols import StatefulSelection as StatefulSelection
from schema.plugins.protocols import SurvivorSelection as SurvivorSelection
from schema.robot.archive import RobotOrigin as RobotOrigin
from schema.robot.brain import Brain as Brain
from schema.robot.brain import Connection as Connection
from schema.robot.brain import Neuron as Neuron
from schema.robot.brain import Widths as Widths
from schema.robot.genome import ConnectionGene as ConnectionGene
from schema.robot.genome import NeuronGene as NeuronGene
from schema.robot.neurons import Tick as Tick
from schema.robot.results import Report as Report
from schema.robot.robot import Part as Part
from schema.robot.trace import Trace as Trace
from schema.wire.operator import ArenaListing as ArenaListing
from schema.wire.operator import ListedRobot as ListedRobot

__all__ = [
    "Analysis",
    "Arena",
    "ArenaListing",
    "Bank",
    "Box",
    "Brain",
    "BrainControl",
    "BrainGenes",
    "BrainRules",
    "BrainType",
    "Branch",
    "Connection",
    "ConnectionGene",
    "Draws",
    "Encoding",
    "Experiment",
    "ExperimentError",
    "FitnessFunction",
    "FitnessUndefined",
    "Fleet",
    "Genome",
    "InvalidRobot",
    "JobRefused",
    "Joint",
    "Learner",
    "ListedRobot",
    "MeasureFunction",
    "Motor",
    "NetworkError",
    "Neuron",
    "NeuronGene",
    "NeuronType",
    "Parameter",
    "ParentSelection",
    "Part",
    "PartType",
    "Report",
    "Result",
    "RevolveError",
    "Robot",
    "RobotOrigin",
    "Run",
    "RunFolderError",
    "Runs",
    "Selectable",
    "Sensor",
    "SensorFailed",
    "SensorType",
    "SensorView",
    "Shape",
    "SimulationDiverged",
    "Slot",
    "StatefulSelection",
    "SurvivorSelection",
    "Tick",
    "Trace",
    "UnknownPlugin",
    "Widths",
    "allow",
    "analyze",
    "body_distance",
    "constant_shape",
    "cylinder",
    "evaluate",
    "needs",
    "read",
    "resume",
    "run",
    "simulate",
    "vet",
]
