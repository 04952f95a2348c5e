"""Download recorded trajectories from the agency's data portal, in pages that an interrupted run keeps."""

from __future__ import annotations

import shutil
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

import pooch
import pyarrow.parquet as pq
from pydantic import BaseModel, ConfigDict, ValidationError

from idm_sumo.recordings.inspection import Inspection, inspect_recording
from idm_sumo.recordings.portal import DEFAULT_URL, PAGE_ROWS, ChangedError, Portal, Stand, parse_page, schema
from idm_sumo.roads import DEFAULT
from idm_sumo.runtime.errors import InputError
from idm_sumo.runtime.files import new_file
from idm_sumo.runtime.progress import Progress, silent
from idm_sumo.runtime.siblings import locked, scratch


class Page(BaseModel):
    """A page that came whole."""

    model_config = ConfigDict(extra="forbid", frozen=True)
    rows: int
    sha256: str


class Manifest(BaseModel):
    """What was downloaded, from where; kept beside the result.

    Attributes
    ----------
    base_url, location, page_rows
        What was asked for, as in :class:`~idm_sumo.recordings.portal.Portal`.
    rows : int
        Rows of the location, as the portal counts them.
    modified : str
        When the portal says its data changed last, empty if it does not say.
    begun : str
        When the download began (UTC).
    pages : tuple of Page
        The pages that came whole, in order, without gaps.
    result : str
        SHA-256 of the finished file, empty while there is none.
    """

    model_config = ConfigDict(extra="forbid", frozen=True)
    base_url: str
    location: str
    page_rows: int
    rows: int
    modified: str
    begun: str
    pages: tuple[Page, ...] = ()
    result: str = ""


@dataclass(frozen=True)
class FetchResult:
    """A finished download.

    Attributes
    ----------
    path : pathlib.Path
        Parquet file in the portal's layout: official names, feet.
    manifest : pathlib.Path
        JSON file of :class:`Manifest`.
    location : str
        What it is of.
    rows : int
        Rows in it: as many as the portal counts.
    pages, loaded : int
        Pages in all, and those that had to be transferred this time.
    sha256 : str
        Of ``path``.
    modified : str
        When the portal says its data changed last, empty if it does not say.
    """

    path: Path
    manifest: Path
    location: str
    rows: int
    pages: int
    loaded: int
    sha256: str
    modified: str

    def inspect(self) -> Inspection:
        """Return where every downloaded row goes: what ``idm-sumo inspect`` says of the file.

        Raises
        ------
        AssertionError
            If not every row was read: a defect of this program.
        """
        inspection = inspect_recording(self.path, location=self.location)
        if inspection.rows.total != self.rows:
            raise AssertionError(f"{self.rows} rows fetched, {inspection.rows.total} read")
        return inspection


def fetch(
    dest: str | Path,
    *,
    base_url: str = DEFAULT_URL,
    location: str = DEFAULT.name,
    page_rows: int = PAGE_ROWS,
    progress: Progress = silent,
    retries: int = 5,
    backoff: float = 1.0,
    timeout: float = 120.0,
    verify: bool = False,
) -> FetchResult:
    """Download all rows of one location into ``dest/LOCATION.parquet``.

    The rows are counted first, loaded in pages and counted again. A page is kept when it has
    the rows it must have; its SHA-256 goes into ``LOCATION.manifest.json``. After an
    interruption the same call goes on: pages that are whole are not loaded again. pooch does
    not continue within a file, so the page under way is begun anew. A finished file is not
    loaded again at all. If the portal says that its data changed since, every page is compared.

    Parameters
    ----------
    dest : path-like
        Folder, made if need be.
    base_url : str, keyword-only
        The data set's address (SODA, CSV).
    location : str, keyword-only
        ``us-101``, ``i-80``, ``lankershim`` or ``peachtree``.
    page_rows : int, keyword-only
        Rows a page.
    progress : Progress, keyword-only
        Told the rows done and the rows in all.
    retries : int, keyword-only
        How often a failed request is tried again.
    backoff : float, keyword-only
        Pause before the first retry, s; doubled each time.
    timeout : float, keyword-only
        Longest silence of the portal, s.
    verify : bool, keyword-only
        Load every page again and compare it with the manifest, though nothing seems changed.

    Returns
    -------
    FetchResult

    Raises
    ------
    InputError
        If the portal cannot be reached or sends no good page, has no such rows, has other
        rows than before, or if what is on disk is not what was downloaded. Whole pages stay.
    """
    portal = Portal(base_url, location, page_rows, retries, backoff, timeout)
    try:
        return _Download(Path(dest), portal, progress).run(verify=verify)
    except OSError as error:
        reason = error.strerror or " ".join(str(error).split())
        raise InputError(f"{error.filename or dest}: cannot be read or written ({reason}); mend it and go on") from None


