"""A campaign's results on disk: Parquet parts that appear whole or not at all, so that whatever stops it loses little.

    DIR/flights/part-00000.parquet          the summary, a row a flight, PART flights a part, in order
    DIR/traces/part-00000.parquet           the traces of those flights that keep one
    DIR/traces/train/part-00000.parquet     in a data set, by its split
    DIR/mcap/train/episode-000000.mcap      where asked for

A part that isn't complete yet is written too, every few seconds and when the campaign is interrupted; it is written
again when more of it has been flown. In the end every file's bytes depend on the flights alone.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from sitl.atomic import atomically
from sitl.campaign.flight import Flight
from sitl.campaign.results import TRACE

FLIGHTS, TRACES, MCAP = "flights", "traces", "mcap"
_CODEC = "zstd"


class Store:
    """The parts of one campaign. split: in which part of the traces a flight belongs, '' for all in one.

    total: flights in all; part_flights: of one part; flights, traces: Arrow schemas. Raises OSError.
    """

    def __init__(
        self, folder: Path, total: int, part_flights: int, flights: Any, traces: Any, split: Callable[[int], str]
    ) -> None:
        self._folder, self._total, self._size = folder, total, part_flights
        self._schemas, self._split = (flights, traces), split
        self._rows: dict[int, dict[int, dict[str, Any]]] = {}  # by part and index: of parts not complete
        self._traces: dict[int, dict[int, Any]] = {}
        self._changed: set[int] = set()
        self.done: set[int] = set()

    def resume(self) -> list[dict[str, Any]]:
        """Take up what is there; its rows."""
        import pyarrow.parquet as pq

        rows: list[dict[str, Any]] = []
        for path in sorted((self._folder / FLIGHTS).glob("part-*.parquet")):
            part = int(path.stem.partition("-")[2])
            found = pq.read_table(path, schema=self._schemas[0]).to_pylist()
            rows += found
            self.done |= {row["index"] for row in found}
            if len(found) < self._in_part(part):
                self._rows[part] = {row["index"]: row for row in found}
                self._traces[part] = self._read_traces(part, self._rows[part])
        return rows

    def _read_traces(self, part: int, known: dict[int, Any]) -> dict[int, Any]:
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

        found = {}
        for path in (self._folder / TRACES).rglob(self._name(part)):
            table = pq.read_table(path, schema=self._schemas[1])
            for index in pc.unique(table["index"]).to_pylist():
                if index in known:
                    found[index] = table.filter(pc.equal(table["index"], index))
        return found

    def add(self, flight: Flight) -> None:
        import pyarrow as pa

        part = flight.number // self._size
        self.done.add(flight.number)
        self._rows.setdefault(part, {})[flight.number] = flight.row
        traces = self._traces.setdefault(part, {})
        if flight.mcap is not None:
            path = self._folder / MCAP / self._split(flight.number) / f"episode-{flight.number:06d}.mcap"
            data = flight.mcap
            atomically(path, lambda to: to.write_bytes(data))
        if flight.trace is not None:
            index = pa.repeat(pa.scalar(flight.number, pa.int64()), len(flight.trace[0]))
            traces[flight.number] = pa.Table.from_arrays([index, *flight.trace], schema=self._schemas[1])
        self._changed.add(part)
        if len(self._rows[part]) == self._in_part(part):
            self._write(part)
            del self._rows[part], self._traces[part]

    def flush(self) -> None:
        """Write what is there of parts that are not complete."""
        for part in sorted(self._changed):
            self._write(part)

    def _write(self, part: int) -> None:
        """The traces first: a flight counts as flown once its row is there."""
        import pyarrow as pa
        import pyarrow.parquet as pq

        rows, traces = self._rows[part], self._traces[part]
        for split in sorted({self._split(index) for index in traces}):
            tables = [traces[index] for index in sorted(traces) if self._split(index) == split]
            whole = pa.concat_tables(tables).combine_chunks()
            path = self._folder / TRACES / split / self._name(part)
            atomically(path, lambda to, w=whole: pq.write_table(w, to, compression=_CODEC))  # type: ignore[misc]
        table = pa.Table.from_pylist([rows[index] for index in sorted(rows)], schema=self._schemas[0])
        path = self._folder / FLIGHTS / self._name(part)
        atomically(path, lambda to: pq.write_table(table, to, compression=_CODEC))
        self._changed.discard(part)

    def _in_part(self, part: int) -> int:
        return min(self._size, self._total - part * self._size)

    @staticmethod
    def _name(part: int) -> str:
        return f"part-{part:05d}.parquet"


def table(folder: Path) -> Any:
    """The whole summary of a campaign's folder, an Arrow table in the flights' order."""
    import pyarrow.parquet as pq

    return pq.read_table(folder / FLIGHTS).sort_by("index")


assert TRACE[0].name == "index"
