"""Parquet with a checksum on every page, read within bounds and only in columns that are asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pandas as pd
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.dataset as ds
import pyarrow.parquet as pq

from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.inputs import check_expansion, existing_file

LONGEST_TEXT = 1000  # characters of a cell
DAMAGE = (
    pa.ArrowException,
    OSError,
    ValueError,
    TypeError,
    LookupError,
    NotImplementedError,
    MemoryError,
    OverflowError,
)


def write_table(table: pa.Table | pd.DataFrame, path: Path | str, *, compression: str = "snappy") -> None:
    """Write a table as one Parquet file whose pages carry checksums."""
    if isinstance(table, pd.DataFrame):
        table = pa.Table.from_pandas(table, preserve_index=False)
    pq.write_table(table, path, compression=compression, write_page_checksum=True)


def read_table(
    path: Path, choose: Callable[[list[str]], Iterable[str]] = lambda names: names, *, advice: str = ""
) -> pa.Table:
    """Read columns of a Parquet file, or of a folder of them.

    Texts come as dictionaries, so that a long one that is repeated is held once.

    Parameters
    ----------
    path : Path
        A file, or a folder whose parts have the same columns.
    choose : callable
        Gets the names that are there, each once, and returns those to read.
    advice : str, keyword-only
        What to do with a file that is none.

    Raises
    ------
    InputError
        If a file is damaged, unpacks to too much, or a column is there twice or holds neither numbers nor texts.
    """
    parts = _parts(path)
    try:
        found = ds.dataset(parts, format="parquet", **_hive(path)).schema
        _check_names(found.names, path)
        names = [name for name in choose(list(found.names)) if name in found.names]
        for name in names:
            _check_type(found.field(name), path)
        check_expansion(sum(Path(part).stat().st_size for part in parts), _unpacked(parts, len(names)), path)
        texts = {name for name in names if _is_text(found.field(name).type)}
        form = ds.ParquetFileFormat(
            read_options=ds.ParquetReadOptions(dictionary_columns=texts),
            default_fragment_scan_options=ds.ParquetFragmentScanOptions(page_checksum_verification=True),
        )
        table = ds.dataset(parts, format=form, **_hive(path)).to_table(columns=names)
        table.validate(full=True)
        _check_texts(table, path)
    except InputError:
        raise
    except DAMAGE as error:
        reason = (str(error).splitlines() or [type(error).__name__])[0][:120]
        raise InputError(
            f"{path}: is no whole Parquet file ({reason}); {advice or 'fetch or write it again'}"
        ) from None
    return table


def to_frame(table: pa.Table, *, categories: tuple[str, ...] = ()) -> pd.DataFrame:
    """Return a table as a data frame, whatever index pandas had noted in the file.

    Texts are objects, those of ``categories`` remain categories in the order of the file.
    """
    columns: dict[str, object] = {}
    for name in table.column_names:
        column = table.column(name)
        if pa.types.is_dictionary(column.type):
            column = column.unify_dictionaries()
        series = column.to_pandas()
        texts = isinstance(series.dtype, pd.CategoricalDtype | pd.StringDtype)
        columns[name] = series.astype(object) if texts and name not in categories else series
    return pd.DataFrame(columns, index=pd.RangeIndex(table.num_rows))


def _unpacked(parts: list[str], cells: int) -> int:
    """Return the larger of what the footers of the parts say and eight bytes a cell, ``cells`` a row."""
    rows = said = 0
    for part in parts:
        footer = pq.read_metadata(part)
        rows += footer.num_rows
        said += sum(footer.row_group(i).total_byte_size for i in range(footer.num_row_groups))
    return max(said, 8 * rows * cells)


def _parts(path: Path) -> list[str]:
    if not path.is_dir():
        return [str(existing_file(path))]
    parts = [str(part) for part in sorted(path.rglob("*.parquet")) if existing_file(part)]
    if not parts:
        raise InputError(f"{path}: is a folder without Parquet files; give a file")
    return parts


def _hive(path: Path) -> dict[str, str]:
    """Return how columns are told from the names of folders, such as ``period=0750-0805``."""
    return {"partitioning": "hive", "partition_base_dir": str(path)} if path.is_dir() else {}


def _check_names(names: list[str], path: Path) -> None:
    twice = [name for name in names if names.count(name) > 1] if len(names) < LONGEST_TEXT else []
    if len(names) >= LONGEST_TEXT:
        raise InputError(f"{path}: has {len(names)} columns; a recording has about 20")
    if twice:
        raise InputError(f"{path}: column {twice[0]!r} is there {names.count(twice[0])} times; keep one of them")


def _is_text(kind: pa.DataType) -> bool:
    return bool(pa.types.is_string(kind) or pa.types.is_large_string(kind) or pa.types.is_string_view(kind))


def _check_type(field: pa.Field, path: Path) -> None:
    kind = field.type.value_type if pa.types.is_dictionary(field.type) else field.type
    number = pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_decimal(kind)
    if not (number or _is_text(kind) or pa.types.is_null(kind) or pa.types.is_boolean(kind)):
        raise InputError(f"{path}: column {field.name!r} holds {kind}; give numbers or text")


def _check_texts(table: pa.Table, path: Path) -> None:
    """Raise for a text that is longer than any label, or no UTF-8."""
    for name in table.column_names:
        for chunk in table.column(name).chunks:
            values = chunk.dictionary if pa.types.is_dictionary(chunk.type) else chunk
            if _is_text(values.type) and len(values) and (pc.max(pc.binary_length(values)).as_py() or 0) > LONGEST_TEXT:
                raise InputError(f"{path}: column {name!r} has a text of more than {LONGEST_TEXT} characters")
