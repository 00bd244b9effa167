"""The last health report of each node of a graph."""

from ac_common.health import HealthReport, PlantReport, RecorderReport
from ac_common.topics import PLANT, RECORDER


class Reports(dict[str, dict[str, str]]):
    """Key-value pairs of the last report by node, as they came; typed when they are asked for."""

    def of(self, name: str) -> HealthReport:
        """Return what a node has reported last, as every node does; an empty report when it has not."""
        return HealthReport.read(self.get(name, {}))

    def of_plant(self) -> PlantReport:
        """Return what the plant has reported last of its own."""
        return PlantReport.read(self.get(PLANT, {}))

    def of_recorder(self) -> RecorderReport:
        """Return what the recorder has reported last of its own."""
        return RecorderReport.read(self.get(RECORDER, {}))