class _Download:
    """One location in one folder, on its way."""

    def __init__(self, folder: Path, portal: Portal, progress: Progress) -> None:
        self.folder, self.portal, self.progress = folder, portal, progress
        self.path = folder / f"{portal.location}.parquet"
        self.manifest_path = folder / f"{portal.location}.manifest.json"
        self.pages = folder / f"{portal.location}.pages"
        self.remedy = f"remove {folder / portal.location}.* to fetch it anew, or give another folder"
        self.loaded = 0

    def run(self, *, verify: bool) -> FetchResult:
        """Do what is left to do, unless another run is at it."""
        with locked(self.folder, "fetch"):
            return self._run(verify=verify)

    def _run(self, *, verify: bool) -> FetchResult:
        kept = self._kept()
        stand = self.portal.stand()
        manifest = kept or self._begin(stand)
        self._check_same(manifest, stand)
        newer = bool(stand.modified and manifest.modified) and stand.modified != manifest.modified
        if manifest.pages and (verify or newer):
            self._compare(manifest)
        manifest = self._save(manifest.model_copy(update={"modified": stand.modified or manifest.modified}))
        if manifest.result and self.path.exists():
            self._check_result(manifest)
        else:
            manifest = self._build(self._load(manifest))
        shutil.rmtree(self.pages, ignore_errors=True)
        return FetchResult(
            self.path, self.manifest_path, manifest.location, manifest.rows,
            len(manifest.pages), self.loaded, manifest.result, manifest.modified,
        )  # fmt: skip

    def _kept(self) -> Manifest | None:
        """Return the manifest of an earlier run, checked against what is asked for now."""
        if not self.manifest_path.exists():
            if self.path.exists():
                raise InputError(f"{self.path}: is there already, but was not fetched; move it away")
            return None
        try:
            kept = Manifest.model_validate_json(self.manifest_path.read_bytes())
        except ValidationError:
            raise InputError(f"{self.manifest_path}: is damaged; {self.remedy}") from None
        for name in ("base_url", "location", "page_rows"):
            was, now = getattr(kept, name), getattr(self.portal, name)
            if was != now:
                raise InputError(f"{self.manifest_path}: {name} was {was}, not {now}; keep to it, or {self.remedy}")
        return kept

    def _begin(self, stand: Stand) -> Manifest:
        portal, now = self.portal, datetime.now(UTC)
        return Manifest(
            base_url=portal.base_url, location=portal.location, page_rows=portal.page_rows,
            rows=stand.rows, modified=stand.modified, begun=f"{now:%Y-%m-%d %H:%M:%S} UTC",
        )  # fmt: skip

    def _check_same(self, manifest: Manifest, stand: Stand) -> None:
        if manifest.rows != stand.rows:
            raise ChangedError(
                f"{self.portal.base_url}: has {stand.rows} rows of {manifest.location} now, {manifest.rows} when the "
                f"download began ({manifest.begun}); keep what you have, or {self.remedy}"
            )

    def _compare(self, manifest: Manifest) -> None:
        """Load every page of the manifest once more, beside, and raise for the first that is another."""
        with scratch(self.folder) as beside:
            for number, page in enumerate(manifest.pages):
                self._load_page(manifest, number, beside, page.sha256).unlink()
                self.progress("comparing", number * manifest.page_rows + page.rows, manifest.rows)

    def _load(self, manifest: Manifest) -> Manifest:
        """Bring in every page that is not whole on disk; the manifest is saved after each new one."""
        for number in range(self.portal.pages(manifest.rows)):
            if number < len(manifest.pages):
                self._load_page(manifest, number, self.pages, manifest.pages[number].sha256)
            else:
                (self.pages / f"page-{number:05d}.csv").unlink(missing_ok=True)  # came, but was never booked
                path = self._load_page(manifest, number, self.pages, None)
                rows = self.portal.rows_of(number, manifest.rows)
                page = Page(rows=rows, sha256=pooch.file_hash(str(path)))
                manifest = self._save(manifest.model_copy(update={"pages": (*manifest.pages, page)}))
            self.progress("loading", sum(page.rows for page in manifest.pages[: number + 1]), manifest.rows)
        return self._check_still(manifest)

    def _check_still(self, manifest: Manifest) -> Manifest:
        """Return the manifest of pages that were loaded while nothing changed, or raise."""
        now = self.portal.stand()
        self._check_same(manifest, now)
        if now.modified != manifest.modified:
            self._compare(manifest)
        return manifest.model_copy(update={"modified": now.modified})

    def _load_page(self, manifest: Manifest, number: int, folder: Path, sha256: str | None) -> Path:
        before = folder / f"page-{number:05d}.csv"
        whole = before.exists() and sha256 is not None and pooch.file_hash(str(before)) == sha256
        try:
            path = self.portal.load(number, manifest.rows, folder, sha256=sha256)
        except ChangedError as error:
            raise ChangedError(f"{error} since {manifest.begun}; keep what you have, or {self.remedy}") from None
        except InputError as error:
            done = f"{len(manifest.pages)} of {self.portal.pages(manifest.rows)} pages are whole in {self.folder}"
            raise InputError(f"{error}; {done}: fetch again to go on") from None
        self.loaded += not whole
        return path

    def _build(self, manifest: Manifest) -> Manifest:
        """Write the pages into one file, check it, move it into place and book it."""
        told = {"fetched_from": manifest.base_url, "modified": manifest.modified, "fetched": manifest.begun}
        with new_file(self.path) as part:
            with pq.ParquetWriter(
                part, schema().with_metadata(told), compression="zstd", write_page_checksum=True
            ) as writer:
                for number, page in enumerate(manifest.pages):
                    path = self.pages / f"page-{number:05d}.csv"
                    table = parse_page(path, manifest.location, page.rows)
                    writer.write_table(table.replace_schema_metadata(told))
            if (rows := pq.read_metadata(part).num_rows) != manifest.rows:
                raise InputError(f"{self.path}: {rows} rows were written, not {manifest.rows}; is the disk full?")
            sha256 = str(pooch.file_hash(str(part)))
        return self._save(manifest.model_copy(update={"result": sha256}))

    def _check_result(self, manifest: Manifest) -> None:
        if pooch.file_hash(str(self.path)) != manifest.result:
            raise InputError(f"{self.path}: is not what was downloaded; remove it and fetch again to load it anew")

    def _save(self, manifest: Manifest) -> Manifest:
        with new_file(self.manifest_path) as part:
            part.write_text(manifest.model_dump_json(indent=1) + "\n", encoding="utf-8")
        return manifest
