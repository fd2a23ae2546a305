"""Brain types as a kind of plug-in, for the commands that list and check them."""

from collections.abc import Callable, Iterator

from coordinator.evolution.brains import BUILT_IN, brain_genes
from coordinator.evolution.check_brain_genes import check_brain_genes
from schema.experiment.brains import BRAIN_METHODS
from schema.experiment.document import BrainSection, Experiment
from schema.experiment.kinds import Kind, Use


def brain_kind(check_control: Callable[[Experiment], None]) -> Kind:
    """Return the kind of brain types.

    Args:
        check_control: raises unless the half that runs in workers keeps its contract.
    """

    def use(experiment: Experiment) -> Use:
        def check(_: object) -> None:
            check_brain_genes(experiment)
            check_control(experiment)

        path = experiment.brain.type
        return Use("brain.type", path, lambda: type(brain_genes(experiment)), check)

    def used(experiment: Experiment) -> Iterator[Use]:
        yield use(experiment)

    def by_hand(path: str) -> Use:
        return use(Experiment(name="check", brain=BrainSection(type=path)))

    return Kind("brain", BUILT_IN, _is_brain_type, by_hand, used)


def _is_brain_type(plugin: object) -> bool:
    has_all = all(hasattr(plugin, name) for name in BRAIN_METHODS)
    return isinstance(plugin, type) and has_all
